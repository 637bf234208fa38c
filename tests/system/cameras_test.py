#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightline cameras`, and a camera of the network that goes and comes back under a running daemon."""
import json
import subprocess
import unittest

from support import BENCH, Daemon, TemporaryFolder, fixed_port, installation, sightline, wait_until


class Cameras(TemporaryFolder):
    def test_lists_what_is_there(self):
        out, _ = sightline("cameras", "--json")
        listing = json.loads(out)
        for camera in listing["cameras"]:
            self.assertIn(":", camera["source"])
        self.assertIsInstance(listing["notes"], list)
        sightline("cameras")

    def test_tries_a_camera_of_an_installation(self):
        config = self.write("rig.toml", installation())
        png = self.path("left.png")
        out, _ = sightline("cameras", "--probe", "left", "--config", config, "--seconds", "1", "--save", png, "--json")
        report = json.loads(out)
        self.assertEqual((report["width"], report["height"]), (640, 480))
        self.assertGreater(report["frames"], 10)
        self.assertGreater(report["rate_hz"], 5)
        with open(png, "rb") as file:
            self.assertEqual(file.read(8), b"\x89PNG\r\n\x1a\n")

    def test_says_what_is_not_there(self):
        for source in ("v4l2:/dev/v4l/by-id/nothing", "aravis:127.0.0.99", f"rtsp://u:secret@127.0.0.1:{fixed_port()}/cam",
                       f"http://127.0.0.1:{fixed_port()}/cam"):
            _, err = sightline("cameras", "--probe", source, "--seconds", "1", status=3)
            self.assertTrue(err)
            self.assertNotIn("secret", err)
        sightline("cameras", "--probe", "nonsense", status=2)
        sightline("cameras", "--seconds", "3", status=2)


class Network(TemporaryFolder):
    """One daemon is the network camera of another."""

    def daemon(self, name, text):
        folder = self.path(name)
        subprocess.run(["mkdir", "-p", folder], check=True)
        daemon = Daemon(folder, self.write(f"{name}.toml", text))
        self.addCleanup(daemon.close)
        daemon.wait_for_word("READY=1")
        return daemon

    def test_a_camera_that_goes_and_comes_back(self):
        port = fixed_port()
        camera_text = installation(port, cameras=("left",))
        text = f'calibration = "{BENCH}/calibration.toml"\n'
        text += f'[[camera]]\nname = "left"\nsource = "rtsp://127.0.0.1:{port}/left"\nrate = 30\n'
        text += f'[[camera]]\nname = "right"\nsource = "replay:{BENCH}"\n'
        text += f"[rtsp]\nport = 0\n[http]\nport = 0\n"
        # Absent at the start: the stream is up all the same.
        rig = self.daemon("rig", text)
        wait_until(lambda: "problem" in self.left(rig), "it is reported absent, with the reason")
        self.assertIn("no_signal_since", self.left(rig))
        self.assertIn(f"rtsp://127.0.0.1:{port}/left", self.left(rig)["problem"])
        self.assertEqual(rig.pull("left", frames=3).wait(timeout=60), 0)
        # It comes.
        camera = self.daemon("camera", camera_text)
        wait_until(lambda: self.left(rig)["present"] and self.left(rig)["frames"] > 10, "it comes")
        self.assertNotIn("no_signal_since", self.left(rig))
        wait_until(lambda: self.left(rig)["capture_error_s"] == 0.01, "it tells its own times")
        # It is killed while somebody watches: the viewer stays, the other camera does not notice.
        viewer = rig.pull("left", frames=100000)
        wait_until(lambda: rig.metric("sightline_viewers", camera="left") == 1, "the viewer plays")
        lost = rig.metric("sightline_frames_dropped_total", camera="right", stage="capture")
        camera.process.kill()
        wait_until(lambda: not self.left(rig)["present"], "it is reported gone")
        encoded = rig.metric("sightline_images_encoded_total", camera="left")
        wait_until(lambda: rig.metric("sightline_images_encoded_total", camera="left") >= encoded + 3,
                   "the stream goes on")
        self.assertTrue(self.right(rig)["present"])
        self.assertEqual(rig.metric("sightline_camera_present", camera="left"), 0)
        # Away for some attempts to open it.
        def attempts():
            return sum(rig.find_metric("sightline_source_lost_total", camera="left", cause=cause) or 0
                       for cause in ("absent", "gone", "silent", "damaged"))
        before = attempts()
        wait_until(lambda: attempts() >= before + 2, "it is tried again")
        # And back, for the same viewer.
        self.daemon("camera", camera_text)
        frames = self.left(rig)["frames"]
        wait_until(lambda: self.left(rig)["present"] and self.left(rig)["frames"] > frames + 10, "it is back")
        self.assertIsNone(viewer.poll())
        viewer.kill()
        viewer.wait(timeout=60)
        self.assertEqual(rig.metric("sightline_frames_dropped_total", camera="right", stage="capture"), lost)
        self.assertEqual(rig.stop(), 0)

    @staticmethod
    def left(daemon):
        return daemon.state()["cameras"][0]

    @staticmethod
    def right(daemon):
        return daemon.state()["cameras"][1]


if __name__ == "__main__":
    unittest.main(verbosity=2)
