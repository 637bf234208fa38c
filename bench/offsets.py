#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is found from nothing, wherever a recording begins:

    bench/offsets.py [--bin build/release/bin] [--parts N] [--look LOOK] [--told] [--replay=--instant-search] RECORDING ...

Cuts each recording at N places (0 to 3/4 of its length; the videos are encoded again, almost without loss, or to look
as from another camera: gray, soft and noisy, of another white balance, in a dim room), replays each part by itself with
`sightline replay --modalities region,edge,texture` and compares it with truth.csv or keyframes.csv. Prints per object the share
of judged rows within 5 cm + 5 deg up to declared and shape's symmetries, wrong claims, and for each part rows within,
wrong claims, median error and time of the first pose. --told: each object is told (`--start`) at its first pose in
truth.csv, so that what is found is left out. Needs ffmpeg. Exits 2 for bad input."""
import pathlib
import shutil
import subprocess
import sys
import tempfile

from recording_tools import (add_replay_option, evaluate, load_recording, object_name, read_csv, recording_parser,
                             replay, up_to_symmetry, write_csv)

DIM = ",lutyuv=y='16+0.35*(val-16)':u='128+0.35*(val-128)':v='128+0.35*(val-128)'"
LOOKS = {"as-is": "",
         "gray": ",hue=s=0",
         "soft": ",gblur=sigma=1.0,noise=alls=10:allf=t",
         "warm": ",eq=gamma=1.25:saturation=0.65:contrast=0.9,colorbalance=rm=0.12:bm=-0.12",
         "dim": DIM,
         "dim-noise-4": DIM + ",noise=alls=8:allf=t",
         "cold": ",colorbalance=rm=-0.15:bm=0.15",
         "contrast": ",eq=contrast=0.5",
         "noise-4": ",noise=alls=8:allf=t",  # standard deviations of all planes, of 255
         "noise-8": ",noise=alls=15:allf=t",
         "noise-14": ",noise=alls=25:allf=t",
         "defocus": ",gblur=sigma=2.5",
         "flicker": ",lutyuv=y='16+(val-16)*0.94',eq=brightness='0.05*sin(1.9*n)':eval=frame",
         "shadow": ",split[a][b];[b]crop=iw/2:ih:iw/2:0,lutyuv=y='16+0.35*(val-16)':u='128+0.35*(val-128)'"
                   ":v='128+0.35*(val-128)'[c];[a][c]overlay=W/2:0",
         "exposure": ",eq=contrast='1+0.2*sin(5*t)':brightness='0.06*sin(5*t)':eval=frame"}
POSE = ("tx", "ty", "tz", "qw", "qx", "qy", "qz")
TRUTH_MARGIN_NS = 10_000_000  # for a camera's offset


def cut_video(source, target, frames, look):
    """A copy without the first frames, with that look."""
    chain = f"trim=start_frame={frames},setpts=PTS-STARTPTS{LOOKS[look]}"
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", source, "-vf", chain, "-an", "-c:v", "libx264", "-crf", "4",
                    "-preset", "veryfast", "-g", "15", "-pix_fmt", "yuv420p", "-color_range", "tv", target],
                   check=True, timeout=300)


def cut_rows(path, column, first_ns):
    """Drops the rows of a file from before a time."""
    rows = read_csv(path) if path.exists() else []
    if rows:
        write_csv(path, rows[0].keys(), [row for row in rows if int(row[column]) >= first_ns])


def cut(recording, folder, start_s, look="as-is"):
    """The rest of a recording from `start_s` after its first frame on, with one of LOOKS."""
    shutil.copytree(recording.folder, folder, ignore=shutil.ignore_patterns("*.mkv"))
    first_ns = recording.start_ns + round(start_s * 1e9)
    cut_rows(folder / "frames.csv", "capture_ns", first_ns)
    for truth in ("truth.csv", "keyframes.csv"):
        cut_rows(folder / truth, "t_ns", first_ns - TRUTH_MARGIN_NS)
    for camera, video in recording.videos.items():
        gone = sum(time < first_ns for time in recording.capture_times(camera).values())
        cut_video(recording.folder / video, folder / video, gone, look)
    return load_recording(folder)


def starts(recording, parts):
    """Where the parts of a recording begin [s]."""
    return [0.75 * recording.seconds * i / max(1, parts - 1) for i in range(parts)]


def told(part):
    """Options of sightline replay that tell each object where it is first."""
    names = [object_name(path) for path in part.objects]
    first = {}
    for row in read_csv(part.folder / "truth.csv"):
        first.setdefault(row.get("object", names[0]), row)
    return [option for name in names if name in first
            for option in ("--start", f"{name}=" + ",".join(first[name][k] for k in POSE))]


def first_pose(part, rows, name):
    found = [int(row["t_ns"]) for row in rows if row["object"] == name and row["state"] in ("tracking", "degraded")]
    return f"@{(min(found) - part.start_ns) * 1e-9:.2f}" if found else "never"


def judge_part(options, recording, start_s, totals):
    """Replays what follows after `start_s` and adds to the totals of its objects."""
    with tempfile.TemporaryDirectory(prefix="sightline_offsets.") as folder:
        part = cut(recording, pathlib.Path(folder, "part"), start_s, options.look)
        poses = pathlib.Path(folder, "poses.csv")
        rows = replay(options, part, poses, more=told(part) if options.told else ())
        for e in evaluate(options.bin, part, poses):
            best = up_to_symmetry(e)
            total = totals.setdefault(e["object"], {"within": 0, "judged": 0, "wrong": 0, "parts": []})
            total["within"] += best["within"]
            total["judged"] += e["judged"]
            total["wrong"] += e["wrong_claims"]
            total["parts"].append(f"{best['within']}/{e['judged']} w{e['wrong_claims']} "
                                  f"{best['errors']['median_mm']:.1f}mm {first_pose(part, rows, e['object'])}")


def judge(options, recording):
    totals = {}
    for start_s in starts(recording, options.parts):
        judge_part(options, recording, start_s, totals)
    for name, total in totals.items():
        print(f"{recording.name:10} {name:9} within {100 * total['within'] / max(1, total['judged']):5.1f} % of "
              f"{total['judged']:5}, wrong {total['wrong']:4} | " + "  ".join(total["parts"]), flush=True)


def main():
    parser = recording_parser(__doc__)
    parser.add_argument("--parts", type=int, default=6)
    parser.add_argument("--look", choices=LOOKS, default="as-is")
    parser.add_argument("--told", action="store_true", help="where each object is first")
    add_replay_option(parser)
    options = parser.parse_args()
    for recording in options.recordings if options.told else ():
        if not (recording.folder / "truth.csv").exists():
            parser.error(f"{recording.folder}: has no truth.csv, which says where its objects are")
    for recording in options.recordings:
        judge(options, recording)
    return 0


if __name__ == "__main__":
    sys.exit(main())
