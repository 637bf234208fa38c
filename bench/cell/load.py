#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What one fusion host takes: `load.py [--cameras N ...] [--rate HZ] [--seconds S]` starts a broker and a fusion host, has
cell_load send the observations of N simulated cameras, and prints the age of the tracks that come back, what was dropped,
and the CPU of both."""
import argparse
import json
import os
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tests", "system", "cell"))
from cell_support import BENCH, BIN, CellCase  # noqa: E402

CAMERA = """[[camera]]
name = "c{i}"
width = 640
height = 480
model = "brown_conrady"
fx = 600.0
fy = 600.0
cx = 320.0
cy = 240.0
distortion = [0.0, 0.0, 0.0, 0.0, 0.0]
world_from_camera = [[1.0, 0.0, 0.0, {x}], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
"""


def cpu_s(pid):
    with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Load(CellCase):
    def measure(self, cameras, rate, seconds):
        calibration = self.write("calibration.toml", "".join(CAMERA.format(i=i, x=0.1 * i) for i in range(cameras)))
        text = f'name = "load"\ncalibration = "{calibration}"\n'
        text += "".join(f'[[camera]]\nname = "c{i}"\nhost = "h{i % 8}"\n' for i in range(cameras))
        text += (f'[[object]]\nfile = "{BENCH}/objects/carton.toml"\n[rtsp]\nenabled = false\n[http]\nport = 0\n'
                 f'[cell]\nrole = "fusion"\nhost = "f"\nname = "site/cell"\nbroker = "127.0.0.1"\nport = {self.port}\n')
        self.text = lambda *_, **__: text
        broker = self.broker("max_queued_messages 10000\n")
        daemon = self.host("f", "fusion")
        command = [os.path.join(BIN, "cell_load"), daemon.process.args[-1], str(seconds), str(rate)]
        pids = {"fusion": daemon.process.pid, "broker": broker.pid}
        before = {name: cpu_s(pid) for name, pid in pids.items()}
        begin = time.monotonic()
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10 * seconds + 100)
        wall = time.monotonic() - begin
        row = json.loads(done.stdout)
        row.update({f"{name}_cpu": round((cpu_s(pid) - before[name]) / wall, 2) for name, pid in pids.items()})
        row.update({name: int(count) for name, count in self.verdicts(daemon).items()})
        row["overflow"] = int(daemon.metric("sightline_observations_dropped_total"))
        row["ring_late"] = int(daemon.metric("sightline_measurements_late_total", object="carton"))
        row["load"] = round(os.getloadavg()[0], 1)
        daemon.stop()
        broker.kill()
        broker.wait()
        return row


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", type=int, nargs="+", default=[4, 16, 64])
    parser.add_argument("--rate", type=float, default=60)
    parser.add_argument("--seconds", type=float, default=10)
    arguments = parser.parse_args()
    for cameras in arguments.cameras:
        case = Load()
        case.setUp()
        try:
            print(json.dumps(case.measure(cameras, arguments.rate, arguments.seconds)), flush=True)
        finally:
            case.doCleanups()


if __name__ == "__main__":
    main()
