#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the limits of a search by contours are worth on a recording that they were not chosen on:

    bench/leave_one_recording_out.py [--bin build/release/bin] [--every N] [--foreign N] [--jobs N] RECORDING ...

Runs `sightline detect --explain` on every recording, with its own objects and with N of the others' (whatever is best
there is wrong). For each recording the least score of a believed pose and the most that a rival at another place may
have of it are chosen on all the others: for the most right poses less five times the wrong ones, in the middle of the
limits that reach that. Prints what those believe of the recording, beside what the limits chosen on all recordings
believe, and the limits in force (0.6, 0.75: src/observe/detect/detect_constants.hpp). Judged is one search by contours
alone, without a second one and without edges; colors count as there: what has a print must show it, and other colors
ask for four fifths of the rival's limit. Exits 2 for bad input."""
import concurrent.futures
import json
import statistics
import sys

from recording_tools import add_jobs_option, mesh_path, object_name, recording_parser, run_sightline

IN_FORCE = (0.6, 0.75)
COST_OF_WRONG = 5
PRINT, COLORS, SHARE_WITHOUT_COLORS = 0.4, 0.15, 0.8
SCORES = [0.40 + 0.01 * i for i in range(50)]
RIVALS = [0.40 + 0.02 * i for i in range(30)]


def has_print(object_file):
    material = mesh_path(object_file).with_suffix(".mtl")
    return material.exists() and "map_Kd" in material.read_text(encoding="utf-8", errors="replace")


def best_poses(options, recording, other):
    """(score, share of the rival, right) of the best pose of each set."""
    printed = {object_name(path): has_print(path) for path in ([other] if other else recording.objects)}
    command = ["detect", recording.folder, "--explain", "--json", "--every", str(options.every)]
    if other:
        command += ["--other-object", other]
    out = []
    for one in json.loads(run_sightline(options.bin, *command))["sets"]:
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


def searches(recordings, foreign):
    """(index, recording, object file of another recording or None for its own) of every search."""
    paths = [path for recording in recordings for path in recording.objects]
    for i, recording in enumerate(recordings):
        own = [object_name(path) for path in recording.objects]
        others = [path for path in paths[i:] + paths[:i] if object_name(path) not in own]
        yield from ((i, recording, other) for other in [None] + others[:foreign])


def collect_samples(options):
    """The best poses of every recording."""
    jobs = list(searches(options.recordings, options.foreign))
    samples = [[] for _ in options.recordings]
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        done = pool.map(lambda job: best_poses(options, job[1], job[2]), jobs)
        for (i, _, _), found in zip(jobs, done):
            samples[i] += found
    return samples


def count_right(samples):
    return sum(right for _, _, right in samples)


def believed(samples, limits):
    """How many right and how many wrong poses these limits let through."""
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


def print_row(name, samples, limits, judged):
    print(f"{name:12} {len(samples):5} {count_right(samples):13} | {limits:20} {judged[0]:6} {judged[1]:6} | "
          f"{judged[2]:13} {judged[3]:6} | {judged[4]:15} {judged[5]:6}")


def main():
    parser = recording_parser(__doc__)
    parser.add_argument("--every", type=int, default=12)
    parser.add_argument("--foreign", type=int, default=2, help="other objects that each recording is searched for")
    add_jobs_option(parser)
    options = parser.parse_args()
    samples = collect_samples(options)
    everything = [sample for some in samples for sample in some]
    on_all = choose(everything)
    print(f"chosen on all: score {on_all[0]:.2f}, rival {on_all[1]:.2f}")
    print(f"{'recording':12} {'sets':>5} {'best is right':>13} | {'limits of the others':>20} {'right':>6} "
          f"{'wrong':>6} | {'of all: right':>13} {'wrong':>6} | {'in force: right':>15} {'wrong':>6}")
    sums = [0] * 6
    for i, recording in enumerate(options.recordings):
        limits = choose([sample for k, some in enumerate(samples) if k != i for sample in some])
        judged = believed(samples[i], limits) + believed(samples[i], on_all) + believed(samples[i], IN_FORCE)
        sums = [a + b for a, b in zip(sums, judged)]
        print_row(recording.name, samples[i], f"{limits[0]:13.2f}, {limits[1]:5.2f}", judged)
    print_row("all", everything, "", sums)
    return 0


if __name__ == "__main__":
    sys.exit(main())
