#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What checks of followed poses say where those are right, off and wrong.

    bench/live/checks.py [--replay=OPTIONS] [--bin DIR] RECORDING ...

Replays recordings with truth from nothing, reads what each check of a pose has found from the log (`sightline -v`), and
prints for each object, and for all, the checks of poses that are right (within 5 cm + 5 deg), off (5 cm + 20 deg) and
wrong: in how many the pose as it is ranks 0.45 and more, in how many one that is fitted from close by ranks 1.8 times
as much, in how many the colors of the mesh do not show, how many searched about its place, and of those how many came
to the pose itself, how many so that no other there had 0.85 of its rank, and how many to another one of 1.15 times its
rank. Symmetry is not considered: of what looks the same a wrong pose may be right. Longer recordings
(bench/live/to_and_fro.py) say more."""
import math
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from recording_tools import add_replay_option, object_name, read_csv, recording_parser  # noqa: E402

REPLAY_S = 1800
CHECK = re.compile(r"check: (\d+) at (\d+): rank ([\d.]+), nearby ([\d.]+), colors (show|do not)")
SEARCH = re.compile(r"check: (\d+) at (\d+): about its place (the same|another) of rank ([\d.]+), "
                    r"the next has ([\d.]+)")
STANDS_OUT, NEARBY, OUTDONE, INDISTINCT = 0.45, 1.8, 1.15, 0.85


def checks_of(log):
    """(object, time) to [rank, nearby, whether colors show, what a search about the place has found: None or
    (same, rank, share of it that the next pose there has)]."""
    out = {}
    for line in log.splitlines():
        if m := CHECK.search(line):
            out[int(m[1]), int(m[2])] = [float(m[3]), float(m[4]), m[5] == "show", None]
        elif m := SEARCH.search(line):
            if (int(m[1]), int(m[2])) in out:
                out[int(m[1]), int(m[2])][3] = (m[3] == "the same", float(m[4]), float(m[5]))
    return out


def pose_of(row):
    return [float(row[k]) for k in ("tx", "ty", "tz")], [float(row[k]) for k in ("qw", "qx", "qy", "qz")]


def judged(pose, truth):
    """right, off or wrong."""
    distance = math.dist(pose[0], truth[0])
    turn = 2 * math.acos(min(1.0, abs(sum(a * b for a, b in zip(pose[1], truth[1])))))
    if distance >= 0.05 or turn >= math.radians(20):
        return "wrong"
    return "right" if turn < math.radians(5) else "off"


def replayed(options, recording):
    """The rows of the poses, and the log, which goes to standard error."""
    with tempfile.TemporaryDirectory() as folder:
        poses = pathlib.Path(folder, "poses.csv")
        command = [pathlib.Path(options.bin, "sightline"), "-v", "replay", recording.folder, "--poses", poses]
        done = subprocess.run([*command, *shlex.split(options.replay)], capture_output=True, encoding="utf-8",
                              errors="replace", timeout=REPLAY_S, check=False)
        if done.returncode:
            sys.exit(f"{recording.name}: sightline replay exits with {done.returncode}: {done.stderr.strip()[-300:]}")
        return read_csv(poses), done.stderr


def nearest(rows, time):
    """The row of about that time, within 50 ms, if it has a pose; else None."""
    best = min(rows, key=lambda row: abs(int(row["t_ns"]) - time), default=None)
    return best if best and abs(int(best["t_ns"]) - time) < 50_000_000 and best["tx"] else None


def counted(options, recording):
    """By object and judgement, lists of what checks have said."""
    rows, log = replayed(options, recording)
    truth = read_csv(recording.folder / "truth.csv")
    names = [object_name(path) for path in recording.objects]
    out = {}
    for (index, time), said in checks_of(log).items():
        name = names[index]
        pose = nearest([r for r in rows if r["object"] == name], time)
        there = pose and nearest([r for r in truth if r.get("object", name) == name], int(pose["t_ns"]))
        if there:
            out.setdefault((name, judged(pose_of(pose), pose_of(there))), []).append(said)
    return out


def line(label, kind, said):
    searched = [(nearby, about) for _, nearby, _, about in said if about]
    same = [about[2] for _, about in searched if about[0]]
    outdone = sum(not about[0] and about[1] > OUTDONE * nearby for nearby, about in searched)
    print(f"{label:20} {kind:6} checks {len(said):4}  stand out {sum(s[0] >= STANDS_OUT for s in said):4}  "
          f"nearby ranks more {sum(s[1] > NEARBY * s[0] > 0 for s in said):3}  "
          f"no colors {sum(not s[2] for s in said):3}  "
          f"searched {len(searched):3}: the same {len(same):3} (no other has {INDISTINCT} of it: "
          f"{sum(share < INDISTINCT for share in same):3}), another of more {outdone:3}")


def main():
    parser = recording_parser(__doc__)
    add_replay_option(parser)
    options = parser.parse_args()
    for recording in options.recordings:
        if not (recording.folder / "truth.csv").exists():
            parser.error(f"{recording.folder}: has no truth.csv, which is what poses are compared with")
    total = {}
    for recording in options.recordings:
        for (name, kind), said in sorted(counted(options, recording).items()):
            line(f"{recording.name} {name}", kind, said)
            total.setdefault(kind, []).extend(said)
    for kind, said in total.items():
        line("all", kind, said)


if __name__ == "__main__":
    main()
