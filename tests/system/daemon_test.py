#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The daemon as a process: service manager, reload, stop, viewers, faults. Real clients (ffmpeg, HTTP)."""
import os
import signal
import socket
import subprocess
import unittest

from support import BENCH, BIN, WAIT_S, DaemonCase, fixed_port, installation, read_text, wait_until


class Service(DaemonCase):
    def test_says_ready_feeds_the_watchdog_and_stops_on_sigterm(self):
        daemon = self.start(watchdog_us=10_000_000)
        daemon.wait_for_word("WATCHDOG=1", count=3)
        daemon.wait_for_word("STATUS=3 of 3 cameras")
        self.assertEqual(daemon.stop(), 0)
        self.assertIn("STOPPING=1", daemon.read_notifications())

    def test_stops_with_a_viewer_connected(self):
        daemon = self.start()
        viewer = daemon.pull("left", frames=100000)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 1, "the viewer plays")
        self.assertEqual(daemon.stop(), 0)
        viewer.wait(timeout=WAIT_S)

    def test_threads_are_named(self):
        daemon = self.start()
        tasks = f"/proc/{daemon.process.pid}/task"
        names = {read_text(f"{tasks}/{t}/comm").strip() for t in os.listdir(tasks)}
        self.assertLessEqual({"cap:left", "obs:left", "draw:left", "cap:side", "fuse", "rtsp"}, names)

    def test_observation_and_searches_give_way_to_streams(self):
        daemon = self.start()
        tasks = f"/proc/{daemon.process.pid}/task"

        def nice():
            """By the kernel's field 19, behind the name in brackets."""
            fields = {read_text(f"{tasks}/{t}/comm").strip(): read_text(f"{tasks}/{t}/stat").rsplit(")", 1)[1].split()
                      for t in os.listdir(tasks)}
            return {name: int(field[16]) for name, field in fields.items()}
        own = os.getpriority(os.PRIO_PROCESS, daemon.process.pid)
        wait_until(lambda: nice().get("points", own) > own, "the threads have run")
        seen = nice()
        for name in ("cap:left", "draw:left", "fuse", "rtsp"):
            self.assertEqual(seen[name], own, name)
        self.assertLess(own, seen["obs:left"])
        self.assertLessEqual(seen["obs:left"], seen.get("find", 19))
        self.assertLess(seen["obs:left"], seen["points"])

    def test_a_busy_port_is_named_and_ends_it(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            config = self.write("busy.toml", installation(port))
            done = subprocess.run([os.path.join(BIN, "sightlined"), "--config", config], capture_output=True,
                                  text=True, timeout=WAIT_S, check=False)
        self.assertIn(done.returncode, (1, 3))
        self.assertIn(str(port), done.stderr)

    def test_invalid_file_ends_it_with_2_before_anything_runs(self):
        config = self.write("bad.toml", installation() + "[overlya]\n")
        for extra in ([], ["--check"]):
            done = subprocess.run([os.path.join(BIN, "sightlined"), "--config", config, *extra], capture_output=True,
                                  text=True, timeout=WAIT_S, check=False)
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, r"bad\.toml:\d+:\d+: ")
            self.assertIn("overlya", done.stderr)

    def test_an_unsupervised_daemon_runs_as_well(self):
        config = self.write("plain.toml", installation())
        with open(self.path("plain.log"), "w", encoding="utf-8") as log:
            process = subprocess.Popen([os.path.join(BIN, "sightlined"), "--config", config], stderr=log)
        self.addCleanup(process.kill)
        wait_until(lambda: "/metrics" in read_text(self.path("plain.log")), "it names its addresses")
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=WAIT_S), 0)


class Streams(DaemonCase):
    def test_no_viewer_no_encoding(self):
        daemon = self.start()
        wait_until(lambda: daemon.metric("sightline_frames_total", camera="left") > 30, "frames come")
        self.assertEqual(daemon.metric("sightline_images_encoded_total", camera="left"), 0)
        self.assertEqual(daemon.pull("left").wait(timeout=WAIT_S), 0)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 0, "the viewer is gone")
        # Nothing is encoded any more, and the other cameras never were.
        wait_until(lambda: self.encoded_stands_still(daemon, "left"), "encoding stops")
        self.assertEqual(daemon.metric("sightline_images_encoded_total", camera="right"), 0)

    @staticmethod
    def encoded_stands_still(daemon, camera):
        before = daemon.metric("sightline_images_encoded_total", camera=camera)
        frames = daemon.metric("sightline_frames_total", camera=camera)
        wait_until(lambda: daemon.metric("sightline_frames_total", camera=camera) > frames + 10, "frames come")
        return daemon.metric("sightline_images_encoded_total", camera=camera) == before

    def test_all_streams_at_once_two_viewers_each(self):
        daemon = self.start()
        viewers = [daemon.pull(camera) for camera in ("left", "right", "side") for _ in range(2)]
        self.assertEqual([v.wait(timeout=WAIT_S) for v in viewers], [0] * 6)

    def test_a_killed_viewer_harms_nobody(self):
        daemon = self.start()
        doomed = daemon.pull("side", frames=100000)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="side") == 1, "the viewer plays")
        doomed.kill()
        doomed.wait(timeout=WAIT_S)
        self.assertEqual(daemon.pull("side").wait(timeout=WAIT_S), 0)
        self.assertEqual(daemon.get("/healthz").strip().split(" cameras")[0], "3 of 3")

    def test_a_virtual_camera_is_one_more_stream(self):
        daemon = self.start(installation(extra='[[virtual_camera]]\nname = "room"\nwidth = 640\nheight = 360\n'))
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the carton is tracked")
        self.assertEqual(daemon.metric("sightline_images_encoded_total", camera="room"), 0)
        self.assertEqual(daemon.pull("room").wait(timeout=WAIT_S), 0)

    def test_object_is_tracked_live_and_shown_in_the_state(self):
        daemon = self.start()
        wait_until(lambda: daemon.state()["objects"][0]["state"] == "tracking", "the carton is tracked")
        carton = daemon.state()["objects"][0]
        self.assertEqual(carton["name"], "carton")


class Reload(DaemonCase):
    def test_a_bad_file_changes_nothing(self):
        daemon = self.start()
        self.reload(daemon, installation() + "[rtps]\n")
        self.assertIn("reload refused", daemon.log_text())
        self.assertIn("rtps", daemon.log_text())
        self.assertEqual(daemon.pull("left").wait(timeout=WAIT_S), 0)

    def test_a_new_style_keeps_the_viewers(self):
        daemon = self.start()
        viewer = daemon.pull("side", frames=150)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="side") == 1, "the viewer plays")
        opened = daemon.metric("sightline_source_opened_total", camera="side")
        self.reload(daemon, installation(styles='["box3d", "axes", "wireframe", "trail"]'))
        self.assertEqual(viewer.wait(timeout=WAIT_S), 0)
        self.assertEqual(daemon.metric("sightline_source_opened_total", camera="side"), opened)

    def test_a_removed_camera_goes_and_the_others_stay(self):
        daemon = self.start()
        wait_until(lambda: daemon.metric("sightline_frames_total", camera="left") > 5, "frames come")
        opened = daemon.metric("sightline_source_opened_total", camera="left")
        self.reload(daemon, installation(cameras=("left", "right")))
        self.assertEqual([c["name"] for c in daemon.state()["cameras"]], ["left", "right"])
        self.assertEqual(daemon.metric("sightline_source_opened_total", camera="left"), opened)
        self.assertNotEqual(daemon.pull("side").wait(timeout=WAIT_S), 0)
        self.assertEqual(daemon.pull("left").wait(timeout=WAIT_S), 0)

    def test_a_view_comes_and_goes_and_the_cameras_stay(self):
        daemon = self.start()
        viewer = daemon.pull("left", frames=150)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 1, "the viewer plays")
        room = '[[virtual_camera]]\nname = "room"\nwidth = 640\nheight = 360\n'
        self.reload(daemon, installation(extra=room))
        self.assertEqual(daemon.pull("room").wait(timeout=WAIT_S), 0)
        self.reload(daemon, installation())
        self.assertNotEqual(daemon.pull("room").wait(timeout=WAIT_S), 0)
        self.assertEqual(viewer.wait(timeout=WAIT_S), 0)

    def test_a_new_port_moves_the_server(self):
        daemon = self.start()
        moved = fixed_port()
        self.reload(daemon, installation(moved))
        self.assertEqual(daemon.rtsp, moved)
        self.assertEqual(daemon.pull("right").wait(timeout=WAIT_S), 0)

    def test_a_taken_port_is_refused_and_nothing_stops(self):
        daemon = self.start()
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            self.reload(daemon, installation(taken.getsockname()[1]))
        self.assertIn("reload refused", daemon.log_text())
        self.assertEqual(daemon.pull("right").wait(timeout=WAIT_S), 0)

    def test_many_reloads_leave_threads_and_descriptors_flat(self):
        daemon = self.start()
        files = f"/proc/{daemon.process.pid}/fd"
        tasks = f"/proc/{daemon.process.pid}/task"
        texts = [installation(cameras=c) for c in (("left", "side"), ("left", "right", "side"))]
        for text in texts:
            self.reload(daemon, text)
        counts = len(os.listdir(files)), len(os.listdir(tasks))
        for _ in range(5):
            for text in texts:
                self.reload(daemon, text)
        self.assertLessEqual(len(os.listdir(files)), counts[0] + 3)
        self.assertLessEqual(len(os.listdir(tasks)), counts[1] + 3)


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    unittest.main(verbosity=2)
