#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What one camera alone makes of a recording of several:

    bench/claims/one_camera.py [--bin build/release/bin] [--replay='--search-cost 0.5'] [--jobs N] RECORDING ...

Replays each recording once for each of its cameras with nothing but that camera's frames, from nothing and without
markers, and compares with truth.csv or keyframes.csv. Prints a line per camera and object: rows within 5 cm + 5 deg up
to declared and shape's symmetries, rows `tracking` and `degraded`, wrong claims, median error, time of the first pose;
then the mean and the sum of wrong claims. Exits 2 for bad input."""
import concurrent.futures
import os
import pathlib
import re
import shutil
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from recording_tools import (add_jobs_option, add_replay_option, count_states, evaluate, load_recording,  # noqa: E402
                             read_csv, recording_parser, replay, up_to_symmetry, write_csv)

NAME = re.compile(r'^name *= *"([^"]+)"', re.M)


def keep_camera(path, camera):
    """Drops the [[camera]] tables of all others."""
    if not path.exists():
        return
    tables = re.split(r"^(?=\[\[?\w+\]?\])", path.read_text(encoding="utf-8"), flags=re.M)
    path.write_text("".join(table for table in tables
                            if not table.startswith("[[camera]]") or NAME.search(table).group(1) == camera),
                    encoding="utf-8")


def alone(recording, camera, folder):
    """A copy of the recording, in `folder`, that has this camera alone."""
    others = [video for name, video in recording.videos.items() if name != camera]
    copy = pathlib.Path(folder) / f"{recording.name}-{camera}"
    shutil.copytree(recording.folder, copy, ignore=lambda _, names: [name for name in names if name in others])
    keep_camera(copy / "recording.toml", camera)
    keep_camera(copy / "calibration.toml", camera)
    for table in ("frames.csv", "visibility.csv"):
        rows = read_csv(copy / table) if (copy / table).exists() else []
        if rows:
            write_csv(copy / table, rows[0].keys(), [row for row in rows if row["camera"] == camera])
    return load_recording(copy)


def measure(options, recording, camera):
    """(line, share within, wrong claims) of every object."""
    lines = []
    with tempfile.TemporaryDirectory(prefix="sightline_one_camera.") as folder:
        part = alone(recording, camera, folder)
        poses = os.path.join(folder, "poses.csv")
        rows = replay(options, part, poses)
        for result in evaluate(options.bin, part, poses):
            own = [row for row in rows if row["object"] == result["object"]]
            states = count_states(own)
            found = [int(row["t_ns"]) for row in own if row["state"] in ("tracking", "degraded")]
            best = up_to_symmetry(result)
            share = best["within"] / max(1, result["judged"])
            error = f"{best['errors']['median_mm']:.1f} mm" if found else "-"
            first = f"{(min(found) - part.start_ns) * 1e-9:.2f} s" if found else "never"
            cells = (recording.name, camera, result["object"], f"{100 * share:.1f} %", states["tracking"],
                     states["degraded"], result["wrong_claims"], error, first)
            lines.append((f"| {' | '.join(map(str, cells))} |", share, result["wrong_claims"]))
    return lines


def main():
    parser = recording_parser(__doc__)
    add_replay_option(parser)
    add_jobs_option(parser)
    options = parser.parse_args()
    print("| recording | camera | object | within | `tracking` | `degraded` | wrong claims | median | first |")
    print("|" + " --- |" * 9, flush=True)
    shares, wrong = [], 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        jobs = [pool.submit(measure, options, recording, camera)
                for recording in options.recordings for camera in recording.cameras]
        for job in jobs:
            for line, share, claims in job.result():
                print(line, flush=True)
                shares.append(share)
                wrong += claims
    print(f"\nmean {100 * sum(shares) / max(1, len(shares)):.1f} %, {wrong} wrong claims")
    return 0


if __name__ == "__main__":
    sys.exit(main())
