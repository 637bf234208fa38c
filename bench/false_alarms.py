#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is claimed to be there and is not:

    bench/false_alarms.py [--bin build/release/bin] [--replay "--search-cost 0.5"] [--jobs N] RECORDING ...

Replays every recording with the object of every other one, which is not in its images (objects of the same name are left
out), by region, edge and texture. Prints the pairs in which anything was claimed, with rows `tracking`, `degraded` and
`coasting`, then totals: seconds of footage, rows, `tracking` rows, and stretches of `degraded` a minute. Exits 1 if
anything was `tracking`, 2 for bad input."""
import argparse
import concurrent.futures
import csv
import glob
import os
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib


def load(recording):
    with open(os.path.join(recording, "recording.toml"), "rb") as file:
        description = tomllib.load(file)
    with open(os.path.join(recording, "frames.csv"), encoding="utf-8", newline="") as file:
        times = [int(row["capture_ns"]) for row in csv.DictReader(file)]
    objects = sorted(glob.glob(os.path.join(recording, "objects", "*.toml")))
    return {"folder": os.path.abspath(recording), "cameras": [camera["name"] for camera in description["camera"]],
            "objects": objects, "seconds": (max(times) - min(times)) * 1e-9}


def object_name(path):
    with open(path, "rb") as file:
        return tomllib.load(file)["name"]


def write_config(recording, path, folder):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    base = os.path.dirname(os.path.abspath(path))
    text = re.sub(r'^(\s*(?:mesh|features)\s*=\s*")([^"/][^"]*)"', lambda m: f'{m[1]}{os.path.join(base, m[2])}"', text,
                  flags=re.MULTILINE)
    other = os.path.join(folder, "object.toml")
    with open(other, "w", encoding="utf-8") as file:
        file.write(text)
    lines = [f'calibration = "{recording["folder"]}/calibration.toml"', f'[[object]]\nfile = "{other}"']
    for name in recording["cameras"]:
        lines.append(f'[[camera]]\nname = "{name}"\nsource = "replay:{recording["folder"]}"')
    config = os.path.join(folder, "config.toml")
    with open(config, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    return config


def claims(options, recording, path):
    """States of the rows of a replay with this object, in order."""
    with tempfile.TemporaryDirectory(prefix="sightline_false.") as folder:
        config, poses = write_config(recording, path, folder), os.path.join(folder, "poses.csv")
        subprocess.run([os.path.join(options.bin, "sightline"), "replay", recording["folder"], "--config", config,
                        "--modalities", "region,edge,texture", "--poses", poses, *shlex.split(options.replay)],
                       check=True, capture_output=True, timeout=1800)
        with open(poses, encoding="utf-8", newline="") as file:
            return [row["state"] for row in csv.DictReader(file)]


def stretches(states, state):
    """How often it is entered."""
    return sum(a == state and b != state for a, b in zip(states, [None] + states))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--bin", default="build/release/bin")
    parser.add_argument("--replay", default="", help="further options of sightline replay")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    for recording in options.recordings:
        if not os.path.isfile(os.path.join(recording, "recording.toml")):
            print(f"false_alarms.py: {recording}: not a recording folder", file=sys.stderr)
            return 2
    recordings = [load(recording) for recording in options.recordings]
    paths = {object_name(path): path for recording in recordings for path in recording["objects"]}
    pairs = [(recording, name) for recording in recordings for name in sorted(paths)
             if name not in [object_name(path) for path in recording["objects"]]]
    seconds = rows = tracking = degraded = entered = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for (recording, name), states in zip(pairs, pool.map(lambda pair: claims(options, pair[0], paths[pair[1]]), pairs)):
            counts = {state: states.count(state) for state in ("tracking", "degraded", "coasting")}
            seconds += recording["seconds"]
            rows += len(states)
            tracking += counts["tracking"]
            degraded += counts["degraded"]
            entered += stretches(states, "degraded")
            if any(counts.values()):
                print(f"{os.path.basename(recording['folder']):12} with {name:10} of {len(states):4} rows: tracking "
                      f"{counts['tracking']:3}, degraded {counts['degraded']:3}, coasting {counts['coasting']:3}", flush=True)
    print(f"{len(pairs)} pairs, {seconds / 60:.1f} minutes, {rows} rows: {tracking} tracking, {degraded} degraded in {entered} "
          f"stretches ({entered / max(1e-9, seconds / 60):.1f} a minute)")
    return 1 if tracking else 0


if __name__ == "__main__":
    sys.exit(main())
