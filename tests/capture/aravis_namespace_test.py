#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""GigE Vision with real processes: Aravis' simulated cameras in a network namespace of their own.

aravis_namespace_test.py CLIENT. Exits 77 where there is no simulator or no namespace can be made.
Every wait is bounded; nothing is asserted about how long something takes.
"""
import os
import re
import signal
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "gige"))
from gige import ADDRESSES, WAIT_S, enter_namespace  # noqa: E402

CAMERA = "arv-fake-gv-camera-0.8"
CLIENT = ""


class Camera:
    """One simulated camera."""

    def __init__(self, address, serial, *options):
        self.command = [CAMERA, "-i", address, "-s", serial, *options]
        self.process = None
        self.start()

    def start(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def kill(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
        self.process.wait(timeout=WAIT_S)


class Client:
    """The test client; its lines, in order, as they come."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([CLIENT, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True)
        self.lines = []
        self.changed = threading.Condition()
        self.ended = False
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            with self.changed:
                self.lines.append(line.rstrip("\n"))
                self.changed.notify_all()
        with self.changed:
            self.ended = True
            self.changed.notify_all()

    def wait(self, pattern, count=1, start=0):
        """The line that is the count-th to match from line `start` on, and its number."""
        deadline = time.monotonic() + WAIT_S
        with self.changed:
            while True:
                found = [(i, line) for i, line in enumerate(self.lines) if i >= start and re.search(pattern, line)]
                if len(found) >= count:
                    return found[count - 1]
                left = deadline - time.monotonic()
                if left <= 0 or self.ended:
                    tail = "\n".join(self.lines[-15:])
                    raise AssertionError(f"never saw {count} x {pattern!r}; the last lines:\n{tail}")
                self.changed.wait(left)

    def end(self):
        """Ends the client; its lines."""
        if self.process.poll() is None:
            try:
                self.process.stdin.close()
            except OSError:
                pass
            try:
                self.process.wait(timeout=WAIT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.reader.join(timeout=WAIT_S)
        self.process.stdout.close()
        # 0 and 2 are its own; anything else is a crash or a sanitizer's report.
        if self.process.returncode not in (0, 2):
            raise AssertionError(f"the client ended with status {self.process.returncode}")
        return self.lines


def fields(line):
    return dict(part.split("=", 1) for part in line.split()[1:] if "=" in part)


def frames_of(lines, epoch=None):
    frames = [fields(line) for line in lines if line.startswith("frame ")]
    return [f for f in frames if epoch is None or int(f["epoch"]) == epoch]


class AravisTest(unittest.TestCase):
    def camera(self, index, *options):
        camera = Camera(ADDRESSES[index], f"GV0{index + 2}", *options)
        self.addCleanup(camera.kill)
        return camera

    def client(self, *arguments):
        client = Client(*arguments)
        self.addCleanup(client.end)
        return client

    def listed(self, count):
        """The list, once all cameras have come up."""
        for _ in range(20):
            lines = subprocess.run([CLIENT, "list"], capture_output=True, text=True, timeout=WAIT_S,
                                   check=True).stdout.splitlines()
            if len(lines) >= count:
                return lines
        return lines

    def check_continuous(self, frames):
        """Sequence numbers, gaps and counts tell the same story."""
        for before, after in zip(frames, frames[1:]):
            step = int(after["sequence"]) - int(before["sequence"])
            self.assertGreater(step, 0)
            self.assertEqual(step - 1, int(after["dropped"]))

    def test_three_cameras_one_stops_and_comes_back(self):
        cameras = [self.camera(i) for i in range(3)]
        lines = self.listed(3)
        self.assertEqual([fields(l)["serial"] for l in lines], ["GV02", "GV03", "GV04"])
        for line in lines:
            self.assertIn("Mono8", fields(line)["formats"])
            self.assertIn("BayerRG8", fields(line)["formats"])
        # By address, by serial, by id.
        names = [ADDRESSES[0], "GV03", fields(lines[2])["id"]]
        clients = [self.client("open", name, "width=320", "height=240", "rate=15") for name in names]
        for client in clients:
            client.wait(r"^frame ", count=20)
        cameras[0].process.send_signal(signal.SIGSTOP)
        number, error = clients[0].wait(r"^error ")
        self.assertRegex(error, r"no frame in \d")
        # While it is away: an error each time, in words, and the others run on.
        clients[0].wait(r"^error .*no camera answers at 127\.0\.0\.2", start=number)
        for client in clients[1:]:
            client.wait(r"^frame ", count=25, start=len(client.lines))
        cameras[0].process.send_signal(signal.SIGCONT)
        opened, _ = clients[0].wait(r"^open ", count=2)
        clients[0].wait(r"^frame ", count=20, start=opened)
        # Killed and started again: another process, the same camera.
        seen = len(clients[0].lines)
        cameras[0].kill()
        number, _ = clients[0].wait(r"^error ", start=seen)
        cameras[0].start()
        clients[0].wait(r"^frame ", count=20, start=clients[0].wait(r"^open ", start=number)[0])
        ended = [client.end() for client in clients]
        epochs = sorted({int(f["epoch"]) for f in frames_of(ended[0])})
        self.assertGreaterEqual(len(epochs), 3)
        for epoch in epochs:
            self.check_continuous(frames_of(ended[0], epoch))
        for lines in ended[1:]:
            # A starved machine can keep a simulator from sending for a second; nothing else may go wrong.
            self.assertFalse([l for l in lines if l.startswith("error") and "no frame in" not in l])
            frames = frames_of(lines)
            for epoch in sorted({int(f["epoch"]) for f in frames}):
                self.check_continuous(frames_of(lines, epoch))
            self.assertEqual({f["width"] + "x" + f["height"] for f in frames}, {"320x240"})

    def test_second_client_is_told_and_gets_the_camera_later(self):
        self.camera(0)
        self.listed(1)
        first = self.client("open", ADDRESSES[0], "rate=10")
        first.wait(r"^frame ", count=3)
        second = self.client("open", ADDRESSES[0])
        _, error = second.wait(r"^error ")
        self.assertIn("controlled by another client", error)
        seen = len(first.lines)
        first.wait(r"^frame ", count=10, start=seen)  # it was not disturbed
        first.end()
        second.wait(r"^frame ", count=3)

    def test_the_frame_number_wraps(self):
        self.camera(0)  # counts from 65400 on
        self.listed(1)
        client = self.client("open", ADDRESSES[0], "width=64", "height=64", "rate=100")
        client.wait(r"^frame ", count=300)
        frames = frames_of(client.end())
        self.check_continuous(frames)
        self.assertLess(int(frames[-1]["sequence"]), 65000)

    def test_lost_packets_drop_frames_and_are_counted(self):
        self.camera(0, "-r", "3")  # of a thousand, and the simulator sends nothing again
        self.listed(1)
        client = self.client("open", ADDRESSES[0], "width=640", "height=360", "rate=20", "packet_size=1400")
        client.wait(r"^frame .*dropped=[1-9]", count=3)
        lines = client.end()
        frames = frames_of(lines)
        self.check_continuous(frames)
        self.assertEqual({f["payload"] for f in frames}, {str(640 * 360)})
        status = fields([l for l in lines if l.startswith("status")][-1])
        self.assertGreater(int(status["incomplete"]), 0)
        self.assertGreaterEqual(int(status["lost"]), sum(int(f["dropped"]) for f in frames))

    def test_readers_that_keep_frames_get_copies(self):
        self.camera(0)
        self.listed(1)
        client = self.client("open", ADDRESSES[0], "rate=20", "buffers=5", "hold=20")
        client.wait(r"^frame ", count=60)
        status = fields([l for l in client.end() if l.startswith("status")][-1])
        self.assertGreater(int(status["copied"]), 20)

    def test_formats_and_software_trigger(self):
        self.camera(0)
        self.listed(1)
        for format_name in ("Mono16", "RGB8", "BayerGB8"):
            client = self.client("open", ADDRESSES[0], f"format={format_name}", "width=321", "height=123")
            client.wait(r"^frame .*width=321 height=123", count=3)
            client.end()
        client = self.client("open", ADDRESSES[0], "trigger=software", "fire=1")
        client.wait(r"^frame ", count=5)

    def test_wrong_settings_are_named(self):
        self.camera(0)
        self.listed(1)
        for setting, text in (("format=Mono12", "this camera has: Mono8"), ("rate=5000", "takes 0.1 to 1000 Hz"),
                              ("trigger=Line9", "this camera has: "), ("ptp=1", "has no PTP"),
                              ("exposure=1e12", "this camera takes 10 to"), ("buffers=2", "4 to 64"),
                              ("packet_size=100000", "576 to 65535")):
            with self.subTest(setting):
                client = self.client("open", ADDRESSES[0], setting)
                self.assertIn(text, client.wait(r"^error ")[1])
                client.end()
                self.assertEqual(client.process.returncode, 2)

    def test_absent_cameras_are_named(self):
        self.camera(0)
        self.listed(1)
        for name, text in (("GV99", "seen: Aravis-Fake-GV02 at 127.0.0.2"), (ADDRESSES[3], "no camera answers at"),
                           ("interface:eth7/GV02", "network interface eth7"), ("10.1.2.3", "no route")):
            with self.subTest(name):
                client = self.client("open", name)
                self.assertIn(text, client.wait(r"^error ")[1])
                client.end()
        client = self.client("open", "interface:lo/GV02")
        client.wait(r"^frame ")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    enter_namespace(CAMERA)
    CLIENT = sys.argv.pop(1)
    unittest.main(verbosity=2)
