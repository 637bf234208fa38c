#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""`cmake --install` puts programs, unit, example and man pages where a distribution would."""
import os
import re
import shutil
import subprocess
import unittest

from support import BIN, WAIT_S, TemporaryFolder, sightline


class Install(TemporaryFolder):
    def test_installs_everything(self):
        subprocess.run(["cmake", "--install", os.path.dirname(BIN), "--prefix", self.path("usr")], check=True,
                       stdout=subprocess.DEVNULL, timeout=WAIT_S)
        for name in ("bin/sightlined", "bin/sightline", "lib/systemd/system/sightlined.service",
                     "lib/udev/rules.d/70-sightline.rules", "lib/systemd/system/sightlined@.service",
                     "share/bash-completion/completions/sightline", "share/sightline/config/demo.toml",
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

    def install_unit(self):
        """Path and text of the unit as it is installed."""
        subprocess.run(["cmake", "--install", os.path.dirname(BIN), "--prefix", self.path("usr")], check=True,
                       stdout=subprocess.DEVNULL, timeout=WAIT_S)
        unit = self.path("usr", "lib/systemd/system/sightlined.service")
        with open(unit, encoding="utf-8") as file:
            return unit, file.read()

    def test_unit_is_valid(self):
        _, text = self.install_unit()
        self.assertNotRegex(text, "@[A-Za-z_]+@")  # every placeholder is filled in
        for line in ("Type=notify", "DynamicUser=yes", "PrivateMounts=yes", "Restart=on-failure"):
            self.assertIn(line + "\n", text)
        for word in ("WatchdogSec=", "ExecReload=", "RestartSec="):
            self.assertIn(word, text)

    def test_the_demo_runs_as_it_is_installed(self):
        self.install_unit()
        sightline("check", self.path("usr", "share/sightline/config/demo.toml"))

    def test_units_wait_for_a_configuration_and_share_nothing(self):
        unit, text = self.install_unit()
        with open(unit.replace("sightlined.service", "sightlined@.service"), encoding="utf-8") as file:
            template = file.read()
        for content, name, folder in ((text, "sightline", "sightline"), (template, "%i", "sightline-%i")):
            self.assertNotRegex(content, "@[A-Za-z_]+@")
            conditions, service = content.split("[Service]\n")
            self.assertIn(f"ConditionPathExists=|/etc/sightline/{name}.toml\n", conditions)
            self.assertIn(f"ConditionPathExists=|/etc/default/{folder}\n", conditions)
            for line in (f"Environment=SIGHTLINE_CONFIG=/etc/sightline/{name}.toml",
                         f"EnvironmentFile=-/etc/default/{folder}", f"StateDirectory={folder}", f"CacheDirectory={folder}"):
                self.assertIn(line + "\n", service)

    def test_unit_is_started_again_for_ever_but_not_with_a_wrong_configuration(self):
        _, text = self.install_unit()
        sections = text.split("[Service]\n")
        self.assertIn("StartLimitIntervalSec=0\n", sections[0])  # in [Service] it would be ignored
        self.assertIn("RestartPreventExitStatus=2\n", sections[1])
        # What a control process returns does not count for RestartPreventExitStatus=.
        self.assertNotRegex(text, r"(?m)^ExecStartPre=")

    def test_unit_bounds_memory_and_lets_a_thread_be_niced(self):
        _, text = self.install_unit()
        self.assertRegex(text, r"(?m)^MemoryMax=\d+[GM%]$")
        filters = re.findall(r"(?m)^SystemCallFilter=(.*)$", text)
        self.assertIn("setpriority", filters[-1].split())  # after what takes @resources away

    def security(self, text):
        """What `systemd-analyze security` makes of a unit: 0 is closed, 10 is open."""
        os.makedirs(self.path("judged"), exist_ok=True)
        unit = self.path("judged", "sightlined.service")
        with open(unit, "w", encoding="utf-8") as file:
            file.write(text)
        done = subprocess.run(["systemd-analyze", "security", "--offline=true", "--no-pager", unit], capture_output=True,
                              text=True, timeout=WAIT_S, check=False)
        level = re.search(r"Overall exposure level.*: ([0-9.]+)", done.stdout)
        if not level:
            self.skipTest("systemd-analyze does not judge unit files here: " + done.stderr)
        return float(level.group(1))

    def test_unit_is_closed(self):
        if not shutil.which("systemd-analyze"):
            self.skipTest("no systemd-analyze")
        _, text = self.install_unit()
        with open(self.path("usr", "share/doc/sightline/examples/sightlined-addresses.conf"), encoding="utf-8") as file:
            addresses = file.read()
        alone = self.security(text)
        self.assertLessEqual(alone, 1.6)
        self.assertLess(self.security(text + addresses), alone)

    def test_unit_has_no_unknown_keys(self):
        if not shutil.which("systemd-analyze"):
            self.skipTest("no systemd-analyze")
        unit, _ = self.install_unit()
        done = subprocess.run(["systemd-analyze", "verify", "--man=no", unit], capture_output=True, text=True,
                              timeout=WAIT_S, check=False)
        self.assertNotIn("Unknown", done.stderr)
        self.assertNotIn("Failed to parse", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
