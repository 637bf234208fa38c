#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Reload, start and stop of the daemon under strain: what did not change goes on, whatever the new file is."""
import itertools
import os
import re
import signal
import socket
import threading
import time
import unittest
import urllib.error

from support import BENCH, WAIT_S, Daemon, DaemonCase, installation, read_text, wait_until

# Reloads of the storm; the full one takes minutes.
STORM = int(os.environ.get("SIGHTLINE_STORM", "40"))
ROOM = '[[virtual_camera]]\nname = "room"\nwidth = 640\nheight = 360\n'


class ReloadCase(DaemonCase):
    def text(self, **options):
        return installation(**options)

    def cameras(self, daemon):
        return [camera["name"] for camera in daemon.state()["cameras"]]

    def opened(self, daemon, camera):
        return daemon.metric("sightline_source_opened_total", camera=camera)


class WhatChanges(ReloadCase):
    def test_a_camera_comes_goes_and_comes_again(self):
        daemon = self.start(self.text(cameras=("left", "right")))
        viewer = daemon.pull("left", frames=100000)
        self.addCleanup(viewer.kill)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 1, "the viewer plays")
        both = '["outline", "label", "box3d"]'
        for cameras, styles in ((("left", "right", "side"), None), (("left", "right"), None), (("left", "right"), both),
                                (("left", "right", "side"), both)):
            options = {"styles": styles} if styles else {}
            self.assertTrue(self.reload(daemon, self.text(cameras=cameras, **options)), daemon.log_text())
            self.assertEqual(self.cameras(daemon), list(cameras))
        self.assertEqual(daemon.pull("side").wait(timeout=WAIT_S), 0)
        self.assertEqual(self.opened(daemon, "left"), 1)
        self.assertEqual(daemon.metric("sightline_viewers", camera="left"), 1)
        self.assertIsNone(viewer.poll())

    def test_an_object_goes_and_cameras_and_viewers_stay(self):
        daemon = self.start()
        viewer = daemon.pull("left", frames=100000)
        self.addCleanup(viewer.kill)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 1, "the viewer plays")
        without = re.sub(r"\[\[object\]\]\nfile = .*\n", "", self.text())
        self.assertTrue(self.reload(daemon, without))
        self.assertEqual(daemon.state()["objects"], [])
        self.assertNotIn('object="carton"', daemon.get("/metrics"))
        self.assertTrue(self.reload(daemon, self.text()))
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the carton is tracked again")
        self.assertEqual(self.opened(daemon, "left"), 1)
        self.assertIsNone(viewer.poll())

    def test_a_camera_that_is_not_streamed_any_more_and_is_again(self):
        daemon = self.start()
        silent = self.text().replace('name = "side"\n', 'name = "side"\nrole = "observe"\n')
        for text, served in ((silent, False), (self.text(), True)) * 2:
            self.assertTrue(self.reload(daemon, text), daemon.log_text())
            self.assertEqual(daemon.pull("side").wait(timeout=WAIT_S) == 0, served)
        self.assertNotIn("broke off", daemon.log_text())

    def test_nothing_is_left_of_a_file_that_is_refused(self):
        daemon = self.start()
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            self.assertFalse(self.reload(daemon, installation(rtsp=port, extra=ROOM)))
        self.assertNotIn('camera="room"', daemon.get("/metrics"))
        self.assertEqual(daemon.pull("left").wait(timeout=WAIT_S), 0)

    def test_metrics_of_a_removed_camera_go(self):
        daemon = self.start(self.text(extra=ROOM))
        self.assertEqual(daemon.pull("room").wait(timeout=WAIT_S), 0)
        self.assertTrue(self.reload(daemon, self.text(cameras=("left", "right"))))
        metrics = daemon.get("/metrics")
        self.assertNotIn('camera="side"', metrics)
        self.assertNotIn('camera="room"', metrics)
        self.assertIn('camera="left"', metrics)

    def test_an_object_goes_while_the_state_is_asked_and_recorded(self):
        record = f'[record]\nenabled = true\ndirectory = "{self.folder}"\n'
        daemon = self.start(self.text(extra=record))
        without = re.sub(r"\[\[object\]\]\nfile = .*\n", "", self.text(extra=record))
        done, answers = threading.Event(), []
        self.addCleanup(done.set)

        def ask():
            while not done.wait(0.1):
                try:
                    daemon.get("/healthz")
                    daemon.state()
                except urllib.error.HTTPError as refusal:  # a machine that is too busy, says 503
                    answers.append(refusal.read().decode())

        asking = threading.Thread(target=ask)
        asking.start()
        for text in (without, self.text(extra=record)) * 3:
            self.assertTrue(self.reload(daemon, text))
        done.set()
        asking.join()
        self.assertEqual([answer for answer in answers if "no progress" not in answer], [])
        print(f"answers of a machine that is too busy: {answers}")
        self.assertEqual(daemon.stop(), 0)


class WhatIsRefused(ReloadCase):
    def test_the_state_says_which_file_is_in_force_and_why_not_the_newest(self):
        daemon = self.start()
        in_force = daemon.state()["config"]
        self.assertEqual(in_force["file"], self.config)
        self.assertFalse(self.reload(daemon, self.text() + "[rtps]\n"))
        config = daemon.state()["config"]
        self.assertEqual(config["content"], in_force["content"])
        self.assertIn("rtps", config["refused"]["problem"])
        self.assertIn("refused", daemon.get("/healthz"))
        self.assertEqual(daemon.metric("sightline_config_refused"), 1)
        self.assertTrue(self.reload(daemon, self.text()))
        self.assertEqual(daemon.metric("sightline_config_refused"), 0)

    def damaged(self):
        """Texts that name files which no reader may fall over."""
        with open(self.path("riff.webp"), "wb") as file:
            file.write(b"RIFF")
        with open(self.path("huge.png"), "wb") as file:
            try:
                file.truncate(8 << 40)
            except OSError:
                file.truncate(1 << 40)
        depth = '\nscene_depth = "{}"\n'
        for name in ("riff.webp", "huge.png"):
            yield self.text().replace('source = "replay', depth.format(self.path(name)).lstrip() + 'source = "replay', 1)
        self.write("deep.toml", "[" + ".".join(["a"] * 35000) + "]\n")
        yield self.text().replace(f'{BENCH}/objects/carton.toml', self.path("deep.toml"))

    def test_files_that_break_their_readers_are_refused(self):
        daemon = self.start()
        for text in self.damaged():
            self.assertFalse(self.reload(daemon, text), daemon.log_text())
            self.assertEqual(self.cameras(daemon), ["left", "right", "side"])
        self.assertEqual(daemon.pull("left").wait(timeout=WAIT_S), 0)
        self.assertEqual(self.opened(daemon, "left"), 1)


class Recording(ReloadCase):
    def record(self, directory):
        return f'[record]\nenabled = true\ndirectory = "{directory}"\n'

    def link(self, target):
        """The folder to record to leads elsewhere now."""
        link = self.path("recordings")
        if os.path.lexists(link):
            os.unlink(link)
        os.symlink(target, link)
        return link

    def test_streams_go_on_when_nothing_can_be_recorded(self):
        disk = self.path("disk")
        os.mkdir(disk)
        record = self.record(self.link(disk))
        daemon = self.start(self.text(extra=record))
        wait_until(lambda: daemon.metric("sightline_recording", state="recording") == 1, "it records")
        self.link("/proc")  # a disk without a free byte, for root too
        self.assertTrue(self.reload(daemon, self.text(extra=record + 'storage = "ffv1"\n')))
        wait_until(lambda: daemon.state()["recording"]["state"] == "stopped", "the state says it")
        self.assertIn("recording stopped", daemon.get("/healthz"))
        self.assertEqual(daemon.metric("sightline_recording", state="stopped"), 1)
        self.assertEqual(daemon.pull("left").wait(timeout=WAIT_S), 0)
        self.link(disk)
        wait_until(lambda: daemon.metric("sightline_recording", state="recording") == 1, "it records again")
        self.assertTrue(self.reload(daemon, self.text()))
        self.assertNotIn("recording", daemon.state())
        self.assertIsNone(daemon.find_metric("sightline_recording", state="recording"))
        self.assertEqual(daemon.stop(), 0)

    def test_it_starts_on_a_full_disk(self):
        daemon = self.start(self.text(extra=self.record("/proc")))
        wait_until(lambda: daemon.state()["recording"]["state"] == "stopped", "the state says it")
        self.assertIn("full", daemon.state()["recording"]["problem"])
        self.assertNotIn("unexpected", daemon.log_text())
        self.assertEqual(daemon.pull("left").wait(timeout=WAIT_S), 0)


class Stop(ReloadCase):
    def big_object(self):
        """An object whose shape takes long to load."""
        size = 260
        with open(self.path("big.off"), "w", encoding="utf-8") as file:
            file.write(f"OFF\n{size * size} {(size - 1) * (size - 1) * 2} 0\n")
            for y, x in itertools.product(range(size), range(size)):
                file.write(f"{x * 1e-3} {y * 1e-3} {((x * 7 + y * 13) % 29) * 1e-3}\n")
            for y, x in itertools.product(range(size - 1), range(size - 1)):
                a = y * size + x
                file.write(f"3 {a} {a + 1} {a + size}\n3 {a + 1} {a + size + 1} {a + size}\n")
        self.write("big.toml", 'name = "big"\nmesh = "big.off"\nunit = "m"\n')
        return self.text(extra=f'[[object]]\nfile = "{self.path("big.toml")}"\n')

    def terminate(self, daemon, when):
        start = time.monotonic()
        self.assertEqual(daemon.stop(), 0, daemon.log_text())
        print(f"stopped {when} in {time.monotonic() - start:.1f} s")
        self.assertRegex(daemon.log_text(), "stopped")

    def test_sigterm_while_it_starts(self):
        config = self.write("sightline.toml", self.big_object())
        daemon = Daemon(self.folder, config)
        self.addCleanup(daemon.close)
        # Its threads are named: this one reads the meshes.
        wait_until(lambda: "control" in self.threads(daemon), "it starts")
        self.terminate(daemon, "during start")

    def test_sigterm_while_it_reloads(self):
        daemon = self.start()
        self.write("sightline.toml", self.big_object())
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_word("RELOADING=1")
        daemon.wait_for_word("WATCHDOG=1")
        self.terminate(daemon, "during reload")

    @staticmethod
    def threads(daemon):
        tasks = f"/proc/{daemon.process.pid}/task"
        return {read_text(f"{tasks}/{task}/comm").strip() for task in os.listdir(tasks)}


class Storm(ReloadCase):
    """Valid, invalid and failing files in turn, under load."""

    def texts(self):
        room = {"extra": ROOM}
        failing = self.text().replace(f"{BENCH}/objects/carton.toml", self.path("nowhere.toml"))
        good = (self.text(), self.text(cameras=("left", "right")), self.text(**room),
                self.text(cameras=("left", "right"), **room),
                re.sub(r"\[\[object\]\]\nfile = .*\n", "", self.text(**room)))
        bad = (self.text() + "[rtps]\n", failing, "a = [", "")
        return zip(itertools.cycle(good), itertools.cycle(bad))

    @staticmethod
    def resident_mb(daemon):
        return int(re.search(r"VmRSS:\s+(\d+)", read_text(f"/proc/{daemon.process.pid}/status")).group(1)) / 1024

    @staticmethod
    def counts(daemon):
        return [len(os.listdir(f"/proc/{daemon.process.pid}/{kind}")) for kind in ("fd", "task")]

    def test_the_last_good_file_runs_and_nothing_else_is_touched(self):
        daemon = self.start()
        viewer = daemon.pull("left", frames=1000000)
        self.addCleanup(viewer.kill)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 1, "the viewer plays")
        done, failures = threading.Event(), []

        def ask():
            while not done.wait(0.1):
                try:
                    daemon.get("/healthz")
                    daemon.state()
                except (urllib.error.URLError, OSError, ValueError) as failure:
                    failures.append(failure)

        asking = threading.Thread(target=ask)
        asking.start()
        self.addCleanup(done.set)
        sizes = []
        for i, (good, bad) in zip(range(STORM // 2), self.texts()):
            self.assertTrue(self.reload(daemon, good), daemon.log_text()[-2000:])
            self.assertFalse(self.reload(daemon, bad))
            if i % 5 == 4:
                sizes.append((self.resident_mb(daemon), *self.counts(daemon)))
        self.assertTrue(self.reload(daemon, self.text()))
        done.set()
        asking.join()
        print(f"memory [MB], descriptors, threads after each 10 reloads: {sizes}")
        self.assertEqual(failures, [])
        self.assertEqual(self.cameras(daemon), ["left", "right", "side"])
        for camera in ("left", "right"):
            self.assertEqual(self.opened(daemon, camera), 1)
        self.assertIsNone(viewer.poll())
        self.assertLessEqual(sizes[-1][1], sizes[0][1] + 6)
        self.assertLessEqual(sizes[-1][2], sizes[0][2] + 6)
        self.assertEqual(daemon.stop(), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
