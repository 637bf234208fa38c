#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`cmake --install` puts programs, unit, example and man pages where a distribution would."""
import os
import shutil
import subprocess
import unittest

from support import BIN, WAIT_S, TemporaryFolder


class Install(TemporaryFolder):
    def test_installs_everything(self):
        subprocess.run(["cmake", "--install", os.path.dirname(BIN), "--prefix", self.path("usr")], check=True,
                       stdout=subprocess.DEVNULL, timeout=WAIT_S)
        for name in ("bin/sightlined", "bin/sightline", "lib/systemd/system/sightlined.service",
                     "lib/udev/rules.d/70-sightline.rules",
                     "share/man/man1/sightline.1", "share/man/man8/sightlined.8",
                     "share/doc/sightline/examples/sightline.example.toml", "share/doc/sightline/README.md"):
            self.assertTrue(os.path.exists(self.path("usr", name)), name)

    def test_man_pages_have_no_warnings(self):
        if not shutil.which("man"):
            self.skipTest("no man")
        folder = os.path.join(os.path.dirname(__file__), "..", "..", "docs", "man")
        for page in os.listdir(folder):
            done = subprocess.run(["man", "--warnings", "-l", os.path.join(folder, page)], capture_output=True,
                                  text=True, timeout=WAIT_S, check=True, env=dict(os.environ, MANWIDTH="100"))
            self.assertEqual(done.stderr, "", page)
            self.assertIn("EXIT STATUS", done.stdout)

    def test_unit_is_valid(self):
        if not shutil.which("systemd-analyze"):
            self.skipTest("no systemd-analyze")
        subprocess.run(["cmake", "--install", os.path.dirname(BIN), "--prefix", self.path("usr")], check=True,
                       stdout=subprocess.DEVNULL, timeout=WAIT_S)
        unit = self.path("usr", "lib/systemd/system/sightlined.service")
        with open(unit, encoding="utf-8") as file:
            text = file.read()
        self.assertNotRegex(text, "@[A-Za-z_]+@")  # every placeholder is filled in
        for word in ("Type=notify", "WatchdogSec=", "ExecReload=", "DynamicUser=yes"):
            self.assertIn(word, text)


if __name__ == "__main__":
    unittest.main(verbosity=2)
