#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Viewers that come in crowds and end with a reset: nothing of them stays behind."""
import os
import socket
import struct
import threading
import unittest

from support import WAIT_S, DaemonCase, installation, read_text, wait_until

CROWD = 60
ROUNDS = 3


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


if __name__ == "__main__":
    unittest.main(verbosity=2)
