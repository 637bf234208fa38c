#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The daemon with GigE Vision cameras: Aravis' simulated ones and the project's own, in a network namespace.

gige_test.py. Exits 77 where no namespace can be made. Waits are bounded; how long the daemon took to notice a loss and a
return is measured and printed, not asserted: that depends on the machine's load.
"""
import json
import os
import signal
import subprocess
import sys
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "gige"))
from gige import ADDRESSES, Lines, Simulator, enter_namespace  # noqa: E402
from support import BENCH, BIN, Daemon, TemporaryFolder, sightline, wait_until  # noqa: E402

SIMULATOR = os.path.join(BIN, "gige_simulator")
FAKE = "arv-fake-gv-camera-0.8"
NAMES = ("left", "right", "side")


class FakeCamera:
    """Aravis' simulated camera."""

    def __init__(self, index, serial=None):
        self.command = [FAKE, "-i", ADDRESSES[index], "-s", serial or f"GV{index}"]
        self.process = None
        self.start()

    def start(self):
        self.process = subprocess.Popen(self.command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)

    def signal(self, number):
        self.process.send_signal(number)

    def close(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
        self.process.wait(timeout=30)


class Rig(TemporaryFolder):
    def fake(self, index, serial=None):
        camera = FakeCamera(index, serial)
        self.addCleanup(camera.close)
        return camera

    def simulator(self, index, *options, **settings):
        camera = Simulator(SIMULATOR, ADDRESSES[index], "--serial", f"S{index}", *options, **settings)
        self.addCleanup(camera.close)
        return camera

    def installation(self, sources, keys="", extra=""):
        text = f'calibration = "{BENCH}/calibration.toml"\n'
        for name, source in zip(NAMES, sources):
            text += f'[[camera]]\nname = "{name}"\nsource = "aravis:{source}"\nrate = 20\n{keys}'
        return text + extra + "[rtsp]\nport = 0\n[http]\nport = 0\n"

    def daemon(self, text):
        daemon = Daemon(self.folder, self.write("rig.toml", text))
        self.addCleanup(daemon.close)
        daemon.wait_for_word("READY=1")
        return daemon

    @staticmethod
    def camera(daemon, name):
        return next(camera for camera in daemon.state()["cameras"] if camera["name"] == name)

    def wait_for_frames(self, daemon, name, count=10):
        frames = self.camera(daemon, name)["frames"]
        wait_until(lambda: self.camera(daemon, name)["present"] and self.camera(daemon, name)["frames"] >= frames + count,
                   f"frames come from {name}")

    def lost(self, daemon, name):
        return daemon.metric("sightline_frames_dropped_total", camera=name, stage="capture")

    def seconds_until(self, condition, what):
        start = time.monotonic()
        end = start + 60
        while not condition():
            self.assertLess(time.monotonic(), end, f"never: {what}")
            time.sleep(0.02)
        return time.monotonic() - start

    @staticmethod
    def attempts(daemon, name):
        """How often its source could not be opened or was given up."""
        return sum(daemon.find_metric("sightline_source_lost_total", camera=name, cause=cause) or 0
                   for cause in ("absent", "gone", "silent", "damaged", "mismatch"))

    def leave_and_return(self, daemon, away, back, name):
        """How long the loss and the return took to be noticed."""
        before = self.camera(daemon, name)["frames"]
        away()
        noticed = self.seconds_until(lambda: not self.camera(daemon, name)["present"], "the loss is reported")
        wait_until(lambda: "problem" in self.camera(daemon, name), "the reason is given")
        attempts = self.attempts(daemon, name)
        wait_until(lambda: self.attempts(daemon, name) >= attempts + 2, "it is tried again")
        back()
        returned = self.seconds_until(lambda: self.camera(daemon, name)["present"] and
                                      self.camera(daemon, name)["frames"] > before, "it comes back")
        self.wait_for_frames(daemon, name)
        return noticed, returned


class Gige(Rig):
    def test_three_cameras_one_hangs_and_one_dies(self):
        cameras = [self.fake(i) for i in range(3)]
        daemon = self.daemon(self.installation([ADDRESSES[0], ADDRESSES[1], ADDRESSES[2]], "packet_size = 1400\n"))
        for name in NAMES:
            self.wait_for_frames(daemon, name)
        lost = {name: self.lost(daemon, name) for name in NAMES[1:]}
        opened = {name: daemon.metric("sightline_source_opened_total", camera=name) for name in NAMES[1:]}
        hang = self.leave_and_return(daemon, lambda: cameras[0].signal(signal.SIGSTOP),
                                     lambda: cameras[0].signal(signal.SIGCONT), "left")
        death = self.leave_and_return(daemon, cameras[0].close, cameras[0].start, "left")
        print(f"\nhanging camera: reported after {hang[0]:.2f} s, back {hang[1]:.2f} s after it ran on; killed: "
              f"{death[0]:.2f} s, {death[1]:.2f} s", file=sys.stderr)
        for name in NAMES[1:]:
            self.assertEqual(self.lost(daemon, name), lost[name], f"{name} lost frames meanwhile")
            self.assertEqual(daemon.metric("sightline_source_opened_total", camera=name), opened[name])
        self.assertEqual(daemon.stop(), 0)

    def test_a_camera_of_somebody_else_is_named_and_taken_when_free(self):
        self.simulator(0)
        other = Lines(["stdbuf", "-oL", "arv-camera-test-0.8", "-n", ADDRESSES[0]])
        self.addCleanup(other.close)
        other.wait_for(lambda line: "frame" in line.lower(), "that it has the camera")
        daemon = self.daemon(self.installation([ADDRESSES[0]]))
        wait_until(lambda: "controlled by another client" in self.camera(daemon, "left").get("problem", ""),
                   "the reason is named")
        other.close()
        self.wait_for_frames(daemon, "left")
        self.assertEqual(daemon.stop(), 0)

    def test_another_camera_at_the_same_place_is_a_mismatch(self):
        first = self.simulator(0)
        daemon = self.daemon(self.installation([ADDRESSES[0]]))
        self.wait_for_frames(daemon, "left")
        first.close()
        second = Simulator(SIMULATOR, ADDRESSES[0], "--serial", "OTHER")
        self.addCleanup(second.close)
        wait_until(lambda: "another camera answers" in self.camera(daemon, "left").get("problem", ""), "the mismatch")
        frames = self.camera(daemon, "left")["frames"]
        attempts = self.attempts(daemon, "left")
        wait_until(lambda: self.attempts(daemon, "left") >= attempts + 2, "it is tried again")
        self.assertEqual(self.camera(daemon, "left")["frames"], frames)
        self.assertGreater(daemon.metric("sightline_source_lost_total", camera="left", cause="mismatch"), 0)
        second.close()
        self.simulator(0)
        self.wait_for_frames(daemon, "left")
        self.assertEqual(daemon.stop(), 0)

    def test_loss_reordering_and_delay_are_counted(self):
        self.simulator(0, loss=0.001)
        self.simulator(1, reorder=0.05, reorder_us=3000, delay_us=15000, jitter_us=2000)
        self.simulator(2, loss=0.005, resend=0)
        daemon = self.daemon(self.installation(ADDRESSES[:3], "packet_size = 1400\n"))
        for name in NAMES:
            self.wait_for_frames(daemon, name, 60)

        def count(name, cause):
            return daemon.metric("sightline_capture_events_total", camera=name, cause=cause)
        wait_until(lambda: count("left", "resent_packets") > 0, "packets are sent again")
        wait_until(lambda: count("side", "incomplete") > 5, "incomplete frames are counted")
        wait_until(lambda: self.lost(daemon, "side") > 5, "and are missing in the stream")
        self.assertEqual(daemon.metric("sightline_frames_damaged_total", camera="side"), 0)
        for name in NAMES:
            self.assertGreater(daemon.metric("sightline_clock_bound_seconds", camera=name), 0)
        self.assertEqual(daemon.stop(), 0)

    def test_action_commands_trigger_all_cameras(self):
        cameras = [self.simulator(i) for i in range(2)]
        daemon = self.daemon(self.installation(ADDRESSES[:2], 'trigger = "Action1"\n',
                                               '[action]\nrate = 10\naddress = "127.255.255.255"\n'))
        for name in NAMES[:2]:
            self.wait_for_frames(daemon, name, 20)
        self.assertGreater(daemon.metric("sightline_actions_total"), 20)
        self.assertEqual(daemon.stop(), 0)
        self.assertEqual(len(cameras), 2)


class Sync(Rig):
    def sync(self, *arguments, config=None):
        extra = ("--config", config) if config else ()
        out, _ = sightline("cameras", "--sync", *arguments, "--seconds", "6", "--json", *extra)
        return json.loads(out)

    def truth(self):
        """Phase between the two simulators' records when the first of them stopped, in milliseconds."""
        starts = []
        for name in ("a.txt", "b.txt"):
            with open(self.path(name), encoding="utf-8") as file:
                starts.append([int(line.split()[3]) for line in file.read().splitlines()])
        end = min(starts[0][-1], starts[1][-1])
        last = max(start for start in starts[0] if start < end)
        return min((start - last for start in starts[1]), key=abs) / 1e6

    def pair(self, *b_options):
        self.simulator(0, "--truth", self.path("a.txt"))
        self.simulator(1, "--truth", self.path("b.txt"), *b_options)

    def test_phase_and_drift_of_free_cameras(self):
        self.pair("--phase-ms", 7, "--drift-ppm", 500)
        report = self.sync(f"aravis:{ADDRESSES[0]}", f"aravis:{ADDRESSES[1]}")
        truth = self.truth()
        self.assertLess(abs(report["phase_ms"] - truth), report["phase_error_ms"] + 0.3)
        self.assertLess(abs(report["drift_us_per_s"] + 500), report["drift_error_us_per_s"])
        # A busy machine widens the bounds, and then it does not claim what it cannot know.
        known = abs(report["drift_us_per_s"]) > report["drift_error_us_per_s"]
        self.assertEqual(report["verdict"] == "drifting", known)
        self.assertIn("run freely", " ".join(report["advice"]))
        print(f"\nsync: phase {report['phase_ms']:.3f} ms (+-{report['phase_error_ms']:.3f}), truth "
              f"{truth:.3f}; drift {report['drift_us_per_s']:.1f} us/s "
              f"(+-{report['drift_error_us_per_s']:.1f}), truth -500", file=sys.stderr)
        out, _ = sightline("cameras", "--sync", f"aravis:{ADDRESSES[0]}", f"aravis:{ADDRESSES[1]}", "--seconds", "2")
        self.assertIn("phase", out)

    def test_hardware_trigger_and_what_is_missing(self):
        self.simulator(0, "--line1-hz", 20)
        second = self.simulator(1, "--line1-hz", 20)
        config = self.write("rig.toml", self.installation(ADDRESSES[:2], 'trigger = "Line1"\n'))
        report = self.sync("left", "right", config=config)
        self.assertLess(abs(report["phase_ms"]), report["phase_error_ms"] + 0.05)
        self.assertEqual(report["verdict"], "locked")
        self.assertIn("triggered on Line1", " ".join(report["advice"]))
        second.close()
        self.simulator(1)  # nothing comes over its line
        report = self.sync("left", "right", config=config)
        self.assertIn("check the wire", " ".join(report["advice"]))
        self.assertEqual(report["verdict"], "unknown")

    def test_ptp_and_what_is_missing(self):
        self.simulator(0, "--drift-ppm", 40)
        second = self.simulator(1, "--phase-ms", 3)
        config = self.write("rig.toml", self.installation(ADDRESSES[:2], "ptp = true\n"))
        report = self.sync("left", "right", config=config)
        self.assertEqual(report["clock"], "ptp")
        self.assertLess(report["phase_error_ms"], 0.01)
        self.assertLess(abs(report["phase_ms"] - 3), 1.0)
        self.assertIn("PTP makes the clocks agree, not the exposures", " ".join(report["advice"]))
        second.close()
        self.simulator(1, "--no-ptp-master")
        report = self.sync("left", "right", config=config)
        self.assertIn("the master itself", " ".join(report["advice"]))

    def test_absent_cameras(self):
        _, err = sightline("cameras", "--sync", "aravis:127.0.0.9", "aravis:127.0.0.8", status=3)
        self.assertIn("no camera answers", err)
        sightline("cameras", "--sync", "aravis:127.0.0.9", status=2)


if __name__ == "__main__":
    if not os.path.exists(SIMULATOR):
        print("skipped: built without the simulator")
        sys.exit(77)
    enter_namespace(FAKE, "arv-camera-test-0.8")
    unittest.main(verbosity=2)
