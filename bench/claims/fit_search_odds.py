#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Fits the constants of src/observe/detect/judge/search_odds.cpp: how sure one search is of its best pose.

    bench/claims/fit_search_odds.py [--bin build/release/bin] [--sets N] [--others N] [--jobs N] [--looks FILE] RECORDING ...

Looks at N sets of frames of each recording for each of its objects, everywhere and again where something moves, and for
--others objects of the other recordings, which are not there (`sightline detect --explain`). The best pose of a look is
right (or a turn of the right one that the shape hardly tells) or not; logistic regression on what the search says of it, looks that less than two cameras show left out.
Prints the constants, and for some odds how many right and wrong bests have more: of each recording by constants that
were fitted without it. --looks: written there, or read from it if it exists. Needs numpy.
"""
import concurrent.futures
import json
import os
import pathlib
import random
import sys

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from recording_tools import add_jobs_option, recording_parser, run_sightline  # noqa: E402

NAMES = ("kConstant", "kEdges", "kColors", "kScore", "kScoreAbove", "kRival", "kRivalAbove", "kSecond", "kSecondAbove")
SCORE_BEND, RIVAL_BEND, SECOND_BEND = 0.6, 0.75, 0.65
MOST_RIVAL = 1.3
RIDGE = 0.01


def searches(options):
    """What is looked for where: recording, options of `sightline detect`, whether it is there."""
    pool = random.Random(1)
    objects = [(recording.name, path) for recording in options.recordings for path in recording.objects]
    for recording in options.recordings:
        sets = max(len(recording.capture_times(camera)) for camera in recording.cameras)
        every = ["--every", str(max(1, sets // options.sets)), "--limit", str(options.sets), "--explain", "--json"]
        others = [path for name, path in objects if name != recording.name]
        for where in ([], ["--moving"]):
            yield recording, every + where, True
            for other in pool.sample(others, min(options.others, len(others))):
                yield recording, every + where + ["--other-object", str(other)], False


def look(options, search):
    recording, arguments, there = search
    rows = []
    for found in json.loads(run_sightline(options.bin, "detect", recording.folder, *arguments))["sets"]:
        explained = found.get("explanation", {})
        if explained.get("log_odds") and (not there or "best_is_right" in explained):
            rows.append({"recording": recording.name, "object": found["object"], "evidence": explained["evidence"],
                         "right": there and (explained["best_is_right"] or explained["best_is_near_turn"])})
    return rows


def looks(options):
    if options.looks and os.path.exists(options.looks):
        return json.loads(pathlib.Path(options.looks).read_text(encoding="utf-8"))
    rows = []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as jobs:
        for found in jobs.map(lambda search: look(options, search), searches(options)):
            rows += found
    if options.looks:
        pathlib.Path(options.looks).write_text(json.dumps(rows), encoding="utf-8")
    return rows


def terms(evidence):
    """Whose weighted sum is the log odds."""
    score, second = evidence["score"], evidence["second_share"]
    rival = min(evidence["rival_share"], MOST_RIVAL)
    return [1, evidence["edge_share"], max(0, evidence["colors"]), score, max(0, score - SCORE_BEND), rival,
            max(0, rival - RIVAL_BEND), second, max(0, second - SECOND_BEND)]


def fit(matrix, right):
    """Newton's method on the log likelihood."""
    weights = numpy.zeros(matrix.shape[1])
    ridge = RIDGE * numpy.diag([0] + [1] * (len(weights) - 1))
    for _ in range(50):
        odds = 1 / (1 + numpy.exp(-matrix @ weights))
        gradient = matrix.T @ (right - odds) - ridge @ weights
        step = numpy.linalg.solve((matrix.T * (odds * (1 - odds))) @ matrix + ridge, gradient)
        weights += step
        if numpy.abs(step).max() < 1e-9:
            break
    return weights


def left_out(matrix, right, recordings):
    """Log odds of each look by what the other recordings say."""
    odds = numpy.zeros(len(right))
    for name in set(recordings):
        own = recordings == name
        odds[own] = matrix[own] @ fit(matrix[~own], right[~own])
    return odds


def main():
    parser = recording_parser(__doc__)
    parser.add_argument("--sets", type=int, default=12, help="of frames, of each search of a recording")
    parser.add_argument("--others", type=int, default=3, help="objects that are not there, for each recording")
    parser.add_argument("--looks", help="JSON, what was seen")
    add_jobs_option(parser)
    options = parser.parse_args()
    try:
        rows = looks(options)
    except (OSError, RuntimeError) as error:
        sys.exit(f"fit_search_odds: {error}")
    matrix = numpy.array([terms(row["evidence"]) for row in rows])
    right = numpy.array([float(row["right"]) for row in rows])
    recordings = numpy.array([row["recording"] for row in rows])
    print(f"{len(rows)} looks, {int(right.sum())} bests are right")
    for name, value in zip(NAMES, fit(matrix, right)):
        print(f"{name} = {value:.2f}")
    odds = left_out(matrix, right, recordings)
    print("recording left out:")
    for limit in (0, 1, 2, 3, 3.5, 4, 5):
        more = odds > limit
        print(f"log odds over {limit}: {int(right[more].sum())} right, {int((1 - right[more]).sum())} wrong; "
              f"expected wrong {(1 / (1 + numpy.exp(odds[more]))).sum():.1f}")


if __name__ == "__main__":
    main()
