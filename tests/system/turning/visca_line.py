# SPDX-License-Identifier: Apache-2.0
"""VISCA cameras chained on a serial line, which is a pseudo-terminal: written from the protocol's description, byte by byte and
at the line's own pace; shares nothing with the daemon."""
import os
import pty
import select
import threading
import time
import tty

from moving_head import MovingHead


class ChainedHead(MovingHead):
    """One camera of a line; its side over IP is not used."""

    def __init__(self):
        self.address, self.sockets = 0, 0  # without an address until it is given one
        self.done = []  # when which order is carried out
        super().__init__()

    def hear(self, packet, now):
        """What it says to a packet for its address, as the bytes behind the sender's."""
        if packet[1:2] == b"\x01" and packet[2:4] == b"\x06\x02" and self.mode not in ("stuck", "deaf"):
            for answer in self.answers(0x0100, b"\x81" + packet[1:]):
                if answer == b"\x90\x51\xff":
                    self.done.append((now + 0.2, answer[1:]))
                else:
                    yield answer[1:]
            return
        kind = 0x0110 if packet[1:2] == b"\x09" else 0x0100
        for answer in self.answers(kind, b"\x81" + packet[1:]):
            yield answer[1:]


class ViscaLine:
    """A line of cameras. `mode`: silent, garbage, halves (messages without their ends), echo; `unplug` and `plug` it."""

    BYTE_S = 10 / 38400

    def __init__(self, link, heads=1):
        self.link, self.mode = link, "good"
        self.heads = [ChainedHead() for _ in range(heads)]
        self.speeds, self.addressed = set(), 0
        self.master = None
        self.lock = threading.Lock()
        self.plug()
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def plug(self):
        master, slave = pty.openpty()
        tty.setraw(slave)
        if os.path.lexists(self.link):
            os.unlink(self.link)
        os.symlink(os.ttyname(slave), self.link)
        os.close(slave)
        for head in self.heads:
            head.address = 0
        with self.lock:
            self.master = master

    def unplug(self):
        with self.lock:
            os.close(self.master)
            self.master = None
        os.unlink(self.link)

    def say(self, data):
        if self.mode == "silent":
            return
        if self.mode == "garbage":
            data = bytes((7 * byte + 31) & 0xFF for byte in data)
        if self.mode == "halves":
            data = data[:len(data) // 2]
        for byte in data:  # as slow as the line, in pieces
            os.write(self.master, bytes([byte]))
            time.sleep(self.BYTE_S)

    def broadcast(self, packet):
        if packet[1:2] == b"\x30":
            count = packet[2]
            for head in self.heads:
                head.address = count
                count += 1
            self.addressed += 1
            self.say(bytes([0x88, 0x30, count, 0xFF]))
        else:
            self.say(packet)

    def restart(self, index):
        """A camera loses its power for a moment: it forgets its address and says that the chain changed."""
        self.heads[index].address = 0
        with self.lock:
            self.say(bytes([0x90 + 16 * index, 0x38, 0xFF]))

    def hear(self, packet):
        now = time.monotonic()
        if packet[0] == 0x88:
            return self.broadcast(packet)
        for head in self.heads:
            if head.address and packet[0] == 0x80 | head.address:
                for answer in head.hear(packet, now):
                    self.say(bytes([0x80 | head.address << 4]) + answer)
        return None

    def late(self):
        for head in self.heads:
            while head.done and head.done[0][0] <= time.monotonic():
                answer = head.done.pop(0)[1]
                if head.address:
                    self.say(bytes([0x80 | head.address << 4]) + answer)

    def run(self):
        buffer = b""
        while self.running:
            with self.lock:
                if self.master is None:
                    buffer = b""
                else:
                    try:
                        self.late()
                        ready, _, _ = select.select([self.master], [], [], 0.002)
                        if ready:
                            buffer += os.read(self.master, 256)
                        while b"\xff" in buffer:
                            end = buffer.index(b"\xff") + 1
                            packet, buffer = buffer[:end], buffer[end:]
                            self.hear(packet)
                    except OSError:  # nobody has opened it
                        time.sleep(0.01)
            time.sleep(0.0005)

    def close(self):
        self.running = False
        self.thread.join()
        for head in self.heads:
            head.close()
        if self.master is not None:
            os.close(self.master)
