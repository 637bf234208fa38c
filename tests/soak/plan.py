# SPDX-License-Identifier: Apache-2.0
"""What will happen when, from a seed: the same seed is the same plan."""
import random

CYCLE_S, CALM_S = 30, 8  # of each cycle the last seconds are calm: nobody watches, nothing is broken
CAMERAS = 8
MORTAL = 2               # of them come over the network from a process that dies

# Kinds of faults, and how often one of them is drawn against the others.
KINDS = {"camera_dies": 2, "viewer_stops_reading": 2, "reload": 3, "bad_reload": 1, "recording": 3, "broker_away": 1,
         "disk_full": 1, "events_reader": 2, "pictures": 2, "order_overlay": 1}
# Each of these takes place in every cycle, so that a short soak has them all.
LIGHT = ("reload", "recording", "viewer_stops_reading", "camera_dies")
VIEWERS_S = 3.0          # a viewer comes so often, on average ...
STAY_S = (2.0, 9.0)      # ... and stays so long
FAULT_S = 3.0


def cycles(minutes):
    return max(1, round(minutes * 60 / CYCLE_S))


def make(seed, minutes):
    """[(seconds since the start, kind, seconds it lasts, a number to choose by)], in order of time; calm where it must be."""
    dice = random.Random(seed)
    plan = []
    for cycle in range(cycles(minutes)):
        busy = CYCLE_S - CALM_S
        start = cycle * CYCLE_S

        def add(kind, longest):
            at = dice.uniform(0, busy - 2)
            lasts = min(dice.uniform(1, longest), busy - at)
            plan.append((start + at, kind, lasts, dice.randrange(1 << 16)))

        for _ in range(round(busy / VIEWERS_S)):
            add("viewer", STAY_S[1])
        for kind in LIGHT:
            add(kind, 6)
        for _ in range(round(busy / FAULT_S) - len(LIGHT)):
            add(dice.choices(list(KINDS), list(KINDS.values()))[0], 6)
        rare = [kind for kind in KINDS if kind not in LIGHT]
        for kind in (rare[cycle * 2 % len(rare)], rare[(cycle * 2 + 1) % len(rare)]):
            add(kind, 6)
    return sorted(plan)
