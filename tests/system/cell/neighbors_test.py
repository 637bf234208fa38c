#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Two cells, two brokers that bridge, an object that goes from one to the other and back: one name, one cell that publishes
it at a time, no frame without. What happens when the other cell's fusion host or broker dies. Figures are printed."""
import json
import math
import os
import shutil
import signal
import statistics
import subprocess
import sys
import time
import tomllib
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "page"))
from browser import Browser, chromium  # noqa: E402
from cell_support import BENCH, MOSQUITTO, encode, missing  # noqa: E402
from neighbor_support import NeighborsCase, Truth  # noqa: E402
from support import BIN, WAIT_S, read_text, sightline, wait_until  # noqa: E402

FRAME_NS = 33_333_333
POSED = ("tracking", "degraded", "coasting")


def handovers(tracks):
    """Pairs of estimates, one after the other in time, of two cells; both with a pose."""
    rows = sorted(tracks, key=lambda track: track.utc_ns)
    return [(a, b) for a, b in zip(rows, rows[1:]) if a.cell != b.cell and a.place and b.place]


class Neighbors(NeighborsCase):
    @staticmethod
    def faults(daemon):
        """What a host refused. While bridges connect, estimates may come before the word of who makes them (foreign)."""
        return {(kind, fault): daemon.metric("sightline_cell_messages_total", kind=kind, verdict=fault)
                for kind in ("observation", "track", "bid")
                for fault in ("duplicate", "old_boot", "foreign", "calibration", "malformed", "future")}

    def test_an_object_crosses(self):
        self.both_cells()
        for cell in (0, 1):
            for daemon in self.fusions:
                self.wait_for_keeper(daemon, cell)
        before = [self.faults(daemon) for daemon in self.fusions]
        heard = [self.listen(cell) for cell in (0, 1)]
        drawn = [set(), set()]
        end = time.monotonic() + 20
        while time.monotonic() < end:  # whoever has it, both cells' camera hosts have it to draw
            for cell, daemon in enumerate(self.cameras):
                drawn[cell].add((self.keeper(daemon), daemon.state()["objects"][0]["state"]))
            time.sleep(0.05)
        for cell in (0, 1):
            self.assertEqual({keeper for keeper, state in drawn[cell] if state in ("tracking", "degraded")}, set(self.CELLS))
        for listener in heard:
            self.check_crossings([t for t in listener.tracks if t.state in POSED])
        self.assertEqual([self.faults(daemon) for daemon in self.fusions], before)
        for daemon in self.fusions:
            self.assertGreater(daemon.metric("sightline_cell_handovers_total"), 4)
            self.assertGreater(daemon.metric("sightline_latency_seconds_count", camera="side", stage="fused"), 10,
                               "both fuse the camera at the border")
        wait_until(lambda: sum(daemon.metric("sightline_cell_adopted_total") for daemon in self.fusions) > 0,
                   "a cell begins with what the other one knows")

    def check_crossings(self, tracks):
        """As somebody sees them who listens at one broker."""
        changes = handovers(tracks)
        self.assertGreater(len(changes), 4)
        by_time = {}
        for track in tracks:
            if track.state != "coasting":
                by_time.setdefault(track.utc_ns, set()).add(track.cell)
        double = sum(len(cells) > 1 for cells in by_time.values())
        gaps = [max(0, round((b.utc_ns - a.utc_ns) / FRAME_NS) - 1) for a, b in changes]
        truth = Truth(self.recording)
        found = [(truth.jump((a.utc_ns, a.place), (b.utc_ns, b.place)), math.hypot(a.sigma, b.sigma)) for a, b in changes]
        jumps = [jump for jump, _ in found if jump is not None]
        shares = [jump / sigma for jump, sigma in found if jump is not None]
        print(f"figure: {len(changes)} hand-overs, published twice: {double} of {len(by_time)} frames, frames missing: "
              f"{sum(gaps)}, jump of the error [mm] p50 {1e3 * statistics.median(jumps):.2f}, max {1e3 * max(jumps):.2f}, in "
              f"sigmas p50 {statistics.median(shares):.2f}, max {max(shares):.2f} ({len(jumps)} away from the turn)", flush=True)
        self.assertLessEqual(double, len(by_time) // 50)
        self.assertLessEqual(statistics.median(gaps), 0)
        self.assertLess(statistics.median(jumps), 0.02)

    def test_a_host_that_does_both_has_the_border_camera(self):
        for cell in (0, 1):
            self.start_broker(cell)
        both = self.start_host(0, "both")
        fusion, cameras = self.start_host(1, "fusion"), self.start_host(1)
        for daemon in (both, fusion, cameras):
            for cell in (0, 1):
                self.wait_for_keeper(daemon, cell)
        before = self.faults(both)
        wait_until(lambda: fusion.metric("sightline_latency_seconds_count", camera="side", stage="fused") > 10,
                   "its observations reach the neighbor")
        seen = set()
        wait_until(lambda: seen.update({self.keeper(both)} if self.object_state(both) == "tracking" else ()) or
                   seen == set(self.CELLS), "it shows the object, whoever has it")
        self.assertEqual(self.faults(both), before)

    def test_page_and_status_show_the_cell(self):
        self.both_cells()
        config = os.path.join(os.path.dirname(self.cameras[0].log_path), "sightline.toml")
        wait_until(lambda: self.status_of(config)["neighbors"][0]["objects"], "the neighbor's bids are heard")
        status = self.status_of(config)
        self.assertEqual((status["neighbors"][0]["cell"], status["neighbors"][0]["fusion"]), ("site/b", "f"))
        self.assertTrue(all(not camera["away"] for host in status["hosts"] for camera in host["cameras"]), status)
        if not chromium():
            self.skipTest("no Chromium")
        browser = Browser()
        self.addCleanup(browser.close)
        browser.go(f"http://127.0.0.1:{self.cameras[0].http}/")
        text = "document.getElementById('cell').innerText"
        browser.wait_for(f"{text}.includes('keeps the estimates') && {text}.includes('next: site/b')", "the page shows the cell")
        said = browser.run(text)
        for host in status["hosts"]:
            self.assertIn(host["host"], said)
        self.assertIn("this host", said)
        if os.environ.get("SIGHTLINE_SCREENSHOTS"):
            browser.screenshot(os.path.join(os.environ["SIGHTLINE_SCREENSHOTS"], "cell.png"), whole=True)
        browser.go(f"http://127.0.0.1:{self.cameras[0].http}/?camera=side")  # as another host's page links to it
        browser.wait_for("!document.getElementById('all').hidden", "the camera is shown large")
        self.assertEqual(browser.problems, [])

    @staticmethod
    def status_of(config):
        """What `sightline cell status` says; something may be missing yet."""
        done = subprocess.run([os.path.join(BIN, "sightline"), "cell", "status", "--config", config, "--json"],
                              capture_output=True, text=True, timeout=WAIT_S, check=False)
        return json.loads(done.stdout)

    def test_the_keepers_fusion_host_dies(self):
        self.both_cells()
        self.wait_for_keeper(self.fusions[0], 1)
        heard = self.listen(0)
        self.fusions[1].process.send_signal(signal.SIGKILL)
        self.fusions[1].process.wait(timeout=WAIT_S)
        begin = time.monotonic()
        self.wait_for_keeper(self.fusions[0], 0)
        print(f"figure: the other cell took over {time.monotonic() - begin:.2f} s after the fusion host died", flush=True)
        # What cell b's camera host draws comes from the neighbor now.
        wait_until(lambda: self.cameras[1].state()["objects"][0]["state"] in POSED and
                   self.keeper(self.cameras[1]) == "site/a", "b draws what a publishes")
        self.assertEqual(self.cameras[1].state()["cell"]["fusion"], "")
        self.fusions[1] = self.start_host(1, "fusion")
        self.wait_for_keeper(self.fusions[0], 1)  # it is given back where b sees it better
        terms = [track.term for track in heard.tracks]
        self.assertEqual(terms, sorted(terms), "who had it before is not heard again")

    def test_the_neighbors_broker_dies(self):
        self.both_cells()
        self.wait_for_keeper(self.fusions[0], 1)
        self.brokers[1].kill()
        self.brokers[1].wait(timeout=WAIT_S)
        begin = time.monotonic()
        self.wait_for_keeper(self.fusions[0], 0)
        print(f"figure: the other cell took over {time.monotonic() - begin:.2f} s after the broker died", flush=True)
        self.wait_for_state(self.cameras[0], "tracking", "degraded")
        wait_until(lambda: not self.fusions[1].state()["cell"]["connected"], "b is alone")
        self.start_broker(1)
        for daemon in self.fusions + self.cameras:
            for cell in (0, 1):  # both agree again, to and fro
                self.wait_for_keeper(daemon, cell)

    def test_a_network_that_is_cut_between_the_cells(self):
        self.both_cells()
        self.wait_for_keeper(self.fusions[0], 0)
        before = self.fusions[0].metric("sightline_cell_handovers_total")
        # Cell b's broker goes on without the bridge of a's: the two cells do not hear each other.
        self.brokers[0].send_signal(signal.SIGSTOP)
        try:
            self.wait_for_keeper(self.fusions[1], 1)
            time.sleep(3)
            self.assertEqual(self.keeper(self.fusions[1]), "site/b")
        finally:
            self.brokers[0].send_signal(signal.SIGCONT)
        wait_until(lambda: self.keeper(self.fusions[0]) == self.keeper(self.fusions[1]) != "", "they agree")
        wait_until(lambda: self.fusions[0].metric("sightline_cell_handovers_total") > before + 2, "it goes to and fro again")

    def test_what_is_not_the_neighbors_is_refused(self):
        self.both_cells()
        wait_until(lambda: self.fusions[0].metric("sightline_cell_messages_total", kind="bid", verdict="taken") > 5, "bids come")
        self.port = self.ports[0]
        now = time.time_ns()
        bid = f'version: 1 object: "carton" host: "f" boot: 7 sequence: 1 time_utc_ns: {now} holds: true term: {now + 10**12}'
        self.publish("site/b/bid/carton", encode("Bid", bid))  # of a daemon that does not keep site/b's estimates
        self.publish("site/b/bid/carton", b"nonsense")
        self.publish("site/b/track/carton", b"nonsense")
        self.publish("site/b/cam/side/obs/carton", b"nonsense")

        def count(kind, verdict):
            return self.fusions[0].metric("sightline_cell_messages_total", kind=kind, verdict=verdict)
        for kind, verdict in (("bid", "foreign"), ("bid", "malformed"), ("track", "malformed")):
            wait_until(lambda k=kind, v=verdict: count(k, v) == 1, f"the {kind} is {verdict}")
        for cell in (0, 1):
            self.wait_for_keeper(self.fusions[0], cell)


class Init(NeighborsCase):
    """Two cells as `sightline cell init` makes them, certificates, access lists and bridges included."""

    def init(self, cell, *more, status=0):
        other = 1 - cell
        folder = self.path(f"rig{cell}")
        if not os.path.exists(folder):
            shutil.copytree(os.path.join(BENCH, "objects"), os.path.join(folder, "objects"))
            shutil.copy(os.path.join(BENCH, "calibration.toml"), folder)
        text = f'name = "rig"\ncalibration = "calibration.toml"\n[cell]\nneighbors = ["{self.CELLS[other]}"]\n'
        for camera, owner in self.cell_of.items():
            if owner != cell and camera not in self.border:
                continue
            text += f'[[camera]]\nname = "{camera}"\nhost = "{self.host_of(owner)}"\n'
            text += (f'source = "replay:{self.recording}"\nin_step = true\n' if owner == cell
                     else f'cell = "{self.CELLS[owner]}"\n')
        text += '[[object]]\nfile = "objects/carton.toml"\n[rtsp]\nport = 0\n[http]\nport = 0\n'
        config = self.write(os.path.join(folder, "rig.toml"), text)
        out = self.path(f"out{cell}")
        _, err = sightline("cell", "init", out, "--config", config, "--name", self.CELLS[cell], "--fusion", "f", "--broker",
                           "127.0.0.1", "--port", str(self.ports[cell]), "--broker-folder", os.path.join(out, "broker"), *more,
                           status=status)
        return out, err

    def test_two_cells_run_with_what_was_written(self):
        outs = [self.init(cell, "--neighbor", f"{self.CELLS[1 - cell]}=127.0.0.1:{self.ports[1 - cell]}")[0]
                for cell in (0, 1)]
        names = [cell.replace("/", "_") for cell in self.CELLS]
        for cell in (0, 1):  # each brings the other one's broker what that may read here
            shutil.copytree(os.path.join(outs[cell], "neighbors", names[1 - cell]),
                            os.path.join(outs[1 - cell], "broker", names[cell]))
        for cell, out in enumerate(outs):
            config = self.write(f"main{cell}.conf", f"user root\ninclude_dir {os.path.join(out, 'broker')}\n")
            broker = subprocess.Popen([MOSQUITTO, "-c", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.addCleanup(broker.wait, timeout=WAIT_S)
            self.addCleanup(broker.kill)
        daemons = []
        for cell, out in enumerate(outs):
            for host, role in (("f", "fusion"), (self.host_of(cell), "cameras")):
                written = os.path.join(out, "hosts", host, "sightline.toml")
                folder = self.path(f"run{len(os.listdir(self.folder))}")
                os.mkdir(folder)
                daemon = self.started(folder, written)
                self.assertEqual(tomllib.loads(read_text(written))["cell"]["role"], role)
                daemons.append(daemon)
        for cell in (0, 1):
            for daemon in daemons:
                self.wait_for_keeper(daemon, cell)
        wait_until(lambda: daemons[2].metric("sightline_cell_messages_total", kind="observation", verdict="taken") > 10,
                   "b takes observations")
        # The neighbor's broker may read, and nothing else.
        folder = os.path.join(outs[0], "neighbors", names[1])
        who = ["-h", "127.0.0.1", "-p", str(self.ports[0]), "--cafile", f"{folder}/ca.pem", "--cert", f"{folder}/bridge.pem",
               "--key", f"{folder}/bridge.key", "-q", "1"]
        heard = subprocess.run(["mosquitto_sub", *who, "-t", "site/a/fusion", "-C", "1", "-W", "20"], timeout=WAIT_S,
                               capture_output=True, check=True)
        self.assertNotEqual(heard.stdout, b"")
        for topic in ("site/a/bid/carton", "site/a/cam/left/obs/carton", "site/b/bid/carton", "site/b/track/carton"):
            subprocess.run(["mosquitto_pub", *who, "-t", topic, "-m", "x"], timeout=WAIT_S, capture_output=True, check=False)
        time.sleep(1)
        for kind in ("bid", "observation", "track"):
            self.assertEqual(daemons[0].metric("sightline_cell_messages_total", kind=kind, verdict="malformed"), 0, kind)

    def test_wrong_usage(self):
        out, err = self.init(0, status=2)
        self.assertIn("where is the broker of site/b", err)
        for bad in ("site/b", "site/b=", "site/b=h:x", "site/b=h:70000", "a\nb=h", "site/#=h"):
            _, err = self.init(0, "--neighbor", bad, status=2)
            self.assertIn("write CELL=BROKER", err)
        _, err = self.init(0, "--neighbor", f"{self.CELLS[0]}=127.0.0.1", "--neighbor", f"{self.CELLS[1]}=127.0.0.1", status=2)
        self.assertIn("is this cell", err)
        self.assertFalse(os.path.exists(out))


if __name__ == "__main__":
    if missing():
        print("skipped: not installed: " + ", ".join(missing()))
        sys.exit(77)
    unittest.main(verbosity=2)
