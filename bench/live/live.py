#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The daemon on recordings in real time, from nothing, judged by what it records itself:

    bench/live/live.py [--bin build/release/bin] [--runs N] [--modalities region,edge,texture] [--extra LINES]
                       [--start SHARE] [--copies N] [--only CAMERA] [--unplugged CAMERA|first] [--compilers N] [--keep FOLDER]
                       [--json] RECORDING ...

Each run starts sightlined with the recording's cameras played once at their own pace, lets it record its poses, maps
their capture times back onto the recording's (frames.csv of both) and compares them with truth.csv or keyframes.csv
(`sightline evaluate`). Prints a row per run and the medians, with the load average before it: a busy machine finds
less. --start: each recording begins after this share of it, 0 to 0.9 (bench/offsets.py cuts it); --copies: every camera so many times (a rig of twice as many cameras); --only: the rig has this camera of the
recording alone; --unplugged: this camera of every recording never gives a frame; --compilers: so many compilers run
beside it; --keep: log and poses of the last run of each recording stay there, also of one that could not be judged
(--extra '[daemon]\nlog_level = "debug"', with a line break, says what was searched and checked). Exits 0 if every run
could be judged, 1 if one could not (standard error says why; the others count), 2 for bad input."""
import contextlib
import csv
import dataclasses
import json
import os
import pathlib
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from offsets import cut  # noqa: E402
from recording_tools import (MODALITIES, evaluate, load_recording, object_text, read_csv,  # noqa: E402
                             recording_parser, up_to_symmetry)

START_S = 90   # until the daemon serves
STOP_S = 30
TAIL_S = 1.0   # after the last frame


def seen_by(recording, only):
    """The recording of one of its cameras alone; ValueError if there is no such."""
    if not only:
        return recording
    if only not in recording.videos:
        raise ValueError(f"{recording.name} has no camera '{only}'; its cameras: {', '.join(recording.cameras)}")
    return dataclasses.replace(recording, videos={only: recording.videos[only]})


@contextlib.contextmanager
def begun_later(recording, share, only):
    """The recording from that share of it on."""
    if share == 0:
        yield recording
        return
    with tempfile.TemporaryDirectory(prefix="sightline_live.") as folder:
        whole = load_recording(recording.folder)
        yield seen_by(cut(whole, pathlib.Path(folder, recording.name), share * whole.seconds), only)


def unplugged_camera(recording, wanted):
    """The camera of this recording that gives no frame, or None; ValueError if there is no such or no other one."""
    if not wanted:
        return None
    camera = recording.cameras[0] if wanted == "first" else wanted
    if camera not in recording.cameras:
        raise ValueError(f"{recording.name} has no camera '{camera}'; its cameras: {', '.join(recording.cameras)}")
    if len(recording.cameras) == 1:
        raise ValueError(f"{recording.name}: nothing is left without '{camera}', its only camera")
    return camera


def write_object(object_file, folder, modalities):
    """A copy of the object file that measures by these modalities alone; its files stay where they are."""
    text = object_text(object_file)
    if modalities:
        text = "modalities = " + json.dumps(modalities) + "\n" + re.sub(r"(?m)^modalities\s*=.*$", "", text)
    path = folder / object_file.name
    path.write_text(text, encoding="utf-8")
    return path


def write_calibration(recording, folder, copies):
    """calibration.toml with every camera `copies` times: NAME, NAME_2, ..."""
    text = (recording.folder / "calibration.toml").read_text(encoding="utf-8")
    parts = re.split(r"(?m)^(?=\[\[camera\]\])", text)
    out = parts[0]
    for part in parts[1:]:
        out += part
        for i in range(2, copies + 1):
            out += re.sub(r'(?m)^(name\s*=\s*"[^"]*)"', rf'\1_{i}"', part, count=1)
    path = folder / "calibration.toml"
    path.write_text(out, encoding="utf-8")
    return path


def camera_sections(recording, name, unplugged, copies):
    source = "rtsp://127.0.0.1:9/unplugged" if unplugged else f"replay:{recording.folder}"
    for i in range(1, copies + 1):
        lines = [f'[[camera]]\nname = "{name}{"" if i == 1 else f"_{i}"}"\nsource = "{source}"']
        if not unplugged:
            lines.append(f'recorded_as = "{name}"\nloop = false')
        yield "\n".join(lines) + "\n"


def write_config(recording, unplugged, folder, options):
    """The daemon's configuration; it records into the folder `records`."""
    modalities = [m for m in options.modalities.split(",") if m]
    records = folder / "records"
    records.mkdir()
    lines = [f'calibration = "{write_calibration(recording, folder, options.copies)}"', options.extra,
             f'[record]\nenabled = true\ndirectory = "{records}"\n', "[rtsp]\nport = 0\n", "[http]\nport = 0\n"]
    for object_file in recording.objects:
        lines.append(f'[[object]]\nfile = "{write_object(object_file, folder, modalities)}"\n')
    for name in recording.cameras:
        lines += camera_sections(recording, name, name == unplugged, options.copies)
    config = folder / "live.toml"
    config.write_text("\n".join(lines), encoding="utf-8")
    return config


@contextlib.contextmanager
def compilers(count):
    """Compilers that run beside, one file after the other."""
    script = ("while :; do printf '#include <regex>\n#include <map>\nint main(){std::regex r(\"a\");}' | "
              "c++ -O2 -x c++ -c - -o /dev/null; done")
    running = [subprocess.Popen(["sh", "-c", script], start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for process in running:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def wait_until_serving(daemon, log):
    """Its cameras play from then on."""
    end = time.monotonic() + START_S
    while "/metrics" not in (said := log.read_text(encoding="utf-8", errors="replace")):
        if daemon.poll() is not None:
            raise RuntimeError(f"sightlined ended with {daemon.returncode}:\n{said}")
        if time.monotonic() > end:
            raise RuntimeError(f"sightlined did not serve within {START_S} s:\n{said}")
        time.sleep(0.1)


def play(binaries, config, seconds, log):
    """The daemon until its cameras have played out."""
    with open(log, "w", encoding="utf-8") as out:
        daemon = subprocess.Popen([os.path.join(binaries, "sightlined"), "--config", config], stdout=out, stderr=out)
    try:
        wait_until_serving(daemon, log)
        with contextlib.suppress(subprocess.TimeoutExpired):
            daemon.wait(timeout=seconds + TAIL_S)
            raise RuntimeError(f"sightlined ended with {daemon.returncode} before its cameras had played out:\n"
                               + log.read_text(encoding="utf-8", errors="replace"))
        daemon.send_signal(signal.SIGTERM)
        daemon.wait(timeout=STOP_S)
    finally:
        if daemon.poll() is None:
            daemon.kill()
            daemon.wait()


def recorded_in(folder, log):
    """What the daemon recorded: its first recording."""
    records = sorted(folder.iterdir())
    if not records:
        raise RuntimeError("nothing was recorded:\n" + log.read_text(encoding="utf-8", errors="replace"))
    return load_recording(records[0])


def write_mapped_poses(record, recording, camera, poses):
    """The recorded poses at the recording's own times."""
    live, own = record.capture_times(camera), recording.capture_times(camera)
    common = sorted(set(live) & set(own))
    if not common:
        raise RuntimeError(f"no recorded frame of {camera} is one of the recording's")
    shift = own[common[0]] - live[common[0]]
    with open(record.folder / "poses.csv", encoding="utf-8", newline="") as source, \
            open(poses, "w", encoding="utf-8", newline="") as target:
        rows = csv.reader(source)
        writer = csv.writer(target, lineterminator="\n")
        writer.writerow(next(rows, []))
        writer.writerows([str(int(row[0]) + shift)] + row[1:] for row in rows)


def summary(evaluation, recording, first_tracking_s, load):
    """What is printed of an object in a run; RuntimeError if nothing of it could be compared with the truth."""
    if not evaluation["rows"] or not evaluation["judged"]:
        raise RuntimeError(f"no recorded row of {evaluation['object']} has a truth at its time")
    rows, searched = evaluation["rows"], evaluation["state_rows"]["searching"] + evaluation["state_rows"]["lost"]
    best = up_to_symmetry(evaluation)
    return {"recording": recording.name, "object": evaluation["object"],
            "posed_percent": 100 * (rows - searched) / rows,
            "within_percent": 100 * best["within"] / evaluation["judged"],
            "first_tracking_s": first_tracking_s, "wrong_claims": evaluation["wrong_claims"],
            "median_mm": best["errors"]["median_mm"], "median_deg": best["errors"]["median_deg"], "load": load}


def judge(options, recording, record, camera, folder, load):
    """What `sightline evaluate` says of the recorded poses: a summary per object."""
    poses = folder / "poses.csv"
    write_mapped_poses(record, recording, camera, poses)
    start_ns = min(recording.capture_times(camera).values())
    first = {}
    for row in read_csv(poses):
        if row["state"] == "tracking":
            first.setdefault(row["object"], (int(row["t_ns"]) - start_ns) * 1e-9)
    return [summary(e, recording, first.get(e["object"]), load) for e in evaluate(options.bin, recording, poses)]


def run(recording, unplugged, options):
    """Plays a recording once and judges it."""
    load = os.getloadavg()[0]
    camera = next(name for name in recording.cameras if name != unplugged)
    times = recording.capture_times(camera).values()
    with tempfile.TemporaryDirectory(prefix="sightline_live.") as name:
        folder = pathlib.Path(name)
        config = write_config(recording, unplugged, folder, options)
        try:
            with compilers(options.compilers):
                play(options.bin, config, (max(times) - min(times)) * 1e-9, folder / "log")
            record = recorded_in(folder / "records", folder / "log")
            return judge(options, recording, record, camera, folder, load)
        finally:
            keep(options.keep, recording.name, folder)


def keep(target, name, folder):
    """What there is of log and poses of a run, as NAME.log and NAME.csv; of several runs the last."""
    if target:
        for source, kept in (("log", f"{name}.log"), ("poses.csv", f"{name}.csv")):
            with contextlib.suppress(FileNotFoundError):
                shutil.copy(folder / source, target / kept)


def print_run(summaries, table):
    for s in summaries:
        first = float("nan") if s["first_tracking_s"] is None else s["first_tracking_s"]
        print(f"{s['recording']:12} {s['object']:10} {s['posed_percent']:7.1f} {s['within_percent']:11.1f} "
              f"{first:8.2f} {s['median_mm']:7.2f} {s['median_deg']:6.2f} {s['wrong_claims']:6} {s['load']:5.1f}",
              file=table, flush=True)


def print_medians(summaries, table):
    shares = {}
    for s in summaries:
        shares.setdefault((s["recording"], s["object"]), []).append(s["within_percent"])
    for (recording, name), values in shares.items():
        print(f"{recording:12} {name:10} median of {len(values)} runs: {statistics.median(values):.1f} % within "
              "5 cm + 5 deg", file=table, flush=True)


def run_all(recording, unplugged, options, table):
    """(summaries of all runs that could be judged, number of the others)"""
    summaries, failures = [], 0
    for i in range(1, options.runs + 1):
        try:
            found = run(recording, unplugged, options)
        except (OSError, RuntimeError, ValueError, LookupError, subprocess.SubprocessError) as error:
            reason = error if isinstance(error, RuntimeError) else f"{type(error).__name__}: {error}"
            print(f"live.py: {recording.name}, run {i}: could not be judged: {reason}", file=sys.stderr, flush=True)
            failures += 1
            continue
        print_run(found, table)
        summaries += found
    print_medians(summaries, table)
    return summaries, failures


def parse_arguments():
    """(options, the unplugged camera of each recording)"""
    parser = recording_parser(__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--modalities", default=MODALITIES)
    parser.add_argument("--extra", default="", help="further lines of the configuration's head")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--start", type=float, default=0, metavar="SHARE")
    parser.add_argument("--copies", type=int, default=1)
    parser.add_argument("--only", default="", metavar="CAMERA")
    parser.add_argument("--unplugged", default="", metavar="CAMERA|first")
    parser.add_argument("--compilers", type=int, default=0)
    parser.add_argument("--keep", type=pathlib.Path, metavar="FOLDER")
    options = parser.parse_args()
    if not 0 <= options.start <= 0.9:
        parser.error("--start: a share of the recording, 0 to 0.9")
    try:
        if options.keep:
            options.keep.mkdir(parents=True, exist_ok=True)
        options.recordings = [seen_by(recording, options.only) for recording in options.recordings]
        return options, [unplugged_camera(recording, options.unplugged) for recording in options.recordings]
    except (OSError, ValueError) as error:
        parser.error(str(error))


def main():
    options, unplugged = parse_arguments()
    table = sys.stderr if options.json else sys.stdout
    print(f"{'recording':12} {'object':10} {'pose %':>7} {'5cm+5deg %':>11} {'first s':>8} {'mm':>7} {'deg':>6} "
          f"{'wrong':>6} {'load':>5}", file=table, flush=True)
    summaries, failures = [], 0
    for recording, camera in zip(options.recordings, unplugged):
        with begun_later(recording, options.start, options.only) as part:
            judged, missed = run_all(part, camera, options, table)
        summaries += judged
        failures += missed
    if options.json:
        print(json.dumps(summaries, indent=2))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
