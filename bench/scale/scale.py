#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What cameras, objects, faces and viewers cost a running sightlined: CPU, memory, latency, drops; and what gives way when the
CPU does not suffice. The bundled recording is played by so many cameras in real time; one figure is changed at a time.

    bench/scale/scale.py [--seconds 8] [--only cameras,objects,faces,viewers,720p] [--values 8,16]
                         [--most-cameras 16] [--load N] [--json]

--load: so many busy processes beside it. Latencies are those of /metrics, middle of exposure to the first packet sent. The viewers
read and throw away, in one process; a further one times the frames of cam0.
"""
import argparse
import json
import os
import re
import resource
import select
import shutil
import subprocess
import sys
import tempfile
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.abspath(os.path.join(HERE, "..", ".."))
sys.path[:0] = [HERE, os.path.join(ROOT, "tests", "system"), os.path.join(ROOT, "tests", "siege")]
import inputs  # noqa: E402
import viewer  # noqa: E402
import watch  # noqa: E402
from support import Daemon, wait_until  # noqa: E402

BASE = {"cameras": 2, "objects": 1, "faces": 1000, "viewers": 1, "height": 480}
STEPS = {"cameras": ("cameras", [1, 2, 4, 8, 16, 32]), "objects": ("objects", [1, 2, 4]),
         "faces": ("faces", [1000, 10_000, 100_000, 1_000_000]), "viewers": ("viewers", [0, 1, 4, 16]), "720p": ("cameras", [1, 2, 4, 8, 16])}
SETTLE_S = 5
READERS = """
import os, selectors, sys
sys.path.insert(0, sys.argv[3])
import viewer
chosen, names = selectors.DefaultSelector(), sys.argv[2].split(",")
for name in names:
    player = viewer.Viewer(int(sys.argv[1]), name)
    player.play()
    chosen.register(player.sock, selectors.EVENT_READ)
chosen.register(sys.stdin, selectors.EVENT_READ)
print("playing", flush=True)
while True:
    for key, _ in chosen.select():
        if key.fileobj is sys.stdin:
            sys.exit(0)
        if not key.fileobj.recv(1 << 18):
            sys.exit("a stream ended")
"""


class Metrics:
    """One reading of /metrics."""

    def __init__(self, daemon):
        self.t, self.text = time.monotonic(), daemon.get("/metrics")
        self.cpu = watch.cpu_seconds(daemon.process.pid)

    def by_camera(self, name, stage=None):
        """{camera: value}"""
        at = f',stage="{stage}"' if stage else ""
        return {c: float(v) for c, v in re.findall(rf'^{name}{{camera="(\w+)"{at}}} (\S+)', self.text, re.M)}

    def buckets(self, stage):
        """{bound: count of all cameras}"""
        sums = {}
        for bound, value in re.findall(rf'^sightline_latency_seconds_bucket{{camera="\w+",stage="{stage}",le="([^"]+)"}} (\S+)',
                                       self.text, re.M):
            sums[float(bound)] = sums.get(float(bound), 0) + float(value)
        return sums


def rates(before, after, name, stage=None):
    """[per second] for each camera, ascending."""
    a, b = before.by_camera(name, stage), after.by_camera(name, stage)
    return sorted((b[c] - a.get(c, 0)) / (after.t - before.t) for c in b)


def quantile_ms(before, after, stage, share):
    """Between the bounds of the histogram, evenly."""
    a, b = before.buckets(stage), after.buckets(stage)
    counts = [(bound, b[bound] - a.get(bound, 0)) for bound in sorted(b)]
    if not counts or counts[-1][1] <= 0:
        return None
    wanted, low, below = share * counts[-1][1], 0.0, 0.0
    for bound, count in counts:
        if count >= wanted:
            if bound == float("inf"):
                return 1e3 * low
            return 1e3 * (low + (bound - low) * (wanted - below) / max(count - below, 1e-9))
        low, below = bound, count
    return None


class Viewers:
    """`count` of them, one of which times its frames."""

    def __init__(self, daemon, cameras, count):
        self.readers = self.timed = None
        path = os.path.join(ROOT, "tests", "siege")
        if count > 1:
            names = ",".join(f"cam{(i + 1) % cameras}" for i in range(count - 1))
            self.readers = self.start(["-c", READERS, str(daemon.rtsp), names, path])
        if count > 0:
            self.timed = self.start([viewer.__file__, "--port", str(daemon.rtsp), "--camera", "cam0"])

    @staticmethod
    def start(arguments):
        process = subprocess.Popen([sys.executable, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        ready, _, _ = select.select([process.stdout], [], [], 60)
        if not ready or process.stdout.readline().strip() != "playing":
            process.kill()
            raise RuntimeError("a viewer could not play")
        return process

    def frames(self, since):
        """Arrivals [s] of the timed viewer's frames from then on; ends all viewers."""
        arrivals = []
        if self.timed:
            out, _ = self.timed.communicate(timeout=30)
            arrivals = [f[0] / 1e9 for f in json.loads(out)["frames"] if f[0] / 1e9 >= since]
        if self.readers:
            self.readers.communicate(timeout=30)
        return arrivals

    def close(self):
        for process in (self.readers, self.timed):
            if process and process.poll() is None:
                process.kill()
                process.wait()


def measure(folder, run, seconds):
    daemon = Daemon(folder, inputs.installation(folder, run))
    viewers = None
    try:
        daemon.wait_for_word("READY=1")
        viewers = Viewers(daemon, run["cameras"], run["viewers"])
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline and any(o["state"] == "searching" for o in daemon.state()["objects"]):
            time.sleep(0.2)
        time.sleep(SETTLE_S)
        before, others = Metrics(daemon), watch.machine_seconds()
        time.sleep(seconds)
        after, others_after = Metrics(daemon), watch.machine_seconds()
        arrivals = viewers.frames(before.t)
        return summary(run, daemon, before, after, [b - a for a, b in zip(others, others_after)], arrivals)
    finally:
        if viewers:
            viewers.close()
        daemon.stop()
        daemon.close()


def summary(run, daemon, before, after, machine, arrivals):
    took = after.t - before.t
    cpu = (after.cpu - before.cpu) / took
    observed = rates(before, after, "sightline_latency_seconds_count", "observed")
    encoded = [rate for rate in rates(before, after, "sightline_images_encoded_total") if rate > 0.5]
    gaps = sorted(1e3 * (b - a) for a, b in zip(arrivals, arrivals[1:]) if b <= after.t)
    drops = {stage: round(sum(rates(before, after, "sightline_frames_dropped_total", stage)), 1)
             for stage in ("capture", "observe", "draw", "encode", "send")}
    return dict(run, cpu_cores=cpu, others_cores=(machine[0] - machine[1]) / took - cpu,
                rss_mb=watch.status_kb(daemon.process.pid, "VmRSS") / 1024,
                p50_ms=quantile_ms(before, after, "sent", 0.5), p99_ms=quantile_ms(before, after, "sent", 0.99),
                fused_p50_ms=quantile_ms(before, after, "fused", 0.5), drops_per_s=drops,
                captured_hz=rates(before, after, "sightline_frames_total"), observed_hz=observed, encoded_hz=encoded,
                gap_p99_ms=gaps[int(0.99 * len(gaps))] if gaps else None, gap_max_ms=gaps[-1] if gaps else None)


def show(value, digits=0):
    return "" if value is None else f"{value:.{digits}f}"


HEAD = ("| changed | CPU, cores | others | memory MB | sent p50 / p99 ms | observed Hz, least to most | streams Hz, least | "
        "gap p99 / most ms | dropped a second |")


def markdown(what, row):
    observed, encoded = row["observed_hz"], row["encoded_hz"]
    drops = ", ".join(f"{stage} {rate:g}" for stage, rate in row["drops_per_s"].items() if rate) or "0"
    spread = f"{observed[0]:.1f} to {observed[-1]:.1f}" if observed else ""
    return (f"| {what} | {row['cpu_cores']:.2f} | {row['others_cores']:.1f} | {row['rss_mb']:.0f} | {show(row['p50_ms'], 1)} / "
            f"{show(row['p99_ms'], 1)} | {spread} | {show(encoded[0], 1) if encoded else ''} | {show(row['gap_p99_ms'])} / "
            f"{show(row['gap_max_ms'])} | {drops} |")


def runs(options):
    for axis in options.only.split(","):
        key, values = STEPS[axis]
        values = [int(value) for value in options.values.split(",")] if options.values else values
        for value in values:
            if key == "cameras" and value > options.most_cameras:
                continue
            run = dict(BASE, **{key: value})
            if axis == "720p":
                run["height"] = 720
            if axis in ("cameras", "720p"):
                run["viewers"] = min(value, 4)
            yield axis, f"{value} {key}" + (f" {run['height']}p" if key == "cameras" else ""), run


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=8)
    parser.add_argument("--only", default=",".join(STEPS))
    parser.add_argument("--values", help="these instead of the usual ones, as in 8,16")
    parser.add_argument("--most-cameras", type=int, default=16)
    parser.add_argument("--load", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    folder = tempfile.mkdtemp(prefix="sightline_scale.")
    os.environ["XDG_CACHE_HOME"] = os.path.join(folder, "cache")
    for name in os.listdir(os.path.join(inputs.BENCH, "objects")):
        shutil.copy(os.path.join(inputs.BENCH, "objects", name), folder)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(options.load)]
    rows = []
    try:
        if not options.json:
            print(f"{HEAD}\n|{' --- |' * (HEAD.count('|') - 1)}", flush=True)
        for axis, what, run in runs(options):
            row = dict(measure(folder, run, options.seconds), axis=axis)
            rows.append(row)
            if not options.json:
                print(markdown(what, row), flush=True)
    finally:
        for process in busy:
            process.kill()
            process.wait()
        shutil.rmtree(folder, ignore_errors=True)
    if options.json:
        json.dump(rows, sys.stdout, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
