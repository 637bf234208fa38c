#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the limits of a search by contours are worth on a recording that they were not chosen on:

    bench/leave_one_recording_out.py [--bin build/release/bin] [--every N] [--foreign N] RECORDING ...

Runs `sightline detect --explain` on every recording, with its own objects and with N of the others' (whatever is best there
is wrong). For each recording the least score of a believed pose and the most that a rival at another place may have of it
are chosen on all the others: for the most right poses less five times the wrong ones, in the middle of the limits that reach
that. Prints what those believe of the recording, beside what the limits chosen on all recordings believe, and the limits in
force (0.6, 0.75: src/observe/detect/detect_constants.hpp). Judged is one search by contours alone, without a second one and
without edges; colors count as there: what has a print must show it, and other colors ask for four fifths of the rival's
limit. Exits 2 for bad input."""
import argparse
import concurrent.futures
import json
import os
import statistics
import subprocess
import sys
import tomllib

from false_alarms import load, object_name

IN_FORCE = (0.6, 0.75)
COST_OF_WRONG = 5
PRINT, COLORS, SHARE_WITHOUT_COLORS = 0.4, 0.15, 0.8
SCORES = [0.40 + 0.01 * i for i in range(50)]
RIVALS = [0.40 + 0.02 * i for i in range(30)]


def has_print(path):
    folder = os.path.dirname(path)
    with open(path, "rb") as file:
        mesh = tomllib.load(file)["mesh"]
    material = os.path.splitext(os.path.join(folder, mesh))[0] + ".mtl"
    if not os.path.exists(material):
        return False
    with open(material, encoding="utf-8", errors="replace") as file:
        return "map_Kd" in file.read()


def looks(options, recording, other):
    """(score, share of the rival, right) of the best pose of each set."""
    printed = {object_name(path): has_print(path) for path in ([other] if other else recording["objects"])}
    command = [os.path.join(options.bin, "sightline"), "detect", recording["folder"], "--explain", "--json", "--every",
               str(options.every)]
    if other:
        command += ["--other-object", other]
    text = subprocess.run(command, check=True, capture_output=True, text=True, timeout=1800).stdout
    out = []
    for one in json.loads(text)["sets"]:
        e = one["explanation"]
        if "best" not in e or (not other and "best_is_right" not in e):
            continue
        score, colors = e["best_score"], e["at_best"]["colors"]
        rival = e["rival_score"] / score if score > 0 else 1
        if printed[one["object"]] and colors < PRINT:
            score = 0
        if colors != 0 and colors < COLORS:
            rival /= SHARE_WITHOUT_COLORS
        out.append((score, rival, not other and e["best_is_right"]))
    return out


def believed(samples, limits):
    taken = [right for score, rival, right in samples if score >= limits[0] and rival <= limits[1]]
    return sum(taken), len(taken) - sum(taken)


def choose(samples):
    """The middle of the best limits."""
    best, limits = None, []
    for score in SCORES:
        for rival in RIVALS:
            right, wrong = believed(samples, (score, rival))
            value = right - COST_OF_WRONG * wrong
            if best is None or value > best:
                best, limits = value, []
            if value == best:
                limits.append((score, rival))
    return statistics.median(a for a, _ in limits), statistics.median(b for _, b in limits)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--bin", default="build/release/bin")
    parser.add_argument("--every", type=int, default=12)
    parser.add_argument("--foreign", type=int, default=2, help="other objects that each recording is searched for")
    options = parser.parse_args()
    for recording in options.recordings:
        if not os.path.isfile(os.path.join(recording, "recording.toml")):
            print(f"leave_one_recording_out.py: {recording}: not a recording folder", file=sys.stderr)
            return 2
    recordings = [load(recording) for recording in options.recordings]
    paths = [path for recording in recordings for path in recording["objects"]]
    jobs = []
    for i, recording in enumerate(recordings):
        own = [object_name(path) for path in recording["objects"]]
        others = [path for path in paths[i:] + paths[:i] if object_name(path) not in own]
        jobs += [(i, recording, other) for other in [None] + others[:options.foreign]]
    samples = [[] for _ in recordings]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for (i, _, _), found in zip(jobs, pool.map(lambda job: looks(options, job[1], job[2]), jobs)):
            samples[i] += found
    everything = [sample for some in samples for sample in some]
    on_all = choose(everything)
    print(f"chosen on all: score {on_all[0]:.2f}, rival {on_all[1]:.2f}")
    print(f"{'recording':12} {'sets':>5} {'best is right':>13} | {'limits of the others':>20} {'right':>6} {'wrong':>6} | "
          f"{'of all: right':>13} {'wrong':>6} | {'in force: right':>15} {'wrong':>6}")
    sums = [0] * 6
    for i, recording in enumerate(recordings):
        limits = choose([sample for k, some in enumerate(samples) if k != i for sample in some])
        judged = believed(samples[i], limits) + believed(samples[i], on_all) + believed(samples[i], IN_FORCE)
        sums = [a + b for a, b in zip(sums, judged)]
        print(f"{os.path.basename(recording['folder']):12} {len(samples[i]):5} {sum(right for _, _, right in samples[i]):13} | "
              f"{limits[0]:13.2f}, {limits[1]:5.2f} {judged[0]:6} {judged[1]:6} | {judged[2]:13} {judged[3]:6} | "
              f"{judged[4]:15} {judged[5]:6}")
    print(f"{'all':12} {len(everything):5} {sum(right for _, _, right in everything):13} | {'':20} {sums[0]:6} {sums[1]:6} | "
          f"{sums[2]:13} {sums[3]:6} | {sums[4]:15} {sums[5]:6}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
