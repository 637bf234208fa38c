#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What checks of followed poses say where those are right, off and wrong.

    bench/live/checks.py [--parts N] [--replay=OPTIONS] [--bin DIR] RECORDING ...

Replays recordings with truth from nothing, reads what each check of a pose has found from the log (`sightline -v`), and
prints for each object, and for all, the checks of poses that are right (within 5 cm + 5 deg), off (5 cm + 20 deg) and
wrong: in how many the pose as it is ranks 0.45 and more, in how many one that is fitted from close by ranks 1.8 times
as much, in how many the colors of the mesh do not show, how many searched about its place, and of those how many came
to the pose itself, how many so that no other there had 0.85 of its rank, how many to another one of 1.15 times its
rank, and how many say that the track has lost the object (PoseProof::has_lost_it). --parts: the recordings are cut at N
places, as by bench/offsets.py. Symmetry is not considered: of what looks the same a wrong pose may be right. Longer recordings
(bench/live/to_and_fro.py) say more."""
import math
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from offsets import cut, starts  # noqa: E402
from recording_tools import add_replay_option, object_name, read_csv, recording_parser  # noqa: E402

REPLAY_S = 1800
CHECK = re.compile(r"check: (\d+) at (\d+): rank ([\d.]+), nearby ([\d.]+), colors (show|do not)")
SEARCH = re.compile(r"check: (\d+) at (\d+): about its place (the same|another) of rank ([\d.]+), "
                    r"the next has ([\d.]+)")
FOUND = re.compile(r"search: (\d+) .*: found")
AS_FOUND = re.compile(r"check: (\d+) as found: rank ([\d.]+)")
STANDS_OUT, NEARBY, OUTDONE, INDISTINCT = 0.45, 1.8, 1.15, 0.85
LOST_TO, FITTED_OF_LOST, FALLEN, OUTRANKS = 2.0, 0.92, 0.4, 1.5


def checks_of(log):
    """(object, time) to [rank, nearby, whether colors show, what a search about the place has found: None or
    (same, rank, share of it that the next pose there has), the best rank since it was found]."""
    out, best = {}, {}
    for line in log.splitlines():
        if m := FOUND.search(line):
            best[int(m[1])] = 0.0
        elif m := AS_FOUND.search(line):
            best[int(m[1])] = float(m[2])
        elif m := CHECK.search(line):
            best[int(m[1])] = max(best.get(int(m[1]), 0.0), float(m[3]))
            out[int(m[1]), int(m[2])] = [float(m[3]), float(m[4]), m[5] == "show", None, best[int(m[1])]]
        elif m := SEARCH.search(line):
            if (int(m[1]), int(m[2])) in out:
                out[int(m[1]), int(m[2])][3] = (m[3] == "the same", float(m[4]), float(m[5]))
    return out


def has_lost_it(said):
    rank, nearby, _, (same, found, _), best = said
    if rank < FALLEN * best and not same and found >= OUTRANKS * rank:
        return True
    return found >= max(STANDS_OUT, LOST_TO * rank) and nearby <= FITTED_OF_LOST * found


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


def parts_of(options, recording):
    """The recording, or what follows after each of so many places in it."""
    if not options.parts:
        yield recording
    for start_s in starts(recording, options.parts):
        with tempfile.TemporaryDirectory() as folder:
            yield cut(recording, pathlib.Path(folder, "part"), start_s)


def line(label, kind, said):
    searched = [(s[1], s[3]) for s in said if s[3]]
    lost = sum(has_lost_it(s) for s in said if s[3])
    same = [about[2] for _, about in searched if about[0]]
    outdone = sum(not about[0] and about[1] > OUTDONE * nearby for nearby, about in searched)
    print(f"{label:20} {kind:6} checks {len(said):4}  stand out {sum(s[0] >= STANDS_OUT for s in said):4}  "
          f"nearby ranks more {sum(s[1] > NEARBY * s[0] > 0 for s in said):3}  "
          f"no colors {sum(not s[2] for s in said):3}  "
          f"searched {len(searched):3}: the same {len(same):3} (no other has {INDISTINCT} of it: "
          f"{sum(share < INDISTINCT for share in same):3}), another of more {outdone:3}, has lost it {lost:3}")


def main():
    parser = recording_parser(__doc__)
    parser.add_argument("--parts", type=int, default=0)
    add_replay_option(parser)
    options = parser.parse_args()
    for recording in options.recordings:
        if not (recording.folder / "truth.csv").exists():
            parser.error(f"{recording.folder}: has no truth.csv, which is what poses are compared with")
    total = {}
    for recording in options.recordings:
        by_object = {}
        for part in parts_of(options, recording):
            for key, said in counted(options, part).items():
                by_object.setdefault(key, []).extend(said)
        for (name, kind), said in sorted(by_object.items()):
            line(f"{recording.name} {name}", kind, said)
            total.setdefault(kind, []).extend(said)
    for kind, said in total.items():
        line("all", kind, said)


if __name__ == "__main__":
    main()
