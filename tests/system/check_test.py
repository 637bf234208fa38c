#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`sightlined --check` loads what the configuration names: a file that is there but no good is found, and named."""
import os
import shutil
import subprocess
import unittest

from support import BENCH, BIN, WAIT_S, TemporaryFolder, sightline


class Check(TemporaryFolder):
    def setUp(self):
        super().setUp()
        shutil.copytree(BENCH, self.path("bench"))
        os.environ["XDG_CACHE_HOME"] = self.path("cache")

    def installation(self, camera="", extra=""):
        """Of a copy of the bundled recording, whose files may be damaged."""
        bench = self.path("bench")
        text = f'calibration = "{bench}/calibration.toml"\n'
        for name in ("left", "right"):
            text += f'[[camera]]\nname = "{name}"\nsource = "replay:{bench}"\n{camera}'
        text += f'[[object]]\nfile = "{bench}/objects/carton.toml"\n'
        text += f'[scene]\nmeshes = ["{bench}/scene.obj"]\nunit = "m"\n{extra}'
        return self.write("sightline.toml", text)

    def check(self, config):
        """Exit status and message of the daemon's check; nothing may be bound or left running."""
        done = subprocess.run([os.path.join(BIN, "sightlined"), "--config", config, "--check"], capture_output=True,
                              text=True, timeout=WAIT_S, check=False)
        return done.returncode, done.stderr

    def overwrite(self, content, *names):
        with open(self.path("bench", *names), "wb") as file:
            file.write(content)

    def assert_refused(self, config, *names):
        status, message = self.check(config)
        self.assertEqual(status, 2, message)
        for name in names:
            self.assertIn(name, message)
        sightline("check", config, status=2)  # the other program agrees

    def test_a_good_installation_is_accepted(self):
        self.assertEqual(self.check(self.installation()), (0, ""))

    def test_a_broken_mesh_is_named(self):
        for content in (b"", b"\x00\xff nonsense", b"v 0 0 0\nf 1 2 3\n"):
            self.overwrite(content, "objects", "carton.obj")
            self.assert_refused(self.installation(), "carton.obj")

    def test_a_broken_scene_mesh_is_named(self):
        self.overwrite(b"solid nothing\n", "scene.obj")
        self.assert_refused(self.installation(), "scene.obj")

    def test_a_broken_or_missing_texture_is_named(self):
        self.overwrite(b"\x89PNG\r\n\x1a\n and no image", "objects", "carton.png")
        self.assert_refused(self.installation(), "carton.png")
        os.unlink(self.path("bench", "objects", "carton.png"))
        self.assert_refused(self.installation(), "carton.png")

    def test_broken_features_are_named(self):
        self.overwrite(b"no features", "objects", "carton.feat")
        with open(self.path("bench", "objects", "carton.toml"), "r+", encoding="utf-8") as file:
            text = file.read()
            file.seek(0)
            file.write('features = "carton.feat"\n' + text)
        self.assert_refused(self.installation(), "carton.feat")

    def test_a_broken_depth_image_is_named(self):
        self.overwrite(b"\x89PNG\r\n\x1a\n and no image", "depth.png")
        self.assert_refused(self.installation(camera=f'scene_depth = "{self.path("bench", "depth.png")}"\n'), "depth.png")

    def test_a_broken_calibration_is_named(self):
        self.overwrite(b"[[camera]]\nname = 3\n", "calibration.toml")
        self.assert_refused(self.installation(), "calibration.toml")

    def test_a_broken_font_is_named(self):
        font = self.path("font.ttf")
        with open(font, "wb") as file:
            file.write(b"no font")
        self.assert_refused(self.installation(extra=f'[overlay]\nfont_file = "{font}"\n'), "font.ttf")

    def test_a_broken_recording_is_named(self):
        self.overwrite(b"no rows\n", "frames.csv")
        self.assert_refused(self.installation(), "frames.csv")

    def test_all_mistakes_are_said_at_once(self):
        self.overwrite(b"nonsense", "objects", "carton.obj")
        self.overwrite(b"nonsense", "scene.obj")
        self.overwrite(b"no rows\n", "frames.csv")
        self.assert_refused(self.installation(), "carton.obj", "scene.obj", "frames.csv")

    def test_no_port_is_opened(self):
        config = self.installation(extra="[http]\nport = 1\n[rtsp]\nport = 2\n")  # ports that only root may open, or nobody
        self.assertEqual(self.check(config), (0, ""))


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    unittest.main(verbosity=2)
