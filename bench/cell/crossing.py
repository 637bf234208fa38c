#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""An object that goes from one cell to another and back, live: `crossing.py [--seconds S]` starts two brokers that bridge, two
fusion hosts and two camera hosts (the bundled recording, of which each cell sees its half), listens at both brokers, and
prints as JSON who published what: hand-overs, frames that nobody or both published, the jump of the error against the truth
from the last estimate of one cell to the first of the other, in millimeters and in what both claim (sigma), and the error."""
import argparse
import json
import math
import os
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tests", "system", "cell"))
from neighbor_support import NeighborsCase, Truth  # noqa: E402
from split import quantile  # noqa: E402

POSED = ("tracking", "degraded", "coasting")


def summary(tracks, truth):
    rows = sorted((track for track in tracks if track.state in POSED), key=lambda track: track.utc_ns)
    cells = {}
    for track in rows:
        if track.state != "coasting":
            cells.setdefault(track.utc_ns, set()).add(track.cell)
    frame = truth.frame_ns
    changes = [(a, b) for a, b in zip(rows, rows[1:]) if a.cell != b.cell]
    missing = [max(0, round((b.utc_ns - a.utc_ns) / frame) - 1) for a, b in changes]
    elsewhere = [max(0, round((b.utc_ns - a.utc_ns) / frame) - 1) for a, b in zip(rows, rows[1:]) if a.cell == b.cell]
    jumps, shares = [], []
    for a, b in changes:
        jump = truth.jump((a.utc_ns, a.place), (b.utc_ns, b.place))
        if jump is not None:
            jumps.append(1e3 * jump)
            shares.append(jump / math.hypot(a.sigma, b.sigma))
    errors = [(1e3 * math.hypot(*error), track) for track in rows if (error := truth.error(track.utc_ns, track.place))]
    return {"hand_overs": len(changes), "frames": len(cells), "published_twice": sum(len(who) > 1 for who in cells.values()),
            "missing_at_hand_overs": sum(missing), "missing_elsewhere": sum(elsewhere),
            "jump_mm_p50": round(quantile(jumps, .5), 2), "jump_mm_max": round(max(jumps, default=-1), 2),
            "jump_sigma_p50": round(quantile(shares, .5), 2), "jump_sigma_max": round(max(shares, default=-1), 2),
            "error_mm_p50": round(quantile([e for e, _ in errors], .5), 2),
            "error_mm_p95": round(quantile([e for e, _ in errors], .95), 2),
            "wrong": sum(e > 20 and track.state == "tracking" for e, track in errors)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--plain", action="store_true", help="the object has no markers: it has to be found and followed")
    arguments = parser.parse_args()
    case = NeighborsCase()
    case.setUp()
    try:
        if arguments.plain:
            case.take_markers()
        case.both_cells()
        heard = [case.listen(cell) for cell in (0, 1)]
        time.sleep(arguments.seconds)
        for cell, listener in zip(case.CELLS, heard):
            row = summary(list(listener.tracks), Truth(case.recording))
            row["adopted"] = [int(daemon.metric("sightline_cell_adopted_total")) for daemon in case.fusions]
            print(json.dumps({"listened_at": cell, **row, "load": round(os.getloadavg()[0], 1)}), flush=True)
    finally:
        case.doCleanups()


if __name__ == "__main__":
    main()
