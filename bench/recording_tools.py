# SPDX-License-Identifier: Apache-2.0
"""What the scripts that measure on recordings share: arguments, recordings, object files and commands of sightline."""
import argparse
import csv
import dataclasses
import json
import os
import pathlib
import re
import shlex
import subprocess
import tempfile
import tomllib

MODALITIES = "region,edge,texture"
STATES_WITH_POSE = ("tracking", "degraded", "coasting")


@dataclasses.dataclass(frozen=True)
class Recording:
    folder: pathlib.Path  # absolute
    videos: dict  # camera name -> file name
    objects: list  # paths of the object files
    frames: list  # rows of frames.csv

    @property
    def name(self):
        return self.folder.name

    @property
    def cameras(self):
        return list(self.videos)

    @property
    def start_ns(self):
        return min(int(row["capture_ns"]) for row in self.frames)

    @property
    def seconds(self):
        return (max(int(row["capture_ns"]) for row in self.frames) - self.start_ns) * 1e-9

    @property
    def truth(self):
        """The file that `sightline evaluate` compares with."""
        keyframes = self.folder / "keyframes.csv"
        return keyframes if keyframes.exists() else self.folder / "truth.csv"

    def capture_times(self, camera):
        """Nanoseconds of a camera's frames by sequence number."""
        return {int(row["sequence"]): int(row["capture_ns"]) for row in self.frames if row["camera"] == camera}


def load_recording(folder):
    """Raises OSError, ValueError or KeyError for what cannot be read."""
    folder = pathlib.Path(os.path.abspath(folder))
    with open(folder / "recording.toml", "rb") as file:
        description = tomllib.load(file)
    frames = read_csv(folder / "frames.csv")
    if not frames:
        raise ValueError("frames.csv holds no frame")
    return Recording(folder, {camera["name"]: camera["file"] for camera in description["camera"]},
                     [folder / name for name in description.get("objects", [])], frames)


def recording_argument(folder):
    """A type of argparse: bad input is a message and exit 2."""
    if not os.path.isfile(os.path.join(folder, "recording.toml")):
        raise argparse.ArgumentTypeError(f"{folder}: not a recording folder")
    try:
        return load_recording(folder)
    except (OSError, ValueError, KeyError) as error:
        raise argparse.ArgumentTypeError(f"{folder}: {type(error).__name__}: {error}") from error


def recording_parser(doc):
    """The arguments of every script: recordings and the folder of the programs."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=recording_argument, metavar="RECORDING")
    parser.add_argument("--bin", default="build/release/bin", help="folder of the programs")
    return parser


def new_folder_argument(folder):
    if os.path.exists(folder):
        raise argparse.ArgumentTypeError(f"{folder}: exists")
    return pathlib.Path(folder)


def maker_parser(doc):
    """The arguments of scripts that make a recording of another one."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=recording_argument, metavar="RECORDING")
    parser.add_argument("folder", type=new_folder_argument, metavar="FOLDER")
    return parser


def as_h264(description):
    """The text of a recording.toml whose videos are encoded anew."""
    return re.sub(r'(?m)^codec\s*=.*$', 'codec = "h264"', description)


def add_replay_option(parser):
    parser.add_argument("--replay", default="", help="further options of sightline replay: --replay='--OPTION VALUE'")


def add_jobs_option(parser):
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="so many at a time")


def read_csv(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_csv(path, columns, rows):
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def load_object(object_file):
    with open(object_file, "rb") as file:
        return tomllib.load(file)


def object_name(object_file):
    return load_object(object_file)["name"]


def mesh_path(object_file):
    return object_file.parent / load_object(object_file)["mesh"]


def object_text(object_file):
    """The text of an object file for another folder: paths of its mesh and its features are absolute."""
    return re.sub(r'^(\s*(?:mesh|features)\s*=\s*")([^"/][^"]*)"', lambda m: f'{m[1]}{object_file.parent / m[2]}"',
                  object_file.read_text(encoding="utf-8"), flags=re.MULTILINE)


def write_copies(object_file, count, folder):
    """Object files of so many objects that are as this one, by other names."""
    copies = []
    for i in range(1, count + 1):
        copies.append(pathlib.Path(folder, f"copy_{i}.toml"))
        name = f'name = "{object_name(object_file)}_{i}"'
        copies[-1].write_text(re.sub(r"(?m)^name\s*=.*$", name, object_text(object_file), count=1), encoding="utf-8")
    return copies


def write_replay_config(recording, object_files, folder):
    """A configuration that searches the recording for these objects alone."""
    lines = [f'calibration = "{recording.folder}/calibration.toml"']
    lines += [f'[[object]]\nfile = "{object_file}"' for object_file in object_files]
    lines += [f'[[camera]]\nname = "{name}"\nsource = "replay:{recording.folder}"' for name in recording.cameras]
    config = pathlib.Path(folder, "config.toml")
    config.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return config


def run_sightline(binaries, *arguments, timeout_s=1800):
    """Standard output of a command of sightline; RuntimeError says why there is none."""
    done = subprocess.run([os.path.join(binaries, "sightline"), *arguments], capture_output=True, text=True,
                          encoding="utf-8", errors="replace", timeout=timeout_s, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"sightline {arguments[0]} exits with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def replay(options, recording, poses, config=None, more=()):
    """Replays without markers, with `more` options; writes the pose log and returns its rows."""
    run_sightline(options.bin, "replay", recording.folder, *(["--config", config] if config else []),
                  "--modalities", MODALITIES, "--poses", poses, *shlex.split(options.replay), *more)
    return read_csv(poses)


def replay_with_object(options, recording, object_file, count=1):
    """Rows of the pose log with this object instead of the recording's own, or with so many that are like it."""
    with tempfile.TemporaryDirectory(prefix="sightline_replay.") as folder:
        files = [object_file] if count == 1 else write_copies(object_file, count, folder)
        config = write_replay_config(recording, files, folder)
        return replay(options, recording, os.path.join(folder, "poses.csv"), config)


def count_states(rows):
    """Rows of a pose log by state, of those states that come with a pose."""
    return {state: sum(row["state"] == state for row in rows) for state in STATES_WITH_POSE}


def alike_objects(recording):
    """Names of objects that have the same mesh, by mesh."""
    by_mesh = {}
    for object_file in recording.objects:
        shape = [line for line in mesh_path(object_file).read_bytes().splitlines() if line[:2] in (b"v ", b"f ")]
        by_mesh.setdefault(hash(tuple(shape) or mesh_path(object_file)), []).append(object_name(object_file))
    return [names for names in by_mesh.values() if len(names) > 1]


def evaluate(binaries, recording, poses):
    """What `sightline evaluate` says of a pose log, per object."""
    command = ["evaluate", "--json", recording.truth, poses]
    for object_file in recording.objects:
        command += ["--object", object_file]
    for names in alike_objects(recording):
        command += ["--alike", ",".join(names)]
    return json.loads(run_sightline(binaries, *command, timeout_s=120))["objects"]


def up_to_symmetry(evaluation):
    """The part of an object's evaluation with its errors: up to its shape's symmetries where it has any."""
    return evaluation["up_to_symmetry"] if evaluation["judged"] and "up_to_symmetry" in evaluation else evaluation
