#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Notes when the machine itself stood still: it sleeps for moments at real-time priority, so that no program but only the
machine (a hypervisor that gave the cores to somebody else) can wake it late. Started by siege.py; JSON when its input ends."""
import json
import os
import select
import sys
import time

MOMENT_S, LATE_S = 0.005, 0.015


def main():
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
        real_time = True
    except PermissionError:
        real_time = False  # then it is not told from other programs, and nothing may be excused by it
    stalls = []  # (end [ns of CLOCK_MONOTONIC], seconds)
    print("ready", flush=True)
    while True:
        since = time.monotonic()
        ready, _, _ = select.select([sys.stdin], [], [], MOMENT_S)
        late = time.monotonic() - since - MOMENT_S
        if late > LATE_S:
            stalls.append((time.monotonic_ns(), late))
        if ready:
            break
    json.dump({"real_time": real_time, "stalls": stalls}, sys.stdout)


if __name__ == "__main__":
    main()
