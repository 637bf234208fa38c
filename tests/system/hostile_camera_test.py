#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Network cameras that mean harm, or are broken enough to look so: answers without an end, for which the daemon has neither the
memory nor the time. It keeps the other camera, stays small and alive, tries again, and stops when it is told to."""
import socket
import threading
import time
import unittest

from support import BENCH, DaemonCase, wait_until

FLOOD = b"a" * 65536
MOST_MIB = 400  # more than before the first connection; the floods would fill it in a second
STOP_S = 10


def endless(*head):
    """Says `head`, then letters for ever."""
    yield b"".join(head)
    while True:
        yield FLOOD


def trickle(head):
    """Says `head`, then a letter now and then: no single wait for it is long."""
    yield head
    while True:
        time.sleep(0.2)
        yield b"a"


def packets():
    while True:
        yield b"$\x00\xff\xff" + FLOOD[:65535]


RTSP_OK = b"RTSP/1.0 200 OK\r\nCSeq: %d\r\n"
RTSP_SDP = RTSP_OK + b"Content-Type: application/sdp\r\n"
MULTIPART = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=cut\r\n\r\n"

# What each answers to the first request, the second, ...; the last answer stands for all that follow.
RTSP = {
    "header line": [lambda n: endless(RTSP_OK % n, b"X-Long: ")],
    "header lines": [lambda n: endless_lines(RTSP_OK % n)],
    "no answer, only data": [lambda n: packets()],
    "body": [lambda n: [RTSP_OK % n + b"Public: DESCRIBE, SETUP, PLAY, TEARDOWN\r\n\r\n"],
             lambda n: endless(RTSP_SDP % n, b"Content-Length: 2000000000\r\n\r\nv=0\r\n")],
    "body of a first answer": [lambda n: endless(RTSP_OK % n, b"Content-Length: 2000000000\r\n\r\n")],
}
HTTP = {
    "header line": [lambda n: endless(b"HTTP/1.0 200 OK\r\nX-Long: ")],
    "no boundary": [lambda n: endless(MULTIPART, b"--")],
    "boundary after blanks": [lambda n: blanks(MULTIPART)],
    "picture without end": [lambda n: endless(MULTIPART, b"--cut\r\nContent-Type: image/jpeg\r\n\r\n\xff\xd8")],
    "picture of a terabyte": [lambda n: endless(
        MULTIPART, b"--cut\r\nContent-Type: image/jpeg\r\nContent-Length: 1099511627776\r\n\r\n\xff\xd8")],
    "pictures that are none": [lambda n: no_pictures(MULTIPART)],
}


def endless_lines(head):
    yield head
    lines = b"".join(b"X-%d: %s\r\n" % (i, b"a" * 100) for i in range(500))
    while True:
        yield lines


def blanks(head):
    yield head
    while True:
        yield b" " * 65536


def no_pictures(head):
    yield head
    part = b"--cut\r\nContent-Type: text/plain\r\nContent-Length: 65536\r\n\r\n" + FLOOD + b"\r\n"
    while True:
        yield part


class Camera:
    """Answers every connection with the same script; counts them."""

    def __init__(self, answers):
        self.answers = answers
        self.connections = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.open = []
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            self.connections += 1
            self.open.append(client)
            threading.Thread(target=self.serve, args=(client,), daemon=True).start()

    def serve(self, client):
        try:
            number = 0
            while client.recv(4096):
                answer = self.answers[min(number, len(self.answers) - 1)]
                number += 1
                for text in answer(number):
                    client.sendall(text)
        except OSError:
            pass  # given up by the other side, as it should
        finally:
            client.close()

    def close(self):
        self.listener.close()
        for client in self.open:
            try:
                client.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


def memory_mib(daemon):
    with open(f"/proc/{daemon.process.pid}/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmRSS")) / 1024


class HostileCamera(DaemonCase):
    def survives(self, scheme, answers, connections=3):
        camera = Camera(answers)
        self.addCleanup(camera.close)
        text = f'calibration = "{BENCH}/calibration.toml"\n'
        text += f'[[camera]]\nname = "left"\nsource = "{scheme}://127.0.0.1:{camera.port}/video"\n'
        text += f'[[camera]]\nname = "right"\nsource = "replay:{BENCH}"\nloop = true\n'
        text += "[rtsp]\nport = 0\n[http]\nport = 0\n"
        daemon = self.start(text)
        begun = time.monotonic()
        before = memory_mib(daemon)

        def came_back():
            self.assertLess(memory_mib(daemon), before + MOST_MIB)
            self.assertNotIn("no progress", daemon.log_text())
            return camera.connections >= connections

        wait_until(came_back, "it gives the camera up and tries it again")
        # For the first 0.8 s of the service a camera counts as absent or, while it is connected, as one whose image is due.
        wait_until(lambda: time.monotonic() - begun > 1 and "1 of 2 cameras" in daemon.get("/healthz"), "it is reported absent")
        left, right = daemon.state()["cameras"]
        self.assertEqual(left["frames"], 0)
        self.assertTrue(left["problem"])
        wait_until(lambda: daemon.state()["cameras"][1]["frames"] > right["frames"] + 5, "the other camera goes on")
        begin = time.monotonic()
        self.assertEqual(daemon.stop(), 0, daemon.log_text())
        self.assertLess(time.monotonic() - begin, STOP_S)
        return daemon

    def test_a_camera_that_says_a_letter_now_and_then(self):
        # No wait for it is long, so only the time until the first image ends it: 10 s.
        self.survives("rtsp", [lambda n: trickle(RTSP_OK % n + b"X-Long: ")], connections=2)


def add_test(scheme, name, answers):
    def test(self):
        self.survives(scheme, answers)
    setattr(HostileCamera, f"test_{scheme}_{name.replace(' ', '_').replace(',', '')}", test)


for name_, answers_ in RTSP.items():
    add_test("rtsp", name_, answers_)
for name_, answers_ in HTTP.items():
    add_test("http", name_, answers_)


if __name__ == "__main__":
    unittest.main(verbosity=2)
