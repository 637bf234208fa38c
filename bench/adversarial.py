#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is claimed with a mesh that is not the object's:

    bench/adversarial.py [--bin build/release/bin] [--replay "--search-cost 0.5"] [--started] [--jobs N] RECORDING ...

Replays every recording by region, edge and texture with its own objects, their meshes (OBJ) scaled by 0.8 and 1.25
about their middle, mirrored, and cut to a quarter, and with the object of the next recording of the list. --started:
each starts at the true pose of the recording's (first) object. Prints for each the rows `tracking`, `degraded` and
`coasting`, and how far the surface that is claimed is from the true one (95 % of the points of both, in % of the
object's diagonal, 10 at most; 1.5 % is the distance of the points). What is not farther than 3 % is the object: most
things look the same in a mirror, turned over. Exits 1 if anything else was `tracking`, 2 for bad input."""
import argparse
import concurrent.futures
import pathlib
import re
import shlex
import shutil
import statistics
import sys
import tempfile

from mesh_distance import SurfaceDistance
from recording_tools import (add_jobs_option, add_replay_option, count_states, mesh_path, object_name, read_csv,
                             recording_parser, replay_with_object)

FACTORS = {"scaled 0.8": (0.8, 0.8, 0.8), "scaled 1.25": (1.25, 1.25, 1.25), "mirrored": (-1, 1, 1)}
CHANGES = [*FACTORS, "a quarter"]
SAME_SURFACE = 0.03  # of the diagonal
JUDGED_ROWS = 5


def vertices(lines):
    return [[float(word) for word in line.split()[1:4]] for line in lines if line.startswith("v ")]


def change_mesh(path, factors):
    """Changes a mesh's vertices (and normals) about their middle; mirrored faces keep their outside."""
    lines = path.read_text(encoding="utf-8").splitlines()
    points = vertices(lines)
    middle = [(min(p[i] for p in points) + max(p[i] for p in points)) / 2 for i in range(3)]
    mirrored = factors[0] * factors[1] * factors[2] < 0
    out = []
    for line in lines:
        words = line.split()
        if words[:1] == ["v"]:
            place = [middle[i] + factors[i] * (float(words[1 + i]) - middle[i]) for i in range(3)]
            line = " ".join(["v"] + [f"{x:.9g}" for x in place] + words[4:])
        elif words[:1] == ["vn"] and mirrored:
            line = " ".join(["vn"] + [f"{float(words[1 + i]) * (1 if factors[i] > 0 else -1):.9g}" for i in range(3)])
        elif words[:1] == ["f"] and mirrored:
            line = " ".join(["f"] + words[:0:-1])
        out.append(line)
    path.write_text("\n".join(out) + "\n", encoding="utf-8")


def cut_to_quarter(path):
    """Keeps the faces whose middles are in one quarter, cut across the two longest sides."""
    lines = path.read_text(encoding="utf-8").splitlines()
    points = vertices(lines)
    low, high = [[pick(p[i] for p in points) for i in range(3)] for pick in (min, max)]
    sides = sorted(range(3), key=lambda i: low[i] - high[i])[:2]
    out = []
    for line in lines:
        words = line.split()
        if words[:1] == ["f"]:
            indices = [int(word.split("/")[0]) for word in words[1:]]
            corners = [points[i - 1 if i > 0 else i] for i in indices]
            middle = [sum(c[i] for c in corners) / len(corners) for i in range(3)]
            if any(2 * middle[i] > low[i] + high[i] for i in sides):
                continue
        out.append(line)
    path.write_text("\n".join(out) + "\n", encoding="utf-8")


def write_changed_object(object_file, change, folder):
    """A copy of the object with its mesh changed and without features, which are of the true one."""
    shutil.copytree(object_file.parent, folder, copy_function=shutil.copyfile)
    changed = folder / object_file.name
    if change in FACTORS:
        change_mesh(mesh_path(changed), FACTORS[change])
    elif change == "a quarter":
        cut_to_quarter(mesh_path(changed))
    text = re.sub(r"(?m)^features\s*=.*$", "", changed.read_text(encoding="utf-8"))
    changed.write_text(text, encoding="utf-8")
    return changed


def pose_of(row):
    return tuple(float(row[k]) for k in ("tx", "ty", "tz", "qw", "qx", "qy", "qz"))


def read_truth(recording, name):
    """Poses by time; nothing without truth."""
    path = recording.folder / "truth.csv"
    rows = read_csv(path) if path.exists() else []
    return {row["t_ns"]: pose_of(row) for row in rows if row["object"] == name}


class Job:
    """A recording in which something stands in for its object."""

    def __init__(self, recording, object_file, change, mesh_of=None):
        self.recording, self.object_file, self.change = recording, object_file, change
        self.mesh_of = mesh_of or object_file

    def run(self, options):
        """Rows of the pose log, and the share of the diagonal that the claimed surface is off."""
        truth = read_truth(self.recording, object_name(self.object_file))
        with tempfile.TemporaryDirectory(prefix="sightline_adversarial.") as folder:
            changed = write_changed_object(self.mesh_of, self.change, pathlib.Path(folder, "objects"))
            rows = self.replay(options, changed, truth)
            return rows, self.surface_off(rows, changed, truth)

    def replay(self, options, changed, truth):
        if not options.started or not truth:
            return replay_with_object(options, self.recording, changed)
        start = ",".join(str(x) for x in next(iter(truth.values())))
        started = argparse.Namespace(**vars(options))
        started.replay += " --start " + shlex.quote(f"{object_name(changed)}={start}")
        return replay_with_object(started, self.recording, changed)

    def surface_off(self, rows, changed, truth):
        """Median over some of the rows `tracking`; None without any."""
        claimed = [row for row in rows if row["state"] == "tracking" and row["t_ns"] in truth]
        if not claimed:
            return None
        surfaces = SurfaceDistance(mesh_path(self.object_file), mesh_path(changed))
        return statistics.median(surfaces.share(truth[row["t_ns"]], pose_of(row))
                                 for row in claimed[::max(1, len(claimed) // JUDGED_ROWS)])

    def text(self, rows, off):
        counts = count_states(rows)
        line = (f"{self.recording.name:10} {object_name(self.object_file):9} {self.change:18} of {len(rows):4} rows: "
                f"tracking {counts['tracking']:4}, degraded {counts['degraded']:4}, coasting {counts['coasting']:4}")
        if off is not None:
            line += f", surface {100 * off:.1f} % off" + (" (the object)" if off <= SAME_SURFACE else "")
        return line


def make_jobs(recordings):
    jobs = [Job(recording, path, change) for recording in recordings for path in recording.objects
            for change in CHANGES]
    for recording, other in zip(recordings, recordings[1:] + recordings[:1]):
        for path in other.objects[:1]:
            own = recording.objects[0]
            if object_name(path) not in map(object_name, recording.objects):
                jobs.append(Job(recording, own, "is " + object_name(path), path))
    return jobs


def main():
    parser = recording_parser(__doc__)
    parser.add_argument("--started", action="store_true", help="at the true pose of the object")
    add_replay_option(parser)
    add_jobs_option(parser)
    options = parser.parse_args()
    jobs = make_jobs(options.recordings)
    claimed = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for job, (rows, off) in zip(jobs, pool.map(lambda job: job.run(options), jobs)):
            if off is None or off > SAME_SURFACE:
                claimed += count_states(rows)["tracking"]
            print(job.text(rows, off), flush=True)
    print(f"{claimed} rows tracking that are not the object")
    return 1 if claimed else 0


if __name__ == "__main__":
    sys.exit(main())
