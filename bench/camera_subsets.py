#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is found from nothing by some of a recording's cameras:

    bench/camera_subsets.py [--bin build/release/bin] [--cameras N] [--jobs N] [--replay=--instant-search] RECORDING ...

Replays every recording with each choice of N of its cameras (one, unless told) by `sightline replay --modalities
region,edge,texture` and compares it with truth.csv or keyframes.csv, at times at which one of these cameras has a frame
that shows a fifth of the object's area or more (by visibility.csv, where there is one). Prints per object the share of
judged rows within 5 cm + 5 deg up to declared and shape's symmetries, rows `tracking`, wrong claims, median error and
time of the first pose; then the mean share and the sum of wrong claims. Exits 2 for bad input."""
import concurrent.futures
import dataclasses
import itertools
import pathlib
import sys
import tempfile

from recording_tools import (add_jobs_option, add_replay_option, evaluate, object_name, read_csv, recording_parser,
                             replay, up_to_symmetry, write_csv)

LEAST_VISIBLE = 0.2


@dataclasses.dataclass(frozen=True)
class Part:
    """A recording seen by some of its cameras."""
    folder: pathlib.Path
    objects: list
    truth: pathlib.Path


def write_config(recording, cameras, folder):
    lines = [f'calibration = "{recording.folder}/calibration.toml"']
    lines += [f'[[object]]\nfile = "{path}"' for path in recording.objects]
    lines += [f'[[camera]]\nname = "{name}"\nsource = "replay:{recording.folder}"' for name in cameras]
    config = pathlib.Path(folder, "config.toml")
    config.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return config


def seen_times(recording, cameras):
    """By object: capture times at which one of the cameras shows it; None where nothing is known of it."""
    path = recording.folder / "visibility.csv"
    if not path.exists():
        return None
    times = {camera: recording.capture_times(camera) for camera in cameras}
    seen = {}
    for row in read_csv(path):
        if row["camera"] in times and float(row["visible_fraction"]) >= LEAST_VISIBLE:
            seen.setdefault(row["object"], set()).add(times[row["camera"]].get(int(row["index"])))
    return seen


def write_truth(recording, cameras, folder):
    """The truth at those times."""
    rows = read_csv(recording.truth)
    seen = seen_times(recording, cameras)
    if seen is not None:
        name = object_name(recording.objects[0])
        rows = [row for row in rows if int(row["t_ns"]) in seen.get(row.get("object", name), ())]
    path = pathlib.Path(folder, recording.truth.name)
    if rows:
        write_csv(path, rows[0].keys(), rows)
    return path if rows else None


def judge(options, recording, cameras):
    """(line, share within [%] or None, wrong claims) of every object."""
    with tempfile.TemporaryDirectory(prefix="sightline_cameras.") as folder:
        truth = write_truth(recording, cameras, folder)
        if truth is None:
            return [(f"{recording.name:10} {'+'.join(cameras):16} never visible", None, 0)]
        poses = pathlib.Path(folder, "poses.csv")
        rows = replay(options, recording, poses, write_config(recording, cameras, folder))
        lines = []
        for e in evaluate(options.bin, Part(recording.folder, recording.objects, truth), poses):
            best, name = up_to_symmetry(e), e["object"]
            own = [row for row in rows if row["object"] == name]
            found = [int(row["t_ns"]) for row in own if row["state"] in ("tracking", "degraded")]
            first = f"@{(min(found) - recording.start_ns) * 1e-9:.2f}" if found else "never"
            tracking = sum(row["state"] == "tracking" for row in own)
            share = 100 * best["within"] / max(1, e["judged"])
            line = (f"{recording.name:10} {'+'.join(cameras):16} {name:9} within {share:5.1f} % of {e['judged']:4}, "
                    f"tracking {tracking:4} of {len(own):4}, wrong {e['wrong_claims']:4}, "
                    f"{best['errors']['median_mm']:6.1f} mm {first}")
            lines.append((line, share, e["wrong_claims"]))
        return lines


def main():
    parser = recording_parser(__doc__)
    parser.add_argument("--cameras", type=int, default=1, help="so many of them")
    add_replay_option(parser)
    add_jobs_option(parser)
    options = parser.parse_args()
    tasks = [(recording, cameras) for recording in options.recordings
             for cameras in itertools.combinations(recording.cameras, options.cameras)]
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        shares, wrong = [], 0
        for lines in pool.map(lambda task: judge(options, *task), tasks):
            print("\n".join(line for line, _, _ in lines), flush=True)
            shares += [share for _, share, _ in lines if share is not None]
            wrong += sum(claims for _, _, claims in lines)
    print(f"mean {sum(shares) / max(1, len(shares)):.1f} %, {wrong} wrong claims")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        print(f"camera_subsets: {error}", file=sys.stderr)
        sys.exit(2)
