#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is claimed to be there and is not:

    bench/false_alarms.py [--bin build/release/bin] [--replay "--search-cost 0.5"] [--jobs N] [--alike N]
                          [--footage RECORDING] RECORDING ...

Replays every recording with the object of every other one, which is not in its images (objects of the same name are
left out), by region, edge and texture; with --footage only these, with the objects of all; with --alike as so many
objects that look the same. Prints the pairs in which anything was claimed, with rows `tracking`, `degraded` and
`coasting`, then totals: seconds of footage, rows, `tracking` rows, and stretches of `degraded` a minute. Exits 1 if
anything was `tracking`, 2 for bad input."""
import concurrent.futures
import sys

from recording_tools import (add_jobs_option, add_replay_option, count_states, object_name, recording_argument,
                             recording_parser, replay_with_object)


def foreign_pairs(footage, recordings):
    """(recording, name, object file) of every object of some recordings that is not in the footage."""
    files = {object_name(path): path for recording in recordings for path in recording.objects}
    for recording in footage:
        own = [object_name(path) for path in recording.objects]
        yield from ((recording, name, files[name]) for name in sorted(files) if name not in own)


def stretches(rows, state):
    """How often it is entered, by any object."""
    count, before = 0, {}
    for row in rows:
        count += row["state"] == state != before.get(row["object"])
        before[row["object"]] = row["state"]
    return count


def main():
    parser = recording_parser(__doc__)
    add_replay_option(parser)
    add_jobs_option(parser)
    parser.add_argument("--alike", type=int, choices=range(1, 9), default=1, metavar="N",
                        help="look for so many of the object at once (default 1)")
    parser.add_argument("--footage", action="append", type=recording_argument, metavar="RECORDING",
                        help="replay this one, with the objects of all others; may be repeated (default: all)")
    options = parser.parse_args()
    footage = options.footage or options.recordings
    pairs = list(foreign_pairs(footage, options.recordings))
    seconds = rows = tracking = degraded = entered = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        done = pool.map(lambda pair: replay_with_object(options, pair[0], pair[2], options.alike), pairs)
        for (recording, name, _), poses in zip(pairs, done):
            counts = count_states(poses)
            seconds += recording.seconds
            rows += len(poses)
            tracking += counts["tracking"]
            degraded += counts["degraded"]
            entered += stretches(poses, "degraded")
            if any(counts.values()):
                print(f"{recording.name:12} with {name:10} of {len(poses):4} rows: tracking {counts['tracking']:3}, "
                      f"degraded {counts['degraded']:3}, coasting {counts['coasting']:3}", flush=True)
    print(f"{len(pairs)} pairs, {seconds / 60:.1f} minutes, {rows} rows: {tracking} tracking, {degraded} degraded in "
          f"{entered} stretches ({entered / max(1e-9, seconds / 60):.1f} a minute)")
    return 1 if tracking else 0


if __name__ == "__main__":
    sys.exit(main())
