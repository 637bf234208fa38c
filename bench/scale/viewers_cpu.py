#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""CPU time of a running sightlined for each frame: without viewers, with one and with several viewers by RTSP (TCP, UDP) and
by WebRTC (Chromium), and while it records. One camera of recordings/bench, 640x480 at 30 Hz, tracked and annotated, at the bit
rate of 720p. Viewers are other processes; what is counted is the daemon's own CPU time, not wall time, so that other
work on the machine shows as noise only. The ways take turns, and each difference is of neighboring measurements.

    bench/scale/viewers_cpu.py [--seconds 10] [--rounds 5] [--viewers 5] [--json] [--only rtsp_tcp,...]
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
sys.path[:0] = [os.path.join(ROOT, "tests", "system"), os.path.join(ROOT, "tests", "system", "page")]
from browser import Browser, chromium  # noqa: E402
from support import Daemon, installation, wait_until  # noqa: E402

KBPS = 4000
BUDGETS = {"rtsp_tcp": 0.05, "rtsp_udp": 0.05, "webrtc": 0.8}  # [ms] for each further viewer and frame
RECORD_BUDGET = 0.03
WATCH = """(async () => {
  window.peers = window.peers ?? [];
  const pc = new RTCPeerConnection();
  pc.addTransceiver('video', { direction: 'recvonly' });
  await pc.setLocalDescription();
  const answer = await fetch('/cameras/left/whep', { method: 'POST', headers: { 'Content-Type': 'application/sdp' },
    body: pc.localDescription.sdp });
  window.peers.push([pc, answer.headers.get('Location')]);
  await pc.setRemoteDescription({ type: 'answer', sdp: await answer.text() });
})()"""
LEAVE = "Promise.all((window.peers ?? []).splice(0).map(([pc, at]) => { pc.close(); return fetch(at, { method: 'DELETE' }); })).then(() => 0)"


class Rig:
    """The daemon, and who watches it."""

    def __init__(self, folder, seconds):
        os.mkdir(os.path.join(folder, "recordings"))
        config = os.path.join(folder, "sightline.toml")
        with open(config, "w", encoding="utf-8") as file:
            file.write(installation(cameras=("left",), extra=f'[encoder]\nbitrate_kbps = {KBPS}\n[points]\nenabled = false\n'
                                    f'[record]\ndirectory = "{folder}/recordings"\nquota_gb = 1\n'))
        self.daemon, self.seconds, self.players = Daemon(folder, config), seconds, []
        self.daemon.wait_for_word("READY=1")
        wait_until(lambda: "translation_m" in self.daemon.state()["objects"][0], "the object is tracked")
        self.browser = None

    def viewers(self):
        camera = self.daemon.state()["cameras"][0]
        return camera["viewers"] + camera["webrtc_viewers"]

    def watch(self, way, count):
        for _ in range(count):
            if way == "webrtc":
                if not self.browser:
                    self.browser = Browser()
                    self.browser.go(f"http://127.0.0.1:{self.daemon.http}/api/v1/version")
                self.browser.run(WATCH)
                continue
            self.players.append(subprocess.Popen(
                ["ffmpeg", "-nostdin", "-loglevel", "quiet", "-rtsp_transport", way.split("_")[1], "-i",
                 f"rtsp://127.0.0.1:{self.daemon.rtsp}/left", "-c", "copy", "-f", "null", "-"]))
        wait_until(lambda: self.viewers() == count, f"{count} watch")

    def leave(self):
        for player in self.players:
            player.terminate()
        for player in self.players:
            player.wait(timeout=20)
        self.players = []
        if self.browser:
            self.browser.run(LEAVE)
        wait_until(lambda: self.viewers() == 0, "nobody watches")

    def order(self, what, kind):
        request = urllib.request.Request(f"http://127.0.0.1:{self.daemon.http}/api/v1/recordings/{what}", method="POST",
                                         data=json.dumps({"kinds": [kind]}).encode(), headers={"Content-Type": "application/json"})
        urllib.request.urlopen(request, timeout=20).read()

    def cpu_ms(self):
        # The clock of another process's CPU time (clock_getcpuclockid(3) makes its number so).
        return time.clock_gettime((~self.daemon.process.pid << 3) | 2) * 1e3

    def frames(self):
        return self.daemon.metric("sightline_frames_total", camera="left")

    def encoded(self):
        return self.daemon.find_metric("sightline_images_encoded_total", camera="left") or 0

    def measure(self):
        """CPU milliseconds of the daemon for each frame of the camera, and how many of them were encoded."""
        time.sleep(1)
        cpu, frames, encoded = self.cpu_ms(), self.frames(), self.encoded()
        time.sleep(self.seconds)
        count = self.frames() - frames
        return (self.cpu_ms() - cpu) / count, (self.encoded() - encoded) / count

    def close(self):
        self.leave()
        if self.browser:
            self.browser.close()
        self.daemon.stop()
        self.daemon.close()


def measure_way(rig, way, count):
    """One and `count` viewers; the difference for each further one."""
    rig.watch(way, 1)
    one, _ = rig.measure()
    rig.leave()
    rig.watch(way, count)
    all_of_them, _ = rig.measure()
    rig.leave()
    return {"one": one, "many": all_of_them, "further": (all_of_them - one) / (count - 1)}


def measure_recording(rig, kind):
    """With one viewer, without and with a recording."""
    rig.watch("rtsp_tcp", 1)
    without, _ = rig.measure()
    rig.order("start", kind)
    recorded, _ = rig.measure()
    rig.order("stop", kind)
    rig.leave()
    return {"without": without, "with": recorded, "adds": recorded / without - 1}


def middle(rows):
    return {key: statistics.median(row[key] for row in rows) for key in rows[0]}


def run(options):
    ways = [way for way in BUDGETS if way != "webrtc" or chromium()]
    names = ["idle", *ways, "record_viewing", "record_poses", "record_source"]
    if options.only:
        names = [name for name in names if name in options.only.split(",")]
    rows = {name: [] for name in names}
    with tempfile.TemporaryDirectory(prefix="sightline_bench.") as folder:
        rig = Rig(folder, options.seconds)
        try:
            for _ in range(options.rounds):
                for name in names:
                    if name == "idle":
                        cpu, encoded = rig.measure()
                        rows[name].append({"cpu_ms": cpu, "encoded_share": encoded,
                                           "draw_s": rig.daemon.state()["cameras"][0]["draw_s"]})
                    elif name.startswith("record_"):
                        rows[name].append(measure_recording(rig, name[7:]))
                    else:
                        rows[name].append(measure_way(rig, name, options.viewers))
        finally:
            rig.close()
    return {name: {**middle(list_), "rounds": list_} for name, list_ in rows.items()}


def report(result, options):
    for name, row in result.items():
        if name == "idle":
            print(f"without viewers: {row['cpu_ms']:.2f} ms a frame, {row['encoded_share']:.0%} of the frames encoded, "
                  f"{row['draw_s']:.0f} s of drawing")
        elif name.startswith("record_"):
            low, high = (f(one["adds"] for one in row["rounds"]) for f in (min, max))
            print(f"{name[7:]} recording: {row['without']:.2f} -> {row['with']:.2f} ms, adds {row['adds']:+.1%} ({low:+.1%} .. {high:+.1%}); "
                  f"budget {RECORD_BUDGET:.0%}")
        else:
            low, high = (f(one["further"] for one in row["rounds"]) for f in (min, max))
            print(f"{name}: {row['one']:.2f} ms with one, {row['many']:.2f} with {options.viewers}; each further {row['further']:.3f} ms "
                  f"({low:.3f} .. {high:.3f}); budget {BUDGETS[name]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10, help="of each measurement")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--viewers", type=int, default=5)
    parser.add_argument("--only", default="", help="idle, rtsp_tcp, rtsp_udp, webrtc, record_viewing, record_poses, record_source")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    result = run(options)
    if options.json:
        print(json.dumps(result, indent=2))
    else:
        report(result, options)


if __name__ == "__main__":
    main()
