#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs sightlined with eight cameras for as long as asked, while viewers come and go and faults happen at random from a seed, one each
few seconds: a camera's process dies and returns, viewers stop reading, reloads, recordings, the broker away, the disk full.
At the calm end of each half minute its memory, descriptors and threads are taken. Prints each criterion with what was measured,
writes the same as JSON (--report), and exits 0 if all hold, 1 if not.

    tests/soak/soak.py --minutes 60 --seed 5          # needs build/release
"""
import argparse
import json
import os
import re
import shutil
import statistics
import sys
import tempfile
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "system"), os.path.join(HERE, "..", "siege")]
import plan as plans  # noqa: E402
import verdict  # noqa: E402
import watch  # noqa: E402
from faults import Faults  # noqa: E402
from rig import KINDS, NAMES, Rig, Watching  # noqa: E402
from support import ROOT  # noqa: E402

PATIENCE_S = 60  # for the calm at the end of a cycle on a busy machine


class Soak:
    def __init__(self, options, folder):
        self.options, self.plan = options, plans.make(options.seed, options.minutes)
        if options.only is not None:
            self.plan = [entry for entry in self.plan if entry[1] in options.only.split(",")]
        self.rig = Rig(folder, options.slow_disk)
        self.rig.reloading = threading.Lock()
        self.faults, self.calm = Faults(self.rig), []

    def metrics(self, name, label="camera"):
        found = re.findall(rf'^{name}{{{label}="([^"]+)"}} (\S+)', self.rig.get("/metrics"), re.M)
        return {key: float(value) for key, value in found}

    def all_present(self):
        return {camera["name"]: camera["present"] for camera in json.loads(self.rig.get("/api/state"))["cameras"]}

    def quiet(self):
        state = json.loads(self.rig.get("/api/state"))
        watched = sum(camera["viewers"] + camera["webrtc_viewers"] for camera in state["cameras"])
        return watched == 0 and all(camera["present"] for camera in state["cameras"])

    def take_calm(self, first_row):
        """What it holds when everybody has left: the median of some seconds, and the most of the whole cycle."""
        self.faults.calm(PATIENCE_S)
        end = time.monotonic() + PATIENCE_S
        while not self.quiet() and time.monotonic() < end:
            time.sleep(0.5)
        time.sleep(2.5)
        cycle = self.samples.rows[first_row:]
        still = cycle[-5:]
        row = {what: statistics.median(r[what] for r in still) for what in ("rss_kb", "descriptors", "threads")}
        row.update({"most_" + what: max(r[what] for r in cycle) for what in row}, t=round(time.monotonic() - self.since, 1))
        self.calm.append(row)
        print(f"{row['t']:7.0f} s: {row['rss_kb'] / 1024:6.1f} MB, {row['descriptors']:.0f} descriptors, {row['threads']:.0f} "
              f"threads; at most {row['most_rss_kb'] / 1024:.1f} MB, {row['most_descriptors']}, {row['most_threads']}", flush=True)

    def alive(self):
        return self.rig.daemon.process.poll() is None

    def live(self):
        """The plan, cycle by cycle. On a busy machine a cycle takes longer, and the rest moves."""
        cycle, shift, first_row = 0, 0.0, 0
        end = plans.cycles(self.options.minutes) * plans.CYCLE_S
        for at, kind, seconds, number in self.plan + [(end, None, 0, 0)]:
            while at >= (cycle + 1) * plans.CYCLE_S and self.alive():
                due = self.since + (cycle + 1) * plans.CYCLE_S - plans.CALM_S + shift
                time.sleep(max(0.0, due - time.monotonic()))
                self.take_calm(first_row)
                first_row, cycle = len(self.samples.rows), cycle + 1
                shift = max(shift, time.monotonic() - self.since - cycle * plans.CYCLE_S)
            if kind is None or not self.alive():
                return
            time.sleep(max(0.0, self.since + at + shift - time.monotonic()))
            self.faults.begin(kind, seconds, number)

    def warm_up(self):
        """Everything once, so that what is made at its first use is there: streams, pictures, recordings, reloads."""
        watchers = [Watching(self.rig.rtsp, name, 3) for name in NAMES]
        for watcher in watchers:
            watcher.start()
        self.faults.pictures(2, 0)
        self.faults.pictures(2, 1)
        self.rig.order("/api/v1/recordings/start", {"kinds": list(KINDS)})
        for watcher in watchers:
            watcher.join()
        self.rig.order("/api/v1/recordings/stop", {"kinds": list(KINDS)})
        for number in range(3):
            self.faults.reload(0, number)

    def latencies(self):
        delays = [delay for watcher in self.faults.watchers for delay in watcher.delays_ms]
        return {"p50_ms": verdict.quantile(delays, 0.5), "p99_ms": verdict.quantile(delays, 0.99), "frames": len(delays)}

    def stop(self):
        since = time.monotonic()
        self.rig.daemon.process.terminate()
        while self.alive() and time.monotonic() < since + 60:
            self.rig.daemon.read_notifications()
        return time.monotonic() - since, self.rig.daemon.process.poll()

    def run(self):
        daemon = self.rig.daemon
        self.samples, self.health = watch.Samples(daemon), watch.Health(self.rig.http)
        for _ in range(600):
            if all(self.all_present().values()):
                break
            time.sleep(0.1)
        self.warm_up()
        opened = self.metrics("sightline_source_opened_total")
        cpu, self.since = watch.cpu_seconds(daemon.process.pid), time.monotonic()
        self.samples.start()
        self.health.start()
        self.live()
        took = time.monotonic() - self.since
        if not self.alive():
            print(f"the daemon ended with {daemon.process.returncode}:\n{daemon.log_text()[-3000:]}")
            return None
        seen = {"calm": self.calm, "counts": self.faults.counts, "planned": sorted({kind for _, kind, _, _ in self.plan}),
                "present": self.all_present(), "cpu_cores": (watch.cpu_seconds(daemon.process.pid) - cpu) / took,
                "dropped": self.dropped(), "latency": self.latencies(), "seconds": took, "seed": self.options.seed}
        after = self.metrics("sightline_source_opened_total")
        seen["opened"] = {name: int(after[name] - opened[name]) for name in NAMES[:plans.CAMERAS - plans.MORTAL]}
        self.health.stop()
        self.samples.stop()
        seen["polls"], seen["fed"] = self.health.polls, [t for t in self.samples.fed if t >= self.since]
        seen["log_lines_per_s"] = sum(row["log_lines"] for row in self.samples.rows) / took
        seen["viewers"] = {"all": len(self.faults.watchers), "with_frames": sum(w.frames > 0 for w in self.faults.watchers),
                           "problems": sorted({w.problem for w in self.faults.watchers if w.problem})}
        seen["stop"] = self.stop()
        return seen

    def dropped(self):
        """Frames dropped of all cameras, by stage."""
        sums = {}
        text = self.rig.get("/metrics")
        for stage, value in re.findall(r'^sightline_frames_dropped_total{camera="[^"]+",stage="(\w+)"} (\S+)', text, re.M):
            sums[stage] = sums.get(stage, 0) + float(value)
        return sums


def report(seen, path):
    lines = verdict.judge(seen)
    for what, ok, measured, allowed in lines:
        print(f"{'ok  ' if ok else 'FAIL'} {what}: {measured} (allowed: {allowed})")
    latency = seen["latency"]
    if latency["frames"]:
        print(f"     capture to viewer: p50 {latency['p50_ms']:.1f} ms, p99 {latency['p99_ms']:.1f} ms, {latency['frames']} frames")
    print(f"     dropped {seen['dropped']}; {seen['cpu_cores']:.2f} cores, {seen['log_lines_per_s']:.1f} log lines a second; viewers' "
          f"problems {seen['viewers']['problems']}; seed {seen['seed']}, {seen['seconds']:.0f} s")
    if path:
        with open(path, "w", encoding="utf-8") as file:
            json.dump(dict(seen, polls=len(seen["polls"]), fed=len(seen["fed"]),
                           criteria=[{"criterion": w, "ok": bool(o), "measured": str(m), "allowed": a} for w, o, m, a in lines]),
                      file, indent=1)
    return all(ok for _, ok, _, _ in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=float(os.environ.get("SIGHTLINE_SOAK_MINUTES", "2")))
    parser.add_argument("--seed", type=int, default=int(os.environ.get("SIGHTLINE_SOAK_SEED", "1")))
    parser.add_argument("--slow-disk", default=os.path.join(ROOT, "build/release/tests/siege/libsiege_slow_disk.so"),
                        help="library that makes the disk full (built with the tests)")
    parser.add_argument("--only", help="these kinds of the plan alone, with commas between; none: nothing happens")
    parser.add_argument("--report", help="JSON file to write")
    parser.add_argument("--keep", action="store_true", help="leave the folder with the log")
    options = parser.parse_args()
    if not os.path.exists(options.slow_disk):
        options.slow_disk = None
    folder = tempfile.mkdtemp(prefix="sightline_soak.")
    os.environ["XDG_CACHE_HOME"] = os.path.join(folder, "cache")
    os.environ["XDG_STATE_HOME"] = os.path.join(folder, "state")
    soak = None
    try:
        soak = Soak(options, folder)
        seen = soak.run()
        return 0 if seen and report(seen, options.report) else 1
    finally:
        if soak:
            soak.rig.close()
        if options.keep:
            print(f"left behind: {folder}")
        else:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
