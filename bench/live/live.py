#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The daemon on recordings in real time, from nothing, judged by what it records itself:

    bench/live/live.py [--bin build/release/bin] [--runs N] [--modalities region,edge,texture]
                       [--copies N] [--unplugged CAMERA|first] [--compilers N] [--json] RECORDING ...

Each run starts sightlined with the recording's cameras played once at their own pace, lets it record its poses, maps
their capture times back onto the recording's (frames.csv of both) and compares them with truth.csv or keyframes.csv
(`sightline evaluate`). Prints a row per run and the medians, with the load average before it: a busy machine finds less.
--copies: every camera so many times (a rig of twice as many cameras); --unplugged: this camera never gives a frame;
--compilers: so many compilers run beside it. Exits 0 if every run could be judged; 2 for bad input."""
import argparse
import contextlib
import csv
import json
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib

START_S = 90   # bound of every wait
TAIL_S = 1.0   # after the last frame


def read_times(folder, camera):
    with open(os.path.join(folder, "frames.csv"), encoding="utf-8", newline="") as file:
        return {int(row["sequence"]): int(row["capture_ns"]) for row in csv.DictReader(file) if row["camera"] == camera}


def write_object(source, folder, modalities):
    """A copy of the object file that measures by these modalities alone; its files stay where they are."""
    with open(source, encoding="utf-8") as file:
        text = file.read()
    base = os.path.dirname(os.path.abspath(source))
    text = re.sub(r'^(\s*(?:mesh|features)\s*=\s*")([^"/][^"]*)"', lambda m: f'{m[1]}{os.path.join(base, m[2])}"', text,
                  flags=re.MULTILINE)
    if modalities:
        text = "modalities = " + json.dumps(modalities) + "\n" + re.sub(r"(?m)^modalities\s*=.*$", "", text)
    path = os.path.join(folder, os.path.basename(source))
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def copied_calibration(recording, folder, copies):
    """calibration.toml with every camera `copies` times: NAME, NAME_2, ..."""
    with open(os.path.join(recording, "calibration.toml"), encoding="utf-8") as file:
        text = file.read()
    parts = re.split(r"(?m)^(?=\[\[camera\]\])", text)
    out = parts[0]
    for part in parts[1:]:
        out += part
        for i in range(2, copies + 1):
            out += re.sub(r'(?m)^(name\s*=\s*"[^"]*)"', rf'\1_{i}"', part, count=1)
    path = os.path.join(folder, "calibration.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(out)
    return path


def camera_lines(recording, name, options):
    unplugged = name == options.unplugged
    for i in range(1, options.copies + 1):
        source = "rtsp://127.0.0.1:9/unplugged" if unplugged else "replay:" + os.path.abspath(recording)
        lines = [f'[[camera]]\nname = "{name}{"" if i == 1 else f"_{i}"}"\nsource = "{source}"']
        if not unplugged:
            lines.append(f'recorded_as = "{name}"\nloop = false')
        yield "\n".join(lines) + "\n"


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


def write_config(recording, folder, options):
    modalities = [m for m in options.modalities.split(",") if m]
    with open(os.path.join(recording, "recording.toml"), "rb") as file:
        description = tomllib.load(file)
    cameras = [camera["name"] for camera in description["camera"]]
    if options.unplugged == "first":
        options.unplugged = cameras[0]
    lines = [f'calibration = "{copied_calibration(recording, folder, options.copies)}"', options.extra, f'[record]\nenabled = true\ndirectory = "{folder}/records"\n', "[rtsp]\nport = 0\n", "[http]\nport = 0\n"]
    for name in description["objects"]:
        path = write_object(os.path.join(recording, name), folder, modalities)
        lines.append(f'[[object]]\nfile = "{path}"\n')
    for name in cameras:
        lines += camera_lines(recording, name, options)
    os.mkdir(os.path.join(folder, "records"))
    path = os.path.join(folder, "live.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines))
    return path, [name for name in cameras if name != options.unplugged], [os.path.join(recording, name) for name in description["objects"]]


def play(binaries, config, seconds, log):
    """The daemon until its cameras have played out."""
    with open(log, "w", encoding="utf-8") as out:
        daemon = subprocess.Popen([os.path.join(binaries, "sightlined"), "--config", config], stdout=out, stderr=out)
    try:
        end = time.monotonic() + START_S + seconds
        started = None
        while time.monotonic() < end and daemon.poll() is None:
            if started is None:
                with open(log, encoding="utf-8", errors="replace") as file:
                    if "/metrics" in file.read():
                        started = time.monotonic()
            elif time.monotonic() - started > seconds + TAIL_S:
                break
            time.sleep(0.1)
        daemon.send_signal(signal.SIGTERM)
        daemon.wait(timeout=30)
    finally:
        if daemon.poll() is None:
            daemon.kill()
            daemon.wait()


def judge(binaries, recording, record, camera, objects, folder):
    """What `sightline evaluate` says of the recorded poses, at the recording's own times."""
    live, own = read_times(record, camera), read_times(recording, camera)
    common = sorted(set(live) & set(own))
    if not common:
        raise RuntimeError(f"{record}: no frame of {camera} in common")
    shift = own[common[0]] - live[common[0]]
    poses = os.path.join(folder, "poses.csv")
    with open(os.path.join(record, "poses.csv"), encoding="utf-8", newline="") as source, \
            open(poses, "w", encoding="utf-8", newline="") as target:
        rows = csv.reader(source)
        writer = csv.writer(target, lineterminator="\n")
        writer.writerow(next(rows))
        for row in rows:
            writer.writerow([str(int(row[0]) + shift)] + row[1:])
    keyframes = os.path.join(recording, "keyframes.csv")
    sparse = os.path.exists(keyframes)
    command = [os.path.join(binaries, "sightline"), "evaluate", "--json",
               keyframes if sparse else os.path.join(recording, "truth.csv"), poses]
    for path in objects:
        command += ["--object", path]
    text = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout
    first = {}
    with open(poses, encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["state"] == "tracking":
                first.setdefault(row["object"], (int(row["t_ns"]) - min(own.values())) * 1e-9)
    return json.loads(text)["objects"], first


def run(recording, options):
    with tempfile.TemporaryDirectory(prefix="sightline_live.") as folder:
        config, cameras, objects = write_config(recording, folder, options)
        times = read_times(recording, cameras[0])
        seconds = (max(times.values()) - min(times.values())) * 1e-9
        log = os.path.join(folder, "log")
        with compilers(options.compilers):
            play(options.bin, config, seconds, log)
        records = sorted(os.listdir(os.path.join(folder, "records")))
        if not records:
            with open(log, encoding="utf-8") as file:
                raise RuntimeError("nothing was recorded:\n" + file.read())
        return judge(options.bin, recording, os.path.join(folder, "records", records[0]), cameras[0], objects, folder)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--bin", default="build/release/bin")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--modalities", default="region,edge,texture")
    parser.add_argument("--extra", default="", help="further lines of the configuration's head")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--copies", type=int, default=1)
    parser.add_argument("--unplugged", default="", metavar="CAMERA|first")
    parser.add_argument("--compilers", type=int, default=0)
    options = parser.parse_args()
    table = sys.stderr if options.json else sys.stdout
    runs = []
    print(f"{'recording':12} {'object':10} {'pose %':>7} {'5cm+5deg %':>11} {'first s':>8} {'mm':>7} {'deg':>6} {'wrong':>6} {'load':>5}", file=table)
    for recording in options.recordings:
        if not os.path.isfile(os.path.join(recording, "recording.toml")):
            print(f"live.py: {recording}: not a recording folder", file=sys.stderr)
            return 2
        shares = {}
        for _ in range(options.runs):
            load = os.getloadavg()[0]
            evaluated, first = run(recording, options)
            for e in evaluated:
                rows = max(1, e["rows"])
                name = e["object"]
                posed = 100 * (rows - e["state_rows"]["searching"] - e["state_rows"]["lost"]) / rows
                best = e.get("up_to_symmetry", e) if e["judged"] and "up_to_symmetry" in e else e
                within = 100 * best["within"] / max(1, e["judged"])
                shares.setdefault(name, []).append(within)
                print(f"{os.path.basename(os.path.normpath(recording)):12} {name:10} {posed:7.1f} {within:11.1f} "
                      f"{first.get(name, float('nan')):8.2f} {best['errors']['median_mm']:7.2f} "
                      f"{best['errors']['median_deg']:6.2f} {e['wrong_claims']:6} {load:5.1f}", file=table, flush=True)
                runs.append({"recording": os.path.basename(os.path.normpath(recording)), "object": name,
                             "within_percent": within, "first_tracking_s": first.get(name),
                             "wrong_claims": e["wrong_claims"], "median_mm": best["errors"]["median_mm"], "load": load})
        for name, values in shares.items():
            print(f"{os.path.basename(os.path.normpath(recording)):12} {name:10} median of {len(values)} runs: "
                  f"{statistics.median(values):.1f} % within 5 cm + 5 deg", file=table, flush=True)
    if options.json:
        print(json.dumps(runs, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
