#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Events in a real journal: systemd-journald in a mount namespace of its own takes what the daemon says, and journalctl
gives it back with the fields that one filters by, once for each event."""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from support import BENCH, BIN, WAIT_S, installation, wait_until  # noqa: E402

JOURNALD = "/usr/lib/systemd/systemd-journald"
INSIDE = "SIGHTLINE_JOURNAL_TEST"


def skip(why):
    print("skipped: " + why)
    sys.exit(77)


class Journal(unittest.TestCase):
    def test_events_have_fields_and_come_once(self):
        folder = tempfile.mkdtemp(prefix="sightline_test.")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        config = os.path.join(folder, "rig.toml")
        # One camera that is not there, and tried again and again.
        text = installation(cameras=("left", "right")) .replace(
            "[overlay]", '[[camera]]\nname = "side"\nsource = "v4l2:/dev/video-of-nobody"\n[overlay]')
        with open(config, "w", encoding="utf-8") as file:
            file.write(text)
        with open(os.path.join(folder, "stderr"), "w+", encoding="utf-8") as stream:
            info = os.fstat(stream.fileno())
            process = subprocess.Popen([os.path.join(BIN, "sightlined"), "--config", config], stderr=stream,
                                       env=dict(os.environ, JOURNAL_STREAM=f"{info.st_dev}:{info.st_ino}"))
            self.addCleanup(process.kill)
            wait_until(lambda: self.events(SIGHTLINE_OBJECT="carton"), "the object is found")
            wait_until(lambda: self.events(SIGHTLINE_CAMERA="side"), "the camera is missed")
            time.sleep(8)  # it is tried several times
            process.terminate()
            self.assertEqual(process.wait(timeout=WAIT_S), 0)
            stream.seek(0)
            self.assertEqual(stream.read(), "")  # nothing twice
        missed = self.events(SIGHTLINE_CAMERA="side")
        self.assertEqual(len(missed), 1, missed)
        self.assertEqual(missed[0]["SIGHTLINE_CAUSE"], "absent")
        self.assertEqual(missed[0]["PRIORITY"], "4")
        self.assertEqual(missed[0]["SYSLOG_IDENTIFIER"], "sightlined")
        self.assertIn("video-of-nobody", missed[0]["MESSAGE"])
        found = self.events(SIGHTLINE_OBJECT="carton")
        self.assertIn("carton: found", [event["MESSAGE"] for event in found])
        self.assertTrue(self.events(SIGHTLINE_CAMERA="left"))
        self.assertTrue(any(event["MESSAGE"] == "stopped" for event in self.events(SYSLOG_IDENTIFIER="sightlined")))

    @staticmethod
    def events(**fields):
        done = subprocess.run(["journalctl", "--directory=/run/log/journal", "-o", "json", "--no-pager"] +
                              [f"{key}={value}" for key, value in fields.items()], capture_output=True, text=True,
                              timeout=WAIT_S, check=False)
        return [json.loads(line) for line in done.stdout.split("\n") if line.startswith("{")]


def run_inside():
    """With /run of its own and a journal in it."""
    for path in ("/run/systemd/journal", "/run/log/journal"):
        os.makedirs(path, exist_ok=True)
    with subprocess.Popen([JOURNALD], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as journald:
        end = time.monotonic() + 20
        while not os.path.exists("/run/systemd/journal/socket"):
            if journald.poll() is not None or time.monotonic() > end:
                journald.kill()
                skip("systemd-journald does not run here")
            time.sleep(0.1)
        try:
            unittest.main(verbosity=2)
        finally:
            journald.kill()


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    if os.environ.get(INSIDE):
        run_inside()
    if not os.path.exists(JOURNALD) or not shutil.which("journalctl"):
        skip("there is no systemd-journald")
    if subprocess.run(["unshare", "-rm", "mount", "-t", "tmpfs", "tmpfs", "/run"], capture_output=True, check=False).returncode:
        skip("no mount namespace is to be had")
    inside = subprocess.run(["unshare", "-rm", "sh", "-c", 'mount -t tmpfs tmpfs /run && exec "$@"', "sh", sys.executable,
                             os.path.abspath(__file__)] + sys.argv[1:], env=dict(os.environ, **{INSIDE: "1"}), check=False)
    sys.exit(inside.returncode)
