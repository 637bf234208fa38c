#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The HTTP interface under clients that hold connections: health goes on to answer, within bounds of memory and
descriptors."""
import http.client
import multiprocessing
import os
import re
import select
import socket
import time
import unittest

from support import BENCH, WAIT_S, DaemonCase, read_text, wait_until

SCALE = WAIT_S / 120  # sanitizers are slow
ANSWER_S = 1.0 * SCALE
BEGIN = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: "
WHOLE = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"


class Dripper:
    """One connection of many: begins a request, then a byte every second; again as soon as it is cut off."""

    def __init__(self, port, begin):
        self.port, self.begin = port, begin
        self.connect()

    def connect(self):
        self.socket = socket.socket()
        self.socket.setblocking(False)
        self.due = None
        self.socket.connect_ex(("127.0.0.1", self.port))

    def drip(self, now):
        self.socket.send(b"a" if self.due else self.begin)
        self.due = now + 1

    def cut_off(self):
        """Reads what there is; true at the end."""
        try:
            while data := self.socket.recv(65536):
                assert data
            return True
        except BlockingIOError:
            return False


def drip(port, count, begin, connected, cut):
    """Keeps `count` drippers up, for ever."""
    poller = select.epoll()
    drippers = {}

    def add(dripper):
        drippers[dripper.socket.fileno()] = dripper
        poller.register(dripper.socket.fileno(), select.EPOLLIN | select.EPOLLOUT)

    def renew(dripper):
        drippers.pop(dripper.socket.fileno())
        connected.value -= bool(dripper.due)
        cut.value += 1
        dripper.socket.close()
        dripper.connect()
        add(dripper)

    for _ in range(count):
        add(Dripper(port, begin))
    while True:
        for number, event in poller.poll(0.1):
            dripper = drippers[number]
            try:
                if event & select.EPOLLOUT and not dripper.due:
                    dripper.drip(time.monotonic())
                    connected.value += 1
                    poller.modify(number, select.EPOLLIN)
                if event & (select.EPOLLIN | select.EPOLLERR | select.EPOLLHUP) and dripper.cut_off():
                    renew(dripper)
            except OSError:
                renew(dripper)
        now = time.monotonic()
        for dripper in list(drippers.values()):
            if dripper.due and dripper.due <= now:
                try:
                    dripper.drip(now)
                except OSError:
                    renew(dripper)


class Attack:
    """Drippers in a process of their own."""

    def __init__(self, port, count, begin=BEGIN):
        self.connected = multiprocessing.Value("l", 0)
        self.cut = multiprocessing.Value("l", 0)
        self.process = multiprocessing.Process(target=drip, args=(port, count, begin, self.connected, self.cut), daemon=True)
        self.process.start()

    def close(self):
        self.process.kill()
        self.process.join(WAIT_S)


def memory_kb(pid):
    return int(re.search(r"VmRSS:\s+(\d+)", read_text(f"/proc/{pid}/status")).group(1))


def settled_memory_kb(pid):
    """Once the daemon has taken what it needs for its cameras."""
    before = [0]

    def settled():
        last, before[0] = before[0], memory_kb(pid)
        time.sleep(1)
        return abs(before[0] - last) < 1024

    wait_until(settled, "its memory has settled")
    return before[0]


class HttpUnderAttack(DaemonCase):
    def ask(self, daemon, path="/healthz"):
        """Status of one request; an error after ANSWER_S."""
        connection = http.client.HTTPConnection("127.0.0.1", daemon.http, timeout=ANSWER_S)
        try:
            connection.request("GET", path)
            return connection.getresponse().status
        finally:
            connection.close()

    def attack(self, daemon, count, begin=BEGIN):
        attack = Attack(daemon.http, count, begin)
        self.addCleanup(attack.close)
        wait_until(lambda: attack.connected.value >= count * 9 // 10, "the attackers are connected")
        return attack

    def health_answers(self, daemon):
        """How many of 14 requests were answered, two a second as a monitor under load might."""
        answered = 0
        for _ in range(14):
            start = time.monotonic()
            try:
                answered += self.ask(daemon) == 200
            except OSError:
                pass
            time.sleep(max(0, 0.5 - (time.monotonic() - start)))
        return answered

    def test_health_answers_beside_160_drippers(self):
        daemon = self.start()
        attack = self.attack(daemon, 160)
        self.assertEqual(self.health_answers(daemon), 14)
        wait_until(lambda: attack.cut.value >= 160, "they are cut off at their deadlines")
        self.assertEqual(daemon.stop(), 0)

    def test_health_answers_beside_1000_drippers_within_bounds(self):
        daemon = self.start()
        self.assertEqual(self.ask(daemon, "/metrics"), 200)
        memory, files = settled_memory_kb(daemon.process.pid), len(os.listdir(f"/proc/{daemon.process.pid}/fd"))
        self.attack(daemon, 1000)
        self.assertEqual(self.health_answers(daemon), 14)
        self.assertLess(len(os.listdir(f"/proc/{daemon.process.pid}/fd")), files + 750)
        self.assertLess(memory_kb(daemon.process.pid), memory + 32 * 1024)
        self.assertEqual(daemon.stop(), 0)

    def test_health_answers_beside_drippers_that_were_answered_once(self):
        daemon = self.start()
        attack = self.attack(daemon, 700, WHOLE + BEGIN)
        self.assertEqual(self.health_answers(daemon), 14)
        wait_until(lambda: attack.cut.value >= 160, "they are cut off")

    def test_an_honest_client_asks_often(self):
        """As fast as it goes, on one connection and on new ones; nothing is refused and nothing is left open."""
        daemon = self.start()
        connection = http.client.HTTPConnection("127.0.0.1", daemon.http, timeout=WAIT_S)
        for _ in range(2000):
            connection.request("GET", "/healthz")
            answer = connection.getresponse()
            answer.read()
            self.assertEqual(answer.status, 200)
        connection.close()
        files = len(os.listdir(f"/proc/{daemon.process.pid}/fd"))
        self.assertEqual([self.ask(daemon) for _ in range(2000)], [200] * 2000)
        wait_until(lambda: len(os.listdir(f"/proc/{daemon.process.pid}/fd")) <= files + 8, "connections are closed")

    def test_names_that_only_begin_like_loopback_are_refused(self):
        daemon = self.start()
        for host, status in (("localhost", 200), ("[::1]:80", 200), ("[::1].evil", 403), ("localhost.evil", 403),
                             ("127.0.0.1.evil", 403), ("[::1]x", 403), ("localhost:", 403)):
            connection = http.client.HTTPConnection("127.0.0.1", daemon.http, timeout=WAIT_S)
            connection.request("GET", "/healthz", headers={"Host": host})
            self.assertEqual(connection.getresponse().status, status, host)
            connection.close()


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    unittest.main(verbosity=2)
