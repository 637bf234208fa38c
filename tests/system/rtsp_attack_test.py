#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Clients of the RTSP port that mean harm, against the running daemon: the others must not notice."""
import ctypes
import os
import re
import socket
import struct
import subprocess
import time
import unittest
import urllib.error
import urllib.request

from support import WAIT_S, DaemonCase, installation, read_text, wait_until

MB = 1 << 20


def connect(port, source=None):
    peer = socket.create_connection(("127.0.0.1", port), timeout=WAIT_S,
                                    source_address=(source, 0) if source else None)
    peer.settimeout(WAIT_S)
    return peer


def read_head(peer):
    """A response up to its empty line; what there was if the server ends the connection before."""
    data = b""
    try:
        while b"\r\n\r\n" not in data:
            chunk = peer.recv(4096)
            if not chunk:
                break
            data += chunk
    except ConnectionError:
        pass
    return data.decode(errors="replace")


def flood(peer, block, limit):
    """Sends the block again and again; how many bytes were taken when the server ended the connection, None if it took
    `limit` bytes."""
    sent = 0
    try:
        while sent < limit:
            peer.sendall(block)
            sent += len(block)
    except OSError:
        return sent
    return None


def ended(peer):
    """Waits for the server to end the connection, whatever it sends until then; False if it does not."""
    end = time.monotonic() + WAIT_S
    try:
        while time.monotonic() < end:
            if not peer.recv(65536):
                return True
    except ConnectionError:
        return True
    except socket.timeout:
        pass
    return False


class RtspViewer:
    """RTP inside the RTSP connection."""

    def __init__(self, port, camera="left", source=None):
        self.url = f"rtsp://127.0.0.1:{port}/{camera}"
        self.peer = connect(port, source)
        self.sequence = 0
        self.session = ""

    def request(self, method, url=None, headers=""):
        """The response's head; "" if there was none."""
        self.sequence += 1
        session = f"Session: {self.session}\r\n" if self.session else ""
        try:
            self.peer.sendall(f"{method} {url or self.url} RTSP/1.0\r\nCSeq: {self.sequence}\r\n{session}{headers}\r\n"
                              .encode())
            head = read_head(self.peer)
        except ConnectionError:
            return ""
        found = re.search(r"Session: ([^;\r]+)", head)
        if found:
            self.session = found[1]
        return head

    def play(self):
        """True once it plays. The answer to PLAY may come after the first pictures, so those are waited for."""
        if "RTSP/1.0 200" not in self.request("DESCRIBE", headers="Accept: application/sdp\r\n"):
            return False
        if "RTSP/1.0 200" not in self.request("SETUP", self.url + "/stream=0",
                                              "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n"):
            return False
        self.peer.sendall(f"PLAY {self.url} RTSP/1.0\r\nCSeq: 9\r\nSession: {self.session}\r\n\r\n".encode())
        return self.receives(200_000)

    def receives(self, size):
        """True if so many bytes come."""
        while size > 0:
            try:
                got = len(self.peer.recv(65536))
            except ConnectionError:
                return False
            if got == 0:
                return False
            size -= got
        return True


class RtspAttack(DaemonCase):
    def setUp(self):
        super().setUp()
        self.daemon = None

    def serve(self, rtsp=""):
        """A daemon with these lines under [rtsp]."""
        self.daemon = self.start(installation(cameras=("left",)).replace("[rtsp]\n", "[rtsp]\n" + rtsp))
        self.port = self.daemon.rtsp
        return self.daemon

    def process_file(self, name):
        return f"/proc/{self.daemon.process.pid}/{name}"

    def threads(self):
        return len(os.listdir(self.process_file("task")))

    def memory(self, key):
        """Bytes."""
        return int(re.search(rf"{key}:\s+(\d+) kB", read_text(self.process_file("status")))[1]) * 1024

    def forget_peak(self):
        with open(self.process_file("clear_refs"), "w", encoding="ascii") as file:
            file.write("5")

    def peer(self, **options):
        peer = connect(self.port, **options)
        self.addCleanup(peer.close)
        return peer

    def viewer(self, **options):
        viewer = RtspViewer(self.port, **options)
        self.addCleanup(viewer.peer.close)
        return viewer

    def healthz(self):
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.daemon.http}/healthz", timeout=WAIT_S) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def assert_serves_and_is_quiet(self):
        self.assertTrue(self.viewer().play())
        log = self.daemon.log_text()
        self.assertNotIn("CRITICAL", log)
        self.assertLess(len(log), 64 * 1024)
        self.assertEqual(self.healthz()[0], 200)


class Requests(RtspAttack):
    def test_an_endless_header_line_is_cut_off_and_leaves_no_thread_behind(self):
        self.serve()
        threads = self.threads()
        peer = self.peer()
        peer.sendall(b"OPTIONS * RTSP/1.0\r\nX: ")
        self.assertIsNotNone(flood(peer, b"a" * 4096, 64 * MB), "64 MB of one header line were taken")
        peer.close()
        wait_until(lambda: self.threads() <= threads, "the connection's thread is gone")
        self.assert_serves_and_is_quiet()

    def test_an_endless_header_of_a_viewer_that_plays_is_cut_off(self):
        self.serve()
        viewer = self.viewer()
        self.assertTrue(viewer.play())
        viewer.peer.sendall(b"OPTIONS * RTSP/1.0\r\nX: ")
        self.assertIsNotNone(flood(viewer.peer, b"a" * 4096, 64 * MB), "64 MB of one header line were taken")
        wait_until(lambda: self.daemon.metric("sightline_viewers", camera="left") == 0, "the viewer is gone")
        self.assert_serves_and_is_quiet()

    def test_a_header_that_trickles_in_is_cut_off(self):
        self.serve()
        threads = self.threads()
        peer = self.peer()
        peer.sendall(b"OPTIONS * RTSP/1.0\r\nX: ")
        started = time.monotonic()
        peer.settimeout(0.1)
        cut = False
        while not cut and time.monotonic() < started + WAIT_S:
            try:
                peer.sendall(b"a")
                cut = not peer.recv(1024)
            except socket.timeout:
                continue
            except OSError:
                cut = True
        self.assertTrue(cut)
        self.assertLess(time.monotonic() - started, 18)  # at 10 s; without a bound of its own, at 20 s
        wait_until(lambda: self.threads() <= threads, "the connection's thread is gone")
        self.assert_serves_and_is_quiet()

    def test_a_viewer_that_stops_in_the_middle_of_a_request_is_cut_off(self):
        self.serve()
        viewer = self.viewer()
        self.assertTrue(viewer.play())
        viewer.peer.sendall(b"GET_PARAMETER * RTSP/1.0\r\nCSe")
        self.assertTrue(ended(viewer.peer))
        wait_until(lambda: self.daemon.metric("sightline_viewers", camera="left") == 0, "the viewer is gone")
        self.assert_serves_and_is_quiet()

    def test_many_header_lines_do_not_fill_the_memory(self):
        self.serve()
        before = self.memory("VmRSS")
        self.forget_peak()
        peer = self.peer()
        peer.sendall(b"OPTIONS * RTSP/1.0\r\n")
        self.assertIsNotNone(flood(peer, b"A: b\r\n" * 1000, 8 * MB), "8 MB of header lines were taken")
        self.assertLess(self.memory("VmHWM") - before, 32 * MB)
        self.assert_serves_and_is_quiet()

    def test_a_huge_body_does_not_fill_the_memory(self):
        self.serve()
        before = self.memory("VmRSS")
        self.forget_peak()
        peer = self.peer()
        peer.sendall(b"SET_PARAMETER * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 2000000000\r\n\r\n")
        self.assertIsNotNone(flood(peer, b"a" * MB, 256 * MB), "256 MB of a body were taken")
        self.assertLess(self.memory("VmHWM") - before, 32 * MB)
        self.assert_serves_and_is_quiet()

    def test_bodies_on_all_connections_at_once_stay_small(self):
        self.serve()
        before = self.memory("VmRSS")
        self.forget_peak()
        peers = [self.peer() for _ in range(30)]
        for peer in peers:
            peer.sendall(b"SET_PARAMETER * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 8000000\r\n\r\n")
        for peer in peers:
            flood(peer, b"a" * MB, 7 * MB)
        self.assertLess(self.memory("VmHWM") - before, 64 * MB)
        self.assert_serves_and_is_quiet()

    def test_garbage_is_answered_and_cut_off(self):
        self.serve()
        for text in (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"hello\r\n\r\n", b"OPTIONS * RTSP/1.0\nCSeq: 1\n\n",
                     b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: -5\r\n\r\n",
                     b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
                     b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n folded\r\n\r\n", b"OPTIONS * RTSP/1.0\r\n\0: 1\r\n\r\n"):
            with self.subTest(text=text):
                peer = self.peer()
                peer.sendall(text)
                self.assertIn("400 Bad Request", read_head(peer))
                self.assertTrue(ended(peer))
        self.assert_serves_and_is_quiet()


class Browsers(RtspAttack):
    """Another site's page in a browser on this host (DNS rebinding) must not get at the pictures."""

    def test_rtsp_inside_http_is_refused_whatever_host_is_named(self):
        self.serve()
        for host in ("evil.example", f"127.0.0.1:{self.port}", "localhost"):
            for method in ("GET", "POST"):
                with self.subTest(host=host, method=method):
                    peer = self.peer()
                    peer.sendall(f"{method} /left HTTP/1.1\r\nHost: {host}\r\nx-sessioncookie: abc\r\n"
                                 "Accept: application/x-rtsp-tunnelled\r\nContent-Length: 32767\r\n\r\n".encode())
                    head = read_head(peer)
                    self.assertIn("HTTP/1.1 403", head)
                    self.assertNotIn("x-rtsp-tunnelled", head)
                    self.assertTrue(ended(peer))
        self.assert_serves_and_is_quiet()

    def test_rtsp_in_the_body_of_a_post_is_not_answered(self):
        self.serve()
        body = f"OPTIONS rtsp://127.0.0.1:{self.port}/left RTSP/1.0\r\nCSeq: 1\r\n\r\n" * 20
        for length in (len(body), 0):
            with self.subTest(length=length):
                peer = self.peer()
                peer.sendall(f"POST / HTTP/1.1\r\nHost: evil.example\r\nContent-Type: text/plain\r\n"
                             f"Content-Length: {length}\r\n\r\n{body}".encode())
                self.assertNotIn("RTSP/1.0", read_head(peer))
                self.assertTrue(ended(peer))
        self.assert_serves_and_is_quiet()


class Connections(RtspAttack):
    def test_idle_connections_give_way(self):
        self.serve()
        idle = [self.peer() for _ in range(32)]
        self.assertTrue(self.viewer().play())
        self.assertTrue(ended(idle[0]))  # the oldest went
        # Connections that have asked something but have no session are idle as well.
        for peer in [self.peer() for _ in range(40)]:
            peer.sendall(b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\n")
        self.assert_serves_and_is_quiet()

    def test_a_connection_that_asks_nothing_is_closed(self):
        self.serve()
        started = time.monotonic()
        self.assertTrue(ended(self.peer()))
        self.assertLess(time.monotonic() - started, 18)  # at 10 s; without a bound of its own, at 20 s

    def test_one_connection_does_not_take_all_sessions(self):
        self.serve()
        greedy = self.viewer()
        answers = []
        for channel in range(40):
            greedy.session = ""
            answers.append(greedy.request("SETUP", greedy.url + "/stream=0", "Transport: RTP/AVP/TCP;unicast;interleaved="
                                          f"{2 * channel}-{2 * channel + 1}\r\n")[:12])
        self.assertEqual(answers[0], "RTSP/1.0 200")
        self.assertEqual(set(answers[1:]), {"RTSP/1.0 453"})
        self.assert_serves_and_is_quiet()

    def test_viewers_of_one_address_leave_room_for_others(self):
        self.serve("max_clients_per_address = 2\n")
        first = self.viewer()
        self.assertTrue(first.play())
        self.assertTrue(self.viewer().play())
        self.assertFalse(self.viewer().play())
        self.assertTrue(self.viewer(source="127.0.0.2").play())
        self.assertTrue(first.receives(100_000))

    def test_viewers_that_come_and_go_in_disorder_leave_nothing_behind(self):
        self.serve("max_clients = 100\n")
        self.assertTrue(self.viewer().play())

        def come_and_go():
            viewers = [RtspViewer(self.port) for _ in range(60)]
            for viewer in viewers:
                viewer.request("DESCRIBE", headers="Accept: application/sdp\r\n")
                viewer.peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # a reset
                viewer.peer.close()
        come_and_go()
        wait_until(lambda: self.daemon.metric("sightline_viewers", camera="left") <= 1, "they are gone")
        level = len(os.listdir(self.process_file("fd")))
        come_and_go()
        wait_until(lambda: len(os.listdir(self.process_file("fd"))) <= level, "descriptors are back at their level")
        self.assert_serves_and_is_quiet()


class Addresses(RtspAttack):
    def udp_addresses(self):
        """Local addresses of the daemon's UDP sockets."""
        lines = subprocess.run(["ss", "-H", "-uanp"], capture_output=True, text=True, timeout=WAIT_S, check=True).stdout
        mine = [line for line in lines.splitlines() if f"pid={self.daemon.process.pid}," in line]
        return [line.split()[3] for line in mine]

    def test_udp_stays_at_the_configured_address(self):
        self.serve()
        before = set(self.udp_addresses())
        command = ["ffmpeg", "-nostdin", "-loglevel", "error", "-rtsp_transport", "udp", "-i",
                   f"rtsp://127.0.0.1:{self.port}/left", "-frames:v", "100000", "-f", "null", "-"]
        viewer = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        self.addCleanup(viewer.wait)
        self.addCleanup(viewer.kill)
        wait_until(lambda: self.daemon.metric("sightline_viewers", camera="left") == 1, "it plays")
        opened = set(self.udp_addresses()) - before
        self.assertGreaterEqual(len(opened), 2, "RTP and RTCP")
        for address in opened:
            self.assertRegex(address, r"^127\.0\.0\.1:")

    def test_pictures_are_not_sent_to_somebody_else(self):
        self.serve()
        viewer = self.viewer()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as victim:
            victim.bind(("127.0.0.3", 0))
            port = victim.getsockname()[1]
            head = viewer.request("SETUP", viewer.url + "/stream=0", "Transport: RTP/AVP;unicast;destination=127.0.0.3;"
                                  f"client_port={port}-{port + 1}\r\n")
        self.assertIn("RTSP/1.0 200", head)
        self.assertNotIn("127.0.0.3", head)

    def test_pictures_come_over_udp(self):
        self.serve()
        done = subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-rtsp_transport", "udp", "-i",
                               f"rtsp://127.0.0.1:{self.port}/left", "-frames:v", "20", "-f", "null", "-"],
                              timeout=WAIT_S, check=False)
        self.assertEqual(done.returncode, 0)

    def test_an_address_that_others_reach_is_warned_of(self):
        self.start(installation(cameras=("left",)).replace("[rtsp]\n", '[rtsp]\naddress = "0.0.0.0"\nopen = true\n'))
        self.assertRegex(read_text(self.path("daemon.log")), r"warning.*rtsp.*0\.0\.0\.0.*everybody")
        quiet = self.start()
        self.assertNotRegex(quiet.log_text(), r"rtsp.*everybody")


PTRACE_DETACH, PTRACE_SEIZE, PTRACE_INTERRUPT = 17, 0x4206, 0x4207


class Supervision(RtspAttack):
    def test_a_hung_rtsp_thread_is_seen(self):
        self.serve()
        tasks = self.process_file("task")
        thread = next(int(t) for t in os.listdir(tasks) if read_text(f"{tasks}/{t}/comm").strip() == "rtsp")
        self.assertEqual(self.healthz()[0], 200)
        libc = ctypes.CDLL(None, use_errno=True)
        libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        if libc.ptrace(PTRACE_SEIZE, thread, None, None) != 0:
            self.skipTest("threads cannot be traced here: " + os.strerror(ctypes.get_errno()))
        self.addCleanup(libc.ptrace, PTRACE_DETACH, thread, None, None)  # also when the test fails
        self.assertEqual(libc.ptrace(PTRACE_INTERRUPT, thread, None, None), 0)
        os.waitpid(thread, 0x40000000)  # __WALL; it stands still now
        wait_until(lambda: self.healthz()[0] == 503, "health tells")
        self.assertIn("rtsp", self.healthz()[1])
        self.assertEqual(libc.ptrace(PTRACE_DETACH, thread, None, None), 0)
        wait_until(lambda: self.healthz()[0] == 200, "it is well again")
        self.assertTrue(self.viewer().play())


if __name__ == "__main__":
    unittest.main()
