# SPDX-License-Identifier: Apache-2.0
"""Judges a soak: what it held at the calm end of each cycle, and what viewers and monitor saw."""
import statistics

WARM_UP = 0.25    # of the cycles, and two at least: caches, allocators and threads reach their size
FLAT = 0.01       # growth of memory from the first half of the calm moments to the second; and a step of the allocator:
STEP_KB = 4096
ROWS = 8          # calm moments after the warm-up from which that is judged; with fewer the allocator still grows:
SHORT = 3         # so many times as much is allowed
SETTLED = 4       # descriptors and threads more than at the first calm moment after the warm-up
POLLS = 0.95      # share of health polls that were answered well; a busy machine is late now and then
SILENCE_S = 8     # between two signs of life, which systemd waits 10 s for
STOP_S = 10
IMPOSSIBLE = " (not possible here)"  # after the name of a fault, in the counts


def quantile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))] if values else None


def after_warm_up(calm):
    return calm[min(max(2, round(WARM_UP * len(calm))), max(0, len(calm) - 2)):]


def growth(calm):
    """(growth of memory as a share, kB before, kB after), by medians of the halves after the warm-up."""
    rows = after_warm_up(calm)
    half = max(1, len(rows) // 2)
    before = statistics.median(row["rss_kb"] for row in rows[:half])
    after = statistics.median(row["rss_kb"] for row in rows[-half:])
    return after / before - 1, before, after


def judge(seen):
    """[(what, ok, measured, allowed)] of {"calm", "counts", "planned", "polls", "fed", "opened", "present", "stop"}."""
    calm, lines = seen["calm"], []
    share, before, after = growth(calm)
    flat = FLAT * (1 if len(after_warm_up(calm)) >= ROWS else SHORT)
    lines.append(("memory: growth after the warm-up", after - before <= max(flat * before, STEP_KB),
                  f"{100 * share:+.2f} % ({before / 1024:.1f} to {after / 1024:.1f} MB)",
                  f"{100 * flat:.0f} %, or {STEP_KB // 1024} MB"))
    rows = after_warm_up(calm)
    for what in ("descriptors", "threads"):
        lines.append((f"{what}: more at the end than after the warm-up", rows[-1][what] <= rows[0][what] + SETTLED,
                      f"{rows[0][what]} to {rows[-1][what]}, {max(row['most_' + what] for row in calm)} at most", f"+{SETTLED}"))
    bad = [poll for poll in seen["polls"] if poll[2]]
    lines.append(("/healthz answered well", len(bad) <= (1 - POLLS) * len(seen["polls"]) and seen["polls"],
                  f"{len(seen['polls']) - len(bad)} of {len(seen['polls'])}", f"{100 * POLLS:.0f} %"))
    gap = max((b - a for a, b in zip(seen["fed"], seen["fed"][1:])), default=1e9)
    lines.append(("watchdog: longest time between two signs of life", gap <= SILENCE_S, f"{gap:.1f} s", f"{SILENCE_S} s"))
    lines.append(("cameras that were not touched: opened again", all(count == 0 for count in seen["opened"].values()),
                  seen["opened"], "0 each"))
    lines.append(("cameras present at the end", all(seen["present"].values()), seen["present"], "all"))
    missing = sorted(kind for kind in seen["planned"] if not any(done in seen["counts"] for done in (kind, kind + IMPOSSIBLE)))
    lines.append(("faults that took place", not missing, seen["counts"], f"all planned{', missing ' + str(missing) if missing else ''}"))
    lines.append(("end after SIGTERM", seen["stop"][1] == 0 and seen["stop"][0] <= STOP_S,
                  f"{seen['stop'][0]:.1f} s, status {seen['stop'][1]}", f"{STOP_S} s, 0"))
    watched = seen["viewers"]
    if "viewer" not in seen["planned"]:
        return lines
    lines.append(("viewers that got frames", watched["with_frames"] >= 0.8 * watched["all"] and watched["all"] > 0,
                  f"{watched['with_frames']} of {watched['all']}", "80 %"))
    return lines
