#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""One recording on one host and on three (two with cameras, one that keeps the estimates), live: `split.py [--seconds S]`
prints for each the error against the truth, the age of the poses when the broker's client has them, and what was dropped;
for three hosts also with slow links. The kernel here may have no netem, so links are proxies: `delay` holds every segment,
`stall` holds one segment in a hundred by 200 ms, as TCP does after a lost one."""
import argparse
import asyncio
import csv
import json
import math
import os
import random
import statistics
import subprocess
import sys
import threading
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tests", "system", "cell"))
from cell_support import BENCH, CellCase, free_port  # noqa: E402

JUMP_NS = 300_000_000  # at the begin of a turn the object jumps back: no motion that an estimator is made for


class Link:
    """A TCP proxy with delay; one per host."""

    def __init__(self, to_port, delay_s, stalls):
        self.to_port, self.delay_s, self.stalls, self.port = to_port, delay_s, stalls, free_port()
        self.chance = random.Random(17)
        self.loop = asyncio.new_event_loop()
        ready = threading.Event()
        threading.Thread(target=self.run, args=(ready,), daemon=True).start()
        ready.wait(10)

    def run(self, ready):
        asyncio.set_event_loop(self.loop)
        self.loop.run_until_complete(asyncio.start_server(self.serve, "127.0.0.1", self.port))
        ready.set()
        self.loop.run_forever()

    async def serve(self, reader, writer):
        to_reader, to_writer = await asyncio.open_connection("127.0.0.1", self.to_port)
        await asyncio.gather(self.carry(reader, to_writer), self.carry(to_reader, writer), return_exceptions=True)

    async def carry(self, reader, writer):
        queue = asyncio.Queue()

        async def deliver():
            while True:
                due, data = await queue.get()
                await asyncio.sleep(max(0.0, due - time.monotonic()))
                if not data:
                    return writer.close()
                writer.write(data)
        task = asyncio.ensure_future(deliver())
        last = 0.0
        while True:
            data = await reader.read(1448)
            due = time.monotonic() + self.delay_s + (0.2 if self.stalls and self.chance.random() < 0.01 else 0)
            last = max(last, due)  # in order, as TCP delivers
            await queue.put((last, data))
            if not data:
                return await task


class Recording:
    """What a recording's poses are compared with, by the time in its turn."""

    def __init__(self, folder):
        self.folder = folder
        with open(f"{folder}/truth.csv", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.object = rows[0]["object"]
        self.truth = [(int(r["t_ns"]), [float(r[k]) for k in ("tx", "ty", "tz")], [float(r[k]) for k in ("qw", "qx", "qy", "qz")])
                      for r in rows if r["object"] == self.object]
        frames = {}
        with open(f"{folder}/frames.csv", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                frames.setdefault(row["camera"], []).append(int(row["capture_ns"]))
        self.cameras = list(frames)
        self.first_ns = min(times[0] for times in frames.values())
        # As the replay does: each camera's last frame lasts as long as its frames do in the middle.
        self.turn_ns = max(t[-1] + statistics.median(b - a for a, b in zip(t, t[1:])) - self.first_ns for t in frames.values())

    def errors(self, pose):
        """mm, degrees and whether the object has just jumped; None between two truths."""
        turn_ns = pose["utc_ns"] % self.turn_ns
        t_ns, place, turn = min(self.truth, key=lambda row: abs(row[0] - self.first_ns - turn_ns))
        if abs(t_ns - self.first_ns - turn_ns) > 1_000_000:
            return None
        dot = abs(sum(a * b for a, b in zip(turn, pose["rotation_wxyz"])))
        return 1e3 * math.dist(place, pose["translation_m"]), math.degrees(2 * math.acos(min(1.0, dot))), turn_ns < JUMP_NS


def quantile(values, share):
    return sorted(values)[int(share * (len(values) - 1))] if values else float("nan")


class Split(CellCase):
    def play(self, played):
        self.played, self.recording, self.objects = played, played.folder, (played.object,)
        self.owners = {name: "b" if i else "a" for i, name in enumerate(played.cameras)}

    def listen(self, topic, seconds):
        """(arrival, pose) of that many seconds."""
        done = subprocess.run(["mosquitto_sub", "-h", "127.0.0.1", "-p", str(self.port), "-t", topic, "-R", "-W",
                               str(int(seconds)), "-F", "%U %p"], capture_output=True, text=True, check=False)
        for line in done.stdout.splitlines():
            stamp, text = line.split(" ", 1)
            yield float(stamp), json.loads(text)

    def measure(self, topic, seconds):
        time.sleep(6)  # the first turn: found, and backgrounds learned
        age, millimeters, degrees, states, wrong = [], [], [], {}, 0
        for arrival, pose in self.listen(topic, seconds):
            states[pose["state"]] = states.get(pose["state"], 0) + 1
            if "translation_m" not in pose:
                continue
            age.append(1e3 * (arrival - pose["utc_ns"] * 1e-9))
            off = self.played.errors(pose)
            if off is None or pose["state"] == "coasting":
                continue
            millimeters.append(off[0])
            degrees.append(off[1])
            wrong += pose["state"] == "tracking" and not off[2] and (off[0] > 20 or off[1] > 10)
        return {"rows": len(millimeters), "states": states, "mm_p50": round(quantile(millimeters, .5), 2),
                "mm_p95": round(quantile(millimeters, .95), 2), "deg_p50": round(quantile(degrees, .5), 2),
                "age_ms_p50": round(quantile(age, .5), 1), "age_ms_p99": round(quantile(age, .99), 1), "wrong": wrong}

    def mqtt(self, name):
        return f'[publish.mqtt]\nhost = "127.0.0.1"\nport = {self.port}\ntopic = "{name}"\n'

    def one_host(self, seconds):
        self.broker()
        self.host("one", "alone", extra=self.mqtt("one"))
        return self.measure(f"one/objects/{self.played.object}", seconds)

    def three_hosts(self, seconds, delay_s, stalls):
        self.broker()
        fusion = self.host("f", "fusion", extra=self.mqtt("f"))
        links = [Link(self.port, delay_s, stalls) for _ in "ab"] if delay_s or stalls else []
        for name, port in zip("ab", [link.port for link in links] or [None, None]):
            self.host(name, port=port, extra=self.mqtt(name))
        row = self.measure(f"f/objects/{self.played.object}", seconds)
        row.update({name: int(count) for name, count in self.verdicts(fusion).items()})
        row["ring_late"] = int(fusion.metric("sightline_measurements_late_total", object=self.played.object))
        return row


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--recording", default=BENCH)
    arguments = parser.parse_args()
    seconds = arguments.seconds
    runs = [("one host", lambda case: case.one_host(seconds))]
    for what, delay_s, stalls in (("three hosts", 0, False), ("three hosts, 5 ms", .005, False),
                                  ("three hosts, 20 ms", .02, False), ("three hosts, 5 ms, stalls", .005, True)):
        runs.append((what, lambda case, d=delay_s, s=stalls: case.three_hosts(seconds, d, s)))
    for what, run in runs:
        case = Split()
        case.setUp()
        case.play(Recording(os.path.abspath(arguments.recording)))
        try:
            print(json.dumps({"run": what, **run(case), "load": round(os.getloadavg()[0], 1)}), flush=True)
        finally:
            case.doCleanups()
    sys.stdout.flush()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    os._exit(0)  # the links' threads have nothing to finish


if __name__ == "__main__":
    main()
