#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Viewers that come in crowds and end with a reset: nothing of them stays behind. And one that is stopped: nobody else
loses a frame by it."""
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import unittest

from support import ROOT, WAIT_S, DaemonCase, installation, read_text, wait_until

CROWD = 60
ROUNDS = 3
ONE_BY_ONE = 300
WARM = 50          # viewers after which it is looked whether the daemon has all that it needs by itself
STEADY_KB = 200    # of growth in such a step
GROWTH_KB = 8000   # of the memory, by the hundreds that are counted: 27 kB each would show
# For how long a viewer is stopped; for figures 60 (docs/streaming.md).
FIRST_FRAMES = 150  # at 30 a second
STOPPED_S = float(os.environ.get("SIGHTLINE_STOPPED_SECONDS", "0"))
WATCHED_FRAMES = 150  # of each camera, while one viewer is stopped
MOST_ROUNDS = 5000
GOOD_VIEWER = os.path.join(ROOT, "tests", "siege", "viewer.py")


class Viewer:
    """RTSP inside its connection, as far as PLAY; reads no further."""

    def __init__(self, port, camera):
        self.url, self.number, self.session = f"rtsp://127.0.0.1:{port}/{camera}", 0, ""
        self.sock = socket.create_connection(("127.0.0.1", port), timeout=WAIT_S)

    def ask(self, method, url, extra=""):
        self.number += 1
        session = f"Session: {self.session}\r\n" if self.session else ""
        self.sock.sendall(f"{method} {url} RTSP/1.0\r\nCSeq: {self.number}\r\n{session}{extra}\r\n".encode())
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            byte = self.sock.recv(1)
            if not byte:
                return "closed"
            head += byte
            if head == b"$":  # a picture, before the answer to PLAY
                size = int.from_bytes(self.sock.recv(3, socket.MSG_WAITALL)[1:], "big")
                self.sock.recv(size, socket.MSG_WAITALL)
                head = b""
        for line in head.decode().split("\r\n"):
            key, _, value = line.partition(":")
            if key.lower() == "session":
                self.session = value.strip().split(";")[0]
            if key.lower() == "content-length":
                self.sock.recv(int(value), socket.MSG_WAITALL)
        return head.split()[1].decode()

    def play(self):
        transport = "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n"
        return [self.ask("DESCRIBE", self.url, "Accept: application/sdp\r\n"),
                self.ask("SETUP", self.url + "/stream=0", transport), self.ask("PLAY", self.url)]

    def reset(self):
        self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.sock.close()


class Crowds(DaemonCase):
    def crowd(self, port, number):
        """All at once; how many came to play."""
        played = []

        def come_and_go(index):
            viewer = Viewer(port, ("left", "right", "side")[(number + index) % 3])
            try:
                if viewer.play()[-1] == "200":
                    played.append(index)
            except OSError:
                pass
            viewer.reset()

        threads = [threading.Thread(target=come_and_go, args=(i,)) for i in range(CROWD)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return len(played)

    def test_sixty_reset_connections_leave_descriptors_and_threads_level(self):
        daemon = self.start(installation().replace("[rtsp]\n", "[rtsp]\nmax_clients = 250\n"))
        keeping = [daemon.pull(camera, frames=100000) for camera in ("left", "right", "side")]  # streams stay up
        for viewer in keeping:
            self.addCleanup(viewer.wait, timeout=WAIT_S)
            self.addCleanup(viewer.kill)
        wait_until(lambda: all(daemon.metric("sightline_viewers", camera=c) == 1 for c in ("left", "right", "side")),
                   "every stream is watched")
        files = f"/proc/{daemon.process.pid}/fd"
        status = f"/proc/{daemon.process.pid}/status"

        def threads():
            return int(read_text(status).split("Threads:")[1].split()[0])

        before = len(os.listdir(files)), threads()
        played = [self.crowd(daemon.rtsp, number) for number in range(ROUNDS)]
        self.assertGreaterEqual(min(played), CROWD // 2, played)
        wait_until(lambda: len(os.listdir(files)) <= before[0] + 3 and threads() <= before[1] + 3,
                   f"descriptors and threads are back at {before}")
        self.assertEqual([v.poll() for v in keeping], [None] * 3)
        self.assertEqual(daemon.get("/healthz").strip().split(" cameras")[0], "3 of 3")

    def test_viewers_that_vanished_take_no_place(self):
        daemon = self.start(installation().replace("[rtsp]\n", "[rtsp]\nmax_clients = 8\n"))
        keeping = daemon.pull("left", frames=100000)  # the stream stays up
        self.addCleanup(keeping.wait, timeout=WAIT_S)
        self.addCleanup(keeping.kill)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 1, "the stream is watched")
        for number in range(24):  # one after the other: there is always a place
            viewer = Viewer(daemon.rtsp, "left")
            self.assertEqual(viewer.play(), ["200"] * 3, f"viewer {number}")
            viewer.sock.close() if number % 2 else viewer.reset()
            wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 1, "it is gone")

    def watch(self, daemon, camera):
        """A viewer that keeps the number of every frame; ends when its standard input does."""
        viewer = subprocess.Popen([sys.executable, GOOD_VIEWER, "--port", str(daemon.rtsp), "--camera", camera],
                                  stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.addCleanup(viewer.wait, timeout=WAIT_S)
        self.addCleanup(viewer.kill)
        self.assertEqual(viewer.stdout.readline(), "playing\n")
        return viewer

    def come_and_go(self, daemon, count):
        """One after the other, by camera and kind of end in turn."""
        for number in range(count):
            viewer = Viewer(daemon.rtsp, ("left", "right")[number % 2])  # streams that stay up
            self.assertEqual(viewer.play(), ["200"] * 3, f"viewer {number}")
            viewer.sock.close() if number % 4 < 2 else viewer.reset()

    @staticmethod
    def captured(daemon, camera):
        return daemon.metric("sightline_frames_total", camera=camera)

    @staticmethod
    def taken(daemon):
        """Descriptors, and memory in kB."""
        status = read_text(f"/proc/{daemon.process.pid}/status")
        return len(os.listdir(f"/proc/{daemon.process.pid}/fd")), int(status.split("VmRSS:")[1].split()[0])

    def settle(self, daemon):
        """In its first seconds the daemon takes what it needs, with viewers or without (three seconds after the start the
        first session of WebRTC is made, some 25 MB); what it has then."""
        wait_until(lambda: self.captured(daemon, "left") > FIRST_FRAMES, "its first seconds are over")
        for _ in range(50):
            before = self.taken(daemon)
            self.come_and_go(daemon, WARM)
            if self.taken(daemon)[1] <= before[1] + STEADY_KB:
                break
        return self.taken(daemon)

    def test_hundreds_come_and_go_and_one_that_is_stopped_costs_nobody_a_frame(self):
        daemon = self.start(installation().replace("[rtsp]\n", "[rtsp]\nmax_clients = 40\n"))
        watching = {camera: [self.watch(daemon, camera) for _ in range(2)] for camera in ("left", "right")}
        warm = self.settle(daemon)
        self.come_and_go(daemon, ONE_BY_ONE)
        wait_until(lambda: self.taken(daemon)[0] <= warm[0] + 3, f"descriptors are back at {warm[0]}")
        last = self.taken(daemon)
        print(f"{ONE_BY_ONE} viewers came and went: descriptors {warm[0]} then {last[0]}, memory {warm[1]} then {last[1]} kB",
              file=sys.stderr)
        self.assertLessEqual(last[1], warm[1] + GROWTH_KB)
        stopped = daemon.pull("left", frames=100000)
        self.addCleanup(stopped.wait, timeout=WAIT_S)
        self.addCleanup(stopped.kill)
        wait_until(lambda: daemon.metric("sightline_viewers", camera="left") == 3, "all watch")
        stopped.send_signal(signal.SIGSTOP)
        since = time.monotonic()
        self.come_and_go(daemon, 100)
        # However fast they come and go: what the others get has to be something.
        enough = {camera: self.captured(daemon, camera) + WATCHED_FRAMES for camera in watching}
        for _ in range(MOST_ROUNDS):
            if time.monotonic() >= since + STOPPED_S and all(self.captured(daemon, c) >= n for c, n in enough.items()):
                break
            self.come_and_go(daemon, WARM)
        print(f"one was stopped for {time.monotonic() - since:.0f} s", file=sys.stderr)
        for camera, viewers in watching.items():
            seen = [json.loads(viewer.communicate("", timeout=WAIT_S)[0]) for viewer in viewers]
            frames = [{(epoch, sequence) for _, epoch, sequence, _ in one["frames"]} for one in seen]
            self.assertEqual([(one["problem"], one["packets_lost"]) for one in seen], [("", 0)] * 2, camera)
            # A busy machine may leave out frames before they are encoded, for all alike: what one got, the other did, too.
            first, end = max(map(min, frames)), min(map(max, frames))
            one, other = ({frame for frame in own if first <= frame <= end} for own in frames)
            print(f"{camera}: {len(one)} and {len(other)} frames, {len(one ^ other)} by one of the two only", file=sys.stderr)
            self.assertGreater(len(one), 100)
            self.assertEqual(one ^ other, set(), camera)


if __name__ == "__main__":
    unittest.main(verbosity=2)
