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
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from one_camera import alone  # noqa: E402
from recording_tools import recording_parser  # noqa: E402

HEADER = ("| recording | object | cameras | estimates | independent | rx | ry | rz | tx | ty | tz | rotation | position "
          "| pose |")


def row(options, name, folder):
    done = subprocess.run([os.path.join(options.bin, "track_recording"), folder, "--consistency"],
                          capture_output=True, text=True, timeout=1800, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{name}: {done.stderr.strip()}")
    lines = [line for line in done.stdout.splitlines() if line.startswith("|")]
    print(f"| {name} {lines[0]}" if lines else f"| {name} | never `tracking` |" + " |" * 12, flush=True)


def each_camera(options, recording):
    for camera in recording.cameras:
        with tempfile.TemporaryDirectory(prefix="sightline_covariance.") as folder:
            row(options, f"{recording.name}, {camera}", alone(recording, camera, folder).folder)


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
