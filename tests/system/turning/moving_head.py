# SPDX-License-Identifier: Apache-2.0
"""A VISCA head that moves: it takes orders to go to absolute positions 100 ms late, gains and loses speed as a mass does,
and remembers where it was. Written from the protocol's description; shares nothing with the daemon."""
import bisect
import math
import socket
import struct
import threading
import time


class MovingHead:
    COUNTS = 14.4  # per degree
    FASTEST = 120.0  # degrees a second at the fastest steps, 24 and 20
    ACCELERATION = 250.0  # degrees a second squared
    LATENCY_S = 0.1

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.005)
        self.port = self.socket.getsockname()[1]
        self.mode = "good"  # silent, stuck (orders are refused), backwards
        self.pushed = 0.0  # degrees a second of pan, by hand
        self.angles, self.rates, self.goal, self.speed = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        self.coming = []  # orders that it has not heard yet
        self.past = [(time.monotonic(), 0.0, 0.0)]
        self.orders = 0
        self.steps = set()  # of speed that it was ordered to
        self.goals = []
        self.unknown = set()
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    @staticmethod
    def nibbles(value):
        value &= 0xFFFF
        return bytes((value >> shift) & 0xF for shift in (12, 8, 4, 0))

    @staticmethod
    def signed(nibbles):
        value = 0
        for nibble in nibbles:
            if nibble > 0xF:
                raise ValueError("half-bytes have four bits")
            value = value << 4 | nibble
        return value - 0x10000 if value & 0x8000 else value

    def at(self, when):
        """Pan and tilt then, in degrees."""
        past = self.past
        after = min(max(bisect.bisect(past, (when,)), 1), len(past) - 1)
        (t0, *a), (t1, *b) = past[after - 1], past[after]
        share = min(max((when - t0) / max(t1 - t0, 1e-9), 0), 1)
        return [x + share * (y - x) for x, y in zip(a, b)]

    def move(self, now):
        while self.coming and self.coming[0][0] <= now:
            _, goal, self.speed = self.coming.pop(0)
            self.goal = goal() if callable(goal) else goal
        while self.past[-1][0] < now:
            step = min(now - self.past[-1][0], 0.01)
            for axis in (0, 1):
                way = self.goal[axis] - self.angles[axis]
                change = self.ACCELERATION * step
                stops = change * (math.sqrt(1 + 2 * abs(way) / (change * step)) - 1)
                wanted = math.copysign(min(self.speed[axis], stops), way)
                self.rates[axis] += min(max(wanted - self.rates[axis], -change), change)
                self.angles[axis] += self.rates[axis] * step
            if self.pushed:
                self.angles[0] += self.pushed * step
                self.goal, self.rates, self.coming = list(self.angles), [0.0, 0.0], []
            self.past.append((self.past[-1][0] + step, *self.angles))

    def order(self, payload, now):
        pan_step, tilt_step = payload[4], payload[5]
        goal = [self.signed(payload[6:10]) / self.COUNTS, self.signed(payload[10:14]) / self.COUNTS]
        self.orders += 1
        self.steps.add((pan_step, tilt_step))
        self.goals.append(goal)
        if self.mode == "backwards":
            goal = [2 * angle - there for angle, there in zip(self.angles, goal)]
        speed = [pan_step * self.FASTEST / 24, tilt_step * self.FASTEST / 20]
        self.coming.append((now + self.LATENCY_S, goal, speed))

    def answers(self, kind, payload):
        """What it says, one after another."""
        now = time.monotonic()
        self.move(now)
        if kind == 0x0110 and payload == bytes.fromhex("81090612FF"):
            pan, tilt = (round(angle * self.COUNTS) for angle in self.angles)
            return [b"\x90\x50" + self.nibbles(pan) + self.nibbles(tilt) + b"\xff"]
        if kind == 0x0110 and payload == bytes.fromhex("81090447FF"):
            return [b"\x90\x50" + self.nibbles(0) + b"\xff"]
        if kind == 0x0100 and len(payload) == 15 and payload[:4] == bytes.fromhex("81010602") and payload[14] == 0xFF:
            if not (1 <= payload[4] <= 0x18 and 1 <= payload[5] <= 0x14):
                return [b"\x90\x60\x02\xff"]
            if self.mode == "stuck":
                return [b"\x90\x61\x41\xff"]  # not executable
            self.order(payload, now)
            return [b"\x90\x41\xff", b"\x90\x51\xff"]
        self.unknown.add(bytes(payload))
        return [b"\x90\x60\x02\xff"]  # syntax error

    def run(self):
        while self.running:
            try:
                message, sender = self.socket.recvfrom(256)
            except socket.timeout:
                self.move(time.monotonic())
                continue
            kind, length, sequence = struct.unpack(">HHI", message[:8])
            if length != len(message) - 8 or self.mode == "silent":
                continue
            for payload in self.answers(kind, message[8:]):
                self.socket.sendto(struct.pack(">HHI", 0x0111, len(payload), sequence) + payload, sender)

    def close(self):
        self.running = False
        self.thread.join()
        self.socket.close()
