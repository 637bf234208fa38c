#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The daemon's messages when nobody reads them: it goes on, says later what was lost, and ends with its last words."""
import os
import re
import signal
import socket
import subprocess
import threading
import time
import unittest
import urllib.request

from support import BENCH, BIN, WAIT_S, TemporaryFolder, fixed_port, installation, wait_until

LONG = 50  # mistakes in one file, the most that are said: a message of about 15 kB


def broken():
    return installation() + "".join(f"[mistake_{i}_that_makes_a_message_long]\n" for i in range(LONG))


class UnreadLog(TemporaryFolder):
    def start(self, stderr, text):
        self.notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.notify.close)
        self.notify.bind(self.path("notify.sock"))
        self.notify.settimeout(WAIT_S)
        self.config = self.write("sightline.toml", text)
        environment = dict(os.environ, NOTIFY_SOCKET=self.path("notify.sock"), WATCHDOG_USEC="10000000")
        process = subprocess.Popen([os.path.join(BIN, "sightlined"), "--config", self.config], stderr=stderr, env=environment)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def wait_for_words(self, word, count):
        """Receives notifications until so many are this word."""
        end = time.monotonic() + WAIT_S
        while count > 0:
            assert time.monotonic() < end, f"timed out waiting for {word}"
            count -= sum(line == word for line in self.notify.recv(4096).decode().split("\n"))

    def refuse_often(self, process, times):
        self.write("sightline.toml", broken())
        for _ in range(times):
            process.send_signal(signal.SIGHUP)
            self.wait_for_words("READY=1", 1)

    def check_unread(self, reader, writer, port):
        process = self.start(writer, installation(http=port))
        writer.close()
        self.wait_for_words("READY=1", 1)
        self.refuse_often(process, 60)  # 900 kB: more than the channel and the daemon keep
        self.wait_for_words("WATCHDOG=1", 3)
        metrics = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=WAIT_S).read().decode()
        lost = int(re.search(r"^sightline_log_messages_lost_total (\d+)$", metrics, re.MULTILINE).group(1))
        self.assertGreater(lost, 0)
        text = []
        thread = threading.Thread(target=lambda: text.append(reader.read()))
        process.send_signal(signal.SIGTERM)
        self.wait_for_words("STOPPING=1", 1)
        thread.start()  # now somebody reads
        wait_until(lambda: process.poll() is not None, "it ends")
        self.assertEqual(process.returncode, 0)
        thread.join(WAIT_S)
        said = sum(int(number) for number in re.findall(r"(\d+) messages were lost", text[0]))
        self.assertEqual(said, lost)
        self.assertIn("stopped", text[0].splitlines()[-1])

    def test_a_pipe_that_nobody_reads_holds_up_nothing(self):
        ends = os.pipe()
        self.check_unread(open(ends[0], encoding="utf-8"), open(ends[1], "w", encoding="utf-8"), fixed_port())

    def test_a_socket_that_nobody_reads_holds_up_nothing(self):
        """As the journal gives it."""
        ends = [end.detach() for end in socket.socketpair()]
        self.check_unread(open(ends[0], encoding="utf-8"), open(ends[1], "w", encoding="utf-8"), fixed_port())

    def test_sigterm_is_obeyed_while_nobody_reads(self):
        reader, writer = os.pipe()
        process = self.start(writer, installation())
        os.close(writer)
        self.wait_for_words("READY=1", 1)
        self.refuse_often(process, 60)
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(timeout=WAIT_S), 0)
        os.close(reader)

    def test_what_ends_it_is_said_in_whole_though_read_late(self):
        reader, writer = os.pipe()
        process = self.start(writer, broken())
        os.close(writer)
        self.assertEqual(process.wait(timeout=WAIT_S), 2)
        with open(reader, encoding="utf-8") as file:
            text = file.read()
        for i in range(LONG):
            self.assertIn(f"mistake_{i}_", text)

    def test_each_line_has_its_priority_in_the_journal(self):
        config = self.write("sightline.toml", broken())
        done = subprocess.run([os.path.join(BIN, "sightlined"), "--config", config], capture_output=True, text=True,
                              timeout=WAIT_S, check=False, env=dict(os.environ, JOURNAL_STREAM="1:2"))
        self.assertEqual(done.returncode, 2)
        lines = done.stderr.splitlines()
        self.assertGreaterEqual(len(lines), LONG)
        self.assertEqual([line for line in lines if not line.startswith("<3>")], [])


if __name__ == "__main__":
    assert os.path.isdir(BENCH)
    unittest.main(verbosity=2)
