#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A longer recording of a short one, without a jump: forward, backward, forward, ...

    bench/live/to_and_fro.py [--passes N] RECORDING FOLDER

Writes a recording of N passes (8) to FOLDER, which must not exist: what moves turns back at once where a pass ends (its
velocity jumps, its pose does not), and truth.csv, keyframes.csv and visibility.csv go with it. The videos are encoded
again, almost without loss. A clip of seconds says how soon something is found; this says whether it is kept, lost,
found again, and whether something is claimed wrongly in the long run. Needs ffmpeg. Exits 2 for bad input."""
import pathlib
import shutil
import subprocess
import sys
import tomllib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from recording_tools import as_h264, load_recording, maker_parser, read_csv, write_csv  # noqa: E402

ENCODE_S = 1800


def pass_time(time, p, first_ns, last_ns):
    """When pass p shows what was taken at `time`: the middle of the turn is the first or last capture time of the rig."""
    length = last_ns - first_ns
    return first_ns + p * length + (time - first_ns if p % 2 == 0 else last_ns - time)


def turned_rows(rows, column, passes, first_ns, last_ns):
    """The rows of a file at all their new times; of two at one time, where the motion turns, the earlier pass's."""
    out, seen = [], set()
    for p in range(passes):
        for row in rows if p % 2 == 0 else reversed(rows):
            time = pass_time(int(row[column]), p, first_ns, last_ns)
            key = (time, row.get("camera"), row.get("object"))
            if key not in seen:
                seen.add(key)
                out.append((time, row))
    return sorted(out, key=lambda timed: timed[0])


def write_frames(recording, folder, passes, first_ns, last_ns):
    """frames.csv; returns for each camera which image each of its frames shows."""
    order, rows = {camera: [] for camera in recording.cameras}, []
    index = {camera: {seq: i for i, seq in enumerate(recording.capture_times(camera))} for camera in recording.cameras}
    for time, row in turned_rows(recording.frames, "capture_ns", passes, first_ns, last_ns):
        camera = row["camera"]
        late = int(row["arrival_ns"]) - int(row["capture_ns"])
        rows.append({**row, "sequence": len(order[camera]), "capture_ns": time, "arrival_ns": time + late,
                     "dropped_before": 0})
        order[camera].append(index[camera][int(row["sequence"])])
    write_csv(folder / "frames.csv", recording.frames[0].keys(), rows)
    return order


def write_video(source, target, size, order):
    """The images of a video in another order."""
    frame_bytes = size[0] * size[1] * 3 // 2
    raw = subprocess.run(["ffmpeg", "-v", "error", "-i", source, "-f", "rawvideo", "-pix_fmt", "yuv420p", "-vsync", "0",
                          "-"], check=True, timeout=ENCODE_S, stdout=subprocess.PIPE).stdout
    with subprocess.Popen(["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "yuv420p", "-s",
                           f"{size[0]}x{size[1]}", "-r", "30", "-i", "-", "-c:v", "libx264", "-crf", "8", "-preset",
                           "veryfast", "-g", "15", "-bf", "0", "-color_range", "tv", target],
                          stdin=subprocess.PIPE) as encoder:
        for image in order:
            encoder.stdin.write(raw[image * frame_bytes:(image + 1) * frame_bytes])
        encoder.stdin.close()
        if encoder.wait(timeout=ENCODE_S):
            raise RuntimeError(f"{target}: ffmpeg ended with {encoder.returncode}")


def write_visibility(source, folder, order):
    """visibility.csv names frames by their number."""
    if not source.exists():
        return
    rows = read_csv(source)
    of = {}
    for row in rows:
        of.setdefault((row["camera"], int(row["index"])), []).append(row)
    write_csv(folder / "visibility.csv", rows[0].keys(),
              [{**row, "index": i} for camera, images in order.items() for i, image in enumerate(images)
               for row in of.get((camera, image), [])])


def to_and_fro(recording, folder, passes):
    """The recording played to and fro so many times, in a new folder."""
    shutil.copytree(recording.folder, folder, ignore=shutil.ignore_patterns("*.mkv", "frames.csv", "poses.csv"))
    description = folder / "recording.toml"
    text = as_h264(description.read_text(encoding="utf-8"))
    description.write_text(text, encoding="utf-8")
    sizes = {c["name"]: (c["width"], c["height"]) for c in tomllib.loads(text)["camera"]}
    first_ns, last_ns = recording.start_ns, max(int(row["capture_ns"]) for row in recording.frames)
    order = write_frames(recording, folder, passes, first_ns, last_ns)
    for name in ("truth.csv", "keyframes.csv"):
        rows = read_csv(folder / name) if (folder / name).exists() else []
        if rows:
            write_csv(folder / name, rows[0].keys(), [{**row, "t_ns": time} for time, row in turned_rows(
                rows, "t_ns", passes, first_ns, last_ns)])
    for camera, video in recording.videos.items():
        write_video(recording.folder / video, folder / video, sizes[camera], order[camera])
    write_visibility(recording.folder / "visibility.csv", folder, order)
    return load_recording(folder)


def main():
    parser = maker_parser(__doc__)
    parser.add_argument("--passes", type=int, default=8)
    options = parser.parse_args()
    if options.passes < 1:
        parser.error("--passes: at least 1")
    if (options.recording.folder / "axes.csv").exists():
        parser.error(f"{options.recording.folder}: its axes.csv is not turned back; cameras that stand still only")
    calibration = tomllib.loads((options.recording.folder / "calibration.toml").read_text(encoding="utf-8"))
    if any(camera.get("readout_s", 0) != 0 for camera in calibration["camera"]):
        parser.error(f"{options.recording.folder}: played backwards a rolling shutter (readout_s) would roll the other way")
    to_and_fro(options.recording, options.folder, options.passes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
