#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whether the claimed covariance is right, axis by axis:

    bench/claims/covariance.py [--bin build/release/bin] [--synthetic] [--one-camera] RECORDING ...

Follows the first object of each recording from next to the truth (track_recording) and prints a Markdown table:
squared error over claimed variance while `tracking` (1 expected) for turns about and moves along the object's axes,
and for rotation, position and pose together, each divided by its degrees of freedom. "independent" is to how many
independent estimates the correlated ones amount. Outside of the 95 % band of a mean over so many: "<" covariance too
wide, ">" too narrow. --one-camera: each of a recording's cameras alone. --synthetic: also rendered recordings of 1 to
4 cameras. Exits 2 for bad input."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from recording_tools import read_csv, recording_parser, write_csv  # noqa: E402

HEADER = ("| recording | object | cameras | estimates | independent | rx | ry | rz | tx | ty | tz | rotation | position "
          "| pose |")


def row(options, name, folder):
    done = subprocess.run([os.path.join(options.bin, "track_recording"), folder, "--consistency"],
                          capture_output=True, text=True, timeout=1800, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{name}: {done.stderr.strip()}")
    lines = [line for line in done.stdout.splitlines() if line.startswith("|")]
    print(f"| {name} {lines[0]}" if lines else f"| {name} | never `tracking` |" + " |" * 12, flush=True)


def keep_camera(path, camera):
    """Drops the [[camera]] tables of all others."""
    head, *tables = re.split(r"^(?=\[\[?\w+\]?\])", path.read_text(encoding="utf-8"), flags=re.M)
    own = re.compile(rf'^name *= *"{re.escape(camera)}"', re.M)
    kept = [table for table in tables if not table.startswith("[[camera]]") or own.search(table)]
    path.write_text(head + "".join(kept), encoding="utf-8")


def alone(recording, camera, folder):
    """A copy of the recording that has this camera alone: track_recording takes no configuration."""
    copy = pathlib.Path(folder) / f"{recording.name}-{camera}"
    others = {video for name, video in recording.videos.items() if name != camera}
    shutil.copytree(recording.folder, copy, ignore=lambda _, names: others.intersection(names))
    keep_camera(copy / "recording.toml", camera)
    keep_camera(copy / "calibration.toml", camera)
    for table in filter(pathlib.Path.exists, (copy / "frames.csv", copy / "visibility.csv")):
        rows = read_csv(table)
        write_csv(table, rows[0].keys(), [row for row in rows if row["camera"] == camera])
    return copy


def each_camera(options, recording):
    for camera in recording.cameras:
        with tempfile.TemporaryDirectory(prefix="sightline_covariance.") as folder:
            row(options, f"{recording.name}, {camera}", alone(recording, camera, folder))


def synthetic(options):
    for cameras in (1, 2, 3, 4):
        with tempfile.TemporaryDirectory(prefix="sightline_covariance.") as folder:
            out = os.path.join(folder, "recording")
            subprocess.run([os.path.join(options.bin, "make_synthetic_recording"), out, "--shape", "creature",
                            "--cameras", str(cameras), "--spread-deg", "60", "--seconds", "3"],
                           check=True, capture_output=True, timeout=600)
            row(options, f"rendered, {cameras}", out)


def main():
    parser = recording_parser(__doc__)
    parser.add_argument("--synthetic", action="store_true")
    parser.add_argument("--one-camera", action="store_true")
    options = parser.parse_args()
    print(HEADER)
    print("|" + " --- |" * 14)
    for recording in options.recordings:
        if options.one_camera:
            each_camera(options, recording)
            continue
        row(options, recording.name, recording.folder)
    if options.synthetic:
        synthetic(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
