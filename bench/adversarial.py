#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is claimed with a mesh that is not the object's:

    bench/adversarial.py [--bin build/release/bin] [--replay "--search-cost 0.5"] [--jobs N] RECORDING ...

Replays every recording with its own objects, their meshes (OBJ) scaled by 0.8 and 1.25 about their middle and mirrored,
by region, edge and texture. Prints for each the rows `tracking`, `degraded` and `coasting`, and of the rows `tracking`
the median distance of the middle from the true one. Exits 1 if anything was `tracking`, 2 for bad input."""
import concurrent.futures
import pathlib
import re
import shutil
import statistics
import sys
import tempfile

from recording_tools import (add_jobs_option, add_replay_option, count_states, mesh_path, object_name, read_csv,
                             recording_parser, replay_with_object)

CHANGES = {"scaled 0.8": (0.8, 0.8, 0.8), "scaled 1.25": (1.25, 1.25, 1.25), "mirrored": (-1, 1, 1)}


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


def write_changed_object(object_file, factors, folder):
    """A copy of the object with its mesh changed and without features, which are of the true one."""
    shutil.copytree(object_file.parent, folder, copy_function=shutil.copyfile)
    changed = folder / object_file.name
    change_mesh(mesh_path(changed), factors)
    text = re.sub(r"(?m)^features\s*=.*$", "", changed.read_text(encoding="utf-8"))
    changed.write_text(text, encoding="utf-8")
    return changed


def replay_changed(options, recording, object_file, factors):
    """Rows of the pose log."""
    with tempfile.TemporaryDirectory(prefix="sightline_adversarial.") as folder:
        changed = write_changed_object(object_file, factors, pathlib.Path(folder, "objects"))
        return replay_with_object(options, recording, changed)


def distance_mm(rows, recording, name):
    """Median distance of `tracking` rows from the truth of their own time; nothing without such truth."""
    path = recording.folder / "truth.csv"
    if not path.exists():
        return ""
    truth = {row["t_ns"]: row for row in read_csv(path) if row["object"] == name}
    off = [sum((float(row[k]) - float(truth[row["t_ns"]][k])) ** 2 for k in ("tx", "ty", "tz")) ** 0.5
           for row in rows if row["state"] == "tracking" and row["t_ns"] in truth]
    return f", {1e3 * statistics.median(off):.0f} mm from the truth" if off else ""


def main():
    parser = recording_parser(__doc__)
    add_replay_option(parser)
    add_jobs_option(parser)
    options = parser.parse_args()
    jobs = [(recording, path, change) for recording in options.recordings for path in recording.objects
            for change in CHANGES]
    claimed = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        done = pool.map(lambda job: replay_changed(options, job[0], job[1], CHANGES[job[2]]), jobs)
        for (recording, path, change), rows in zip(jobs, done):
            counts = count_states(rows)
            claimed += counts["tracking"]
            print(f"{recording.name:10} {object_name(path):9} {change:12} of {len(rows):4} rows: "
                  f"tracking {counts['tracking']:4}, degraded {counts['degraded']:4}, "
                  f"coasting {counts['coasting']:4}" + distance_mm(rows, recording, object_name(path)), flush=True)
    print(f"{claimed} rows tracking")
    return 1 if claimed else 0


if __name__ == "__main__":
    sys.exit(main())
