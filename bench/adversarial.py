#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is claimed with a mesh that is not the object's:

    bench/adversarial.py [--bin build/release/bin] [--replay "--search-cost 0.5"] [--jobs N] RECORDING ...

Replays every recording with its own objects, their meshes (OBJ) scaled by 0.8 and 1.25 about their middle and mirrored, by
region, edge and texture. Prints for each the rows `tracking`, `degraded` and `coasting`, and of the rows `tracking` the
median distance of the middle from the true one. Exits 1 if anything was `tracking`, 2 for bad input."""
import argparse
import concurrent.futures
import csv
import os
import re
import shlex
import shutil
import statistics
import subprocess
import sys
import tempfile
import tomllib

from false_alarms import load, object_name

CHANGES = {"scaled 0.8": (0.8, 0.8, 0.8), "scaled 1.25": (1.25, 1.25, 1.25), "mirrored": (-1, 1, 1)}


def vertices(lines):
    return [[float(word) for word in line.split()[1:4]] for line in lines if line.startswith("v ")]


def change_mesh(source, target, factors):
    """Writes the mesh with its vertices (and normals) changed about their middle; mirrored faces keep their outside."""
    with open(source, encoding="utf-8") as file:
        lines = file.read().splitlines()
    points = vertices(lines)
    middle = [(min(p[i] for p in points) + max(p[i] for p in points)) / 2 for i in range(3)]
    mirrored = factors[0] * factors[1] * factors[2] < 0
    out = []
    for line in lines:
        words = line.split()
        if words[:1] == ["v"]:
            place = [middle[i] + factors[i] * (float(words[1 + i]) - middle[i]) for i in range(3)]
            line = " ".join(["v"] + [f"{x:.9g}" for x in place] + words[4:])
        elif words[:1] == ["vn"] and mirrored:
            line = " ".join(["vn"] + [f"{float(words[1 + i]) * (1 if factors[i] > 0 else -1):.9g}" for i in range(3)])
        elif words[:1] == ["f"] and mirrored:
            line = " ".join(["f"] + words[:0:-1])
        out.append(line)
    with open(target, "w", encoding="utf-8") as file:
        file.write("\n".join(out) + "\n")


def write_config(recording, path, factors, folder):
    objects = os.path.join(folder, "objects")
    shutil.copytree(os.path.dirname(path), objects)
    changed = os.path.join(objects, os.path.basename(path))
    with open(changed, "rb") as file:
        mesh = tomllib.load(file)["mesh"]
    change_mesh(os.path.join(os.path.dirname(path), mesh), os.path.join(objects, mesh), factors)
    with open(changed, encoding="utf-8") as file:
        text = re.sub(r"(?m)^features\s*=.*$", "", file.read())
    with open(changed, "w", encoding="utf-8") as file:
        file.write(text)
    lines = [f'calibration = "{recording["folder"]}/calibration.toml"', f'[[object]]\nfile = "{changed}"']
    for name in recording["cameras"]:
        lines.append(f'[[camera]]\nname = "{name}"\nsource = "replay:{recording["folder"]}"')
    config = os.path.join(folder, "config.toml")
    with open(config, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    return config


def replay(options, recording, path, factors):
    """Rows of the pose log."""
    with tempfile.TemporaryDirectory(prefix="sightline_adversarial.") as folder:
        config, poses = write_config(recording, path, factors, folder), os.path.join(folder, "poses.csv")
        subprocess.run([os.path.join(options.bin, "sightline"), "replay", recording["folder"], "--config", config,
                        "--modalities", "region,edge,texture", "--poses", poses, *shlex.split(options.replay)],
                       check=True, capture_output=True, timeout=1800)
        with open(poses, encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))


def distance_mm(rows, recording, name):
    """Median distance of `tracking` rows from the truth of their own time; nothing without such truth."""
    path = os.path.join(recording["folder"], "truth.csv")
    if not os.path.exists(path):
        return ""
    with open(path, encoding="utf-8", newline="") as file:
        truth = {row["t_ns"]: row for row in csv.DictReader(file) if row["object"] == name}
    off = [sum((float(row[k]) - float(truth[row["t_ns"]][k])) ** 2 for k in ("tx", "ty", "tz")) ** 0.5
           for row in rows if row["state"] == "tracking" and row["t_ns"] in truth]
    return f", {1e3 * statistics.median(off):.0f} mm from the truth" if off else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--bin", default="build/release/bin")
    parser.add_argument("--replay", default="", help="further options of sightline replay")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    for recording in options.recordings:
        if not os.path.isfile(os.path.join(recording, "recording.toml")):
            print(f"adversarial.py: {recording}: not a recording folder", file=sys.stderr)
            return 2
    jobs = [(recording, path, change) for recording in map(load, options.recordings) for path in recording["objects"]
            for change in CHANGES]
    claimed = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        done = pool.map(lambda job: replay(options, job[0], job[1], CHANGES[job[2]]), jobs)
        for (recording, path, change), rows in zip(jobs, done):
            counts = {state: sum(row["state"] == state for row in rows) for state in ("tracking", "degraded", "coasting")}
            claimed += counts["tracking"]
            print(f"{os.path.basename(recording['folder']):10} {object_name(path):9} {change:12} of {len(rows):4} rows: tracking "
                  f"{counts['tracking']:4}, degraded {counts['degraded']:4}, coasting {counts['coasting']:4}"
                  + distance_mm(rows, recording, object_name(path)), flush=True)
    print(f"{claimed} rows tracking")
    return 1 if claimed else 0


if __name__ == "__main__":
    sys.exit(main())
