#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A recording as if its cameras had more pixels:

    bench/enlarge.py [--factor 2] RECORDING FOLDER

Writes RECORDING with images FACTOR times as wide and high to FOLDER, which must not exist: videos are scaled (Lanczos)
and encoded again, almost without loss; focal lengths, centers and boxes of calibration.toml, recording.toml and
visibility.csv go with it. The images gain no detail, as those of a camera whose lens is less sharp than its sensor; what
a search or a tracker makes of them should be what it makes of the recording itself. Needs ffmpeg. Exits 2 for bad input."""
import argparse
import pathlib
import re
import shutil
import subprocess
import sys

from recording_tools import load_recording, read_csv, recording_argument, write_csv

ENCODE_S = 900
EDGES, AREA = ("xmin", "ymin", "xmax", "ymax"), "inimage_pixels"


def scaled(text, factor):
    """Sizes, focal lengths and centers of a TOML file, in so many times as many pixels. (0, 0) is the middle of the first
    pixel, so that a coordinate x becomes factor (x + 1/2) - 1/2."""
    number = r"(?m)^(\s*(?:%s)\s*=\s*)([-+0-9.eE]+)"
    text = re.sub(number % "width|height", lambda m: f"{m[1]}{round(int(m[2]) * factor)}", text)
    text = re.sub(number % "fx|fy", lambda m: f"{m[1]}{float(m[2]) * factor:.9g}", text)
    return re.sub(number % "cx|cy", lambda m: f"{m[1]}{factor * (float(m[2]) + 0.5) - 0.5:.9g}", text)


def enlarge_visibility(path, factor):
    rows = read_csv(path) if path.exists() else []
    for row in rows:
        for edge in EDGES:
            row[edge] = f"{factor * (float(row[edge]) + 0.5) - 0.5:.2f}"
        row[AREA] = round(int(row[AREA]) * factor * factor)
    if rows:
        write_csv(path, rows[0].keys(), rows)


def enlarge(recording, folder, factor):
    """The recording with that many times as many pixels a side, in a new folder."""
    shutil.copytree(recording.folder, folder, ignore=shutil.ignore_patterns("*.mkv", "poses.csv"))
    for name in ("recording.toml", "calibration.toml"):
        path = folder / name
        text = re.sub(r'(?m)^codec\s*=.*$', 'codec = "h264"', path.read_text(encoding="utf-8"))
        path.write_text(scaled(text, factor), encoding="utf-8")
    for video in recording.videos.values():
        chain = f"scale=trunc(iw*{factor}+0.5):trunc(ih*{factor}+0.5):flags=lanczos"
        subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", recording.folder / video, "-vf", chain, "-an", "-c:v",
                        "libx264", "-crf", "8", "-preset", "veryfast", "-g", "15", "-pix_fmt", "yuv420p",
                        "-color_range", "tv", folder / video], check=True, timeout=ENCODE_S)
    enlarge_visibility(folder / "visibility.csv", factor)
    return load_recording(folder)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=recording_argument, metavar="RECORDING")
    parser.add_argument("folder", type=pathlib.Path, metavar="FOLDER")
    parser.add_argument("--factor", type=float, default=2)
    options = parser.parse_args()
    if options.folder.exists():
        parser.error(f"{options.folder}: exists")
    if not 0.25 <= options.factor <= 4:
        parser.error("--factor: 0.25 to 4")
    enlarge(options.recording, options.folder, options.factor)
    return 0


if __name__ == "__main__":
    sys.exit(main())
