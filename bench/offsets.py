#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is found from nothing, wherever a recording begins:

    bench/offsets.py [--bin build/release/bin] [--parts N] [--replay "--instant-search"] RECORDING ...

Cuts each recording at N places (0 to 3/4 of its length; the videos are encoded again, almost without loss), replays each
part by itself with `sightline replay --modalities region,edge,texture` and compares it with truth.csv or keyframes.csv.
Prints per object the share of judged rows within 5 cm + 5 deg up to declared and shape's symmetries, wrong claims, and
for each part rows within, wrong claims, median error and time of the first pose. Needs ffmpeg. Exits 2 for bad input."""
import argparse
import csv
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib


def read_csv(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def cut(recording, out, start_s):
    """The rest of a recording from `start_s` after its first frame on."""
    shutil.copytree(recording, out, ignore=shutil.ignore_patterns("*.mkv"))
    with open(os.path.join(recording, "recording.toml"), "rb") as file:
        description = tomllib.load(file)
    rows = read_csv(os.path.join(recording, "frames.csv"))
    first = min(int(row["capture_ns"]) for row in rows) + round(start_s * 1e9)
    with open(os.path.join(out, "frames.csv"), "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(row for row in rows if int(row["capture_ns"]) >= first)
    for truth in ("truth.csv", "keyframes.csv"):
        cut_truth(os.path.join(out, truth), first)
    for camera in description["camera"]:
        gone = sum(row["camera"] == camera["name"] and int(row["capture_ns"]) < first for row in rows)
        subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", os.path.join(recording, camera["file"]), "-vf",
                        f"trim=start_frame={gone},setpts=PTS-STARTPTS", "-an", "-c:v", "libx264", "-crf", "4", "-preset",
                        "veryfast", "-g", "15", "-pix_fmt", "yuv420p", "-color_range", "tv",
                        os.path.join(out, camera["file"])], check=True, timeout=300)
    return description["objects"]


def cut_truth(path, first):
    """Drops the rows of a truth file from before `first` (ns); 10 ms are allowed for a camera's offset."""
    if not os.path.exists(path):
        return
    rows = read_csv(path)
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(row for row in rows if int(row["t_ns"]) >= first - 10_000_000)


def evaluate(binaries, part, objects, poses):
    keyframes = os.path.join(part, "keyframes.csv")
    truth = keyframes if os.path.exists(keyframes) else os.path.join(part, "truth.csv")
    command = [os.path.join(binaries, "sightline"), "evaluate", "--json", truth, poses]
    for name in objects:
        command += ["--object", os.path.join(part, name)]
    text = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout
    return json.loads(text)["objects"]


def first_pose(part, poses, name):
    begin = min(int(row["capture_ns"]) for row in read_csv(os.path.join(part, "frames.csv")))
    found = [int(row["t_ns"]) for row in read_csv(poses) if row["object"] == name and row["state"] in ("tracking", "degraded")]
    return f"@{(min(found) - begin) * 1e-9:.2f}" if found else "never"


def judge(options, recording):
    totals = {}
    rows = read_csv(os.path.join(recording, "frames.csv"))
    times = [int(row["capture_ns"]) for row in rows]
    seconds = (max(times) - min(times)) * 1e-9
    for i in range(options.parts):
        with tempfile.TemporaryDirectory(prefix="sightline_offsets.") as folder:
            part, poses = os.path.join(folder, "part"), os.path.join(folder, "poses.csv")
            objects = cut(recording, part, 0.75 * seconds * i / max(1, options.parts - 1))
            subprocess.run([os.path.join(options.bin, "sightline"), "replay", part, "--modalities", "region,edge,texture",
                            *shlex.split(options.replay), "--poses", poses], check=True, capture_output=True, timeout=600)
            for e in evaluate(options.bin, part, objects, poses):
                best = e["up_to_symmetry"] if e["judged"] and "up_to_symmetry" in e else e
                total = totals.setdefault(e["object"], {"within": 0, "judged": 0, "wrong": 0, "parts": []})
                total["within"] += best["within"]
                total["judged"] += e["judged"]
                total["wrong"] += e["wrong_claims"]
                total["parts"].append(f"{best['within']}/{e['judged']} w{e['wrong_claims']} "
                                      f"{best['errors']['median_mm']:.1f}mm {first_pose(part, poses, e['object'])}")
    for name, total in totals.items():
        print(f"{os.path.basename(os.path.normpath(recording)):10} {name:9} within "
              f"{100 * total['within'] / max(1, total['judged']):5.1f} % of {total['judged']:5}, wrong {total['wrong']:4} | "
              + "  ".join(total["parts"]), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--bin", default="build/release/bin")
    parser.add_argument("--parts", type=int, default=6)
    parser.add_argument("--replay", default="", help="further options of sightline replay")
    options = parser.parse_args()
    for recording in options.recordings:
        if not os.path.isfile(os.path.join(recording, "recording.toml")):
            print(f"offsets.py: {recording}: not a recording folder", file=sys.stderr)
            return 2
        judge(options, recording)
    return 0


if __name__ == "__main__":
    sys.exit(main())
