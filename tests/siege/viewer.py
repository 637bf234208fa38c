#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A good viewer of one stream: RTSP with RTP inside the connection (RFC 2326, 6184), every frame with the time it came and the
number it wears (docs/sei.md). Started by siege.py; writes what it saw as JSON when its standard input ends."""
import argparse
import json
import os
import select
import socket
import struct
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "demo"))
import h264_sei  # noqa: E402

KEEP_ALIVE_S = 15
SILENCE_S = 10     # without a byte: the stream is over


class Depacketizer:
    """RTP packets in, messages of whole frames out. It keeps no video: only the SEI and what is missing."""

    def __init__(self):
        self.expected, self.lost, self.message, self.bytes = None, 0, None, 0

    def packet(self, data):
        """(number of bytes, message) when this packet ends a frame, else None."""
        number = struct.unpack_from(">H", data, 2)[0]
        if self.expected is not None and number != self.expected:
            self.lost += (number - self.expected) & 0xffff
        self.expected = (number + 1) & 0xffff
        payload = data[12 + 4 * (data[0] & 15):]
        kind = payload[0] & 31
        if kind == 24:  # STAP-A: several small NAL units
            at = 1
            while at + 2 < len(payload):
                (size,) = struct.unpack_from(">H", payload, at)
                self.nal(payload[at + 2:at + 2 + size])
                at += 2 + size
        elif kind < 24:
            self.nal(payload)
        self.bytes += len(payload)
        if not data[1] & 0x80:
            return None
        done, self.message, self.bytes = (self.bytes, self.message), None, 0
        return done

    def nal(self, nal):
        if nal and nal[0] & 31 == 6:
            for kind, payload in h264_sei.sei_payloads(nal):
                if kind == 5 and payload[:16] == h264_sei.UUID:
                    self.message = h264_sei.parse_message(payload)


class Viewer:
    def __init__(self, port, camera):
        self.url, self.session, self.number = f"rtsp://127.0.0.1:{port}/{camera}", "", 0
        self.sock = socket.create_connection(("127.0.0.1", port), timeout=30)
        self.data = b""
        self.frames, self.problem, self.without_message = [], "", 0
        self.depacketizer = Depacketizer()

    def send(self, method, url=None, extra=""):
        self.number += 1
        session = f"Session: {self.session}\r\n" if self.session else ""
        self.sock.sendall(f"{method} {url or self.url} RTSP/1.0\r\nCSeq: {self.number}\r\n{session}{extra}\r\n".encode())

    def ask(self, method, url=None, extra=""):
        self.send(method, url, extra)
        while b"\r\n\r\n" not in (self.data if self.data[:1] != b"$" else b""):
            self.more()
            self.take(time.monotonic_ns(), frames_only=True)  # the first may come before the answer to PLAY
        head, _, self.data = self.data.partition(b"\r\n\r\n")
        lines = head.decode().split("\r\n")
        if " 200 " not in lines[0]:
            raise ConnectionError(f"{method}: {lines[0]}")
        header = {k.strip().lower(): v.strip() for k, _, v in (line.partition(":") for line in lines[1:])}
        length = int(header.get("content-length", 0))
        while len(self.data) < length:
            self.more()
        self.data = self.data[length:]
        return header

    def more(self):
        data = self.sock.recv(1 << 18)
        if not data:
            raise ConnectionError("the server closed the connection")
        self.data += data

    def play(self):
        self.ask("DESCRIBE", extra="Accept: application/sdp\r\n")
        header = self.ask("SETUP", self.url + "/stream=0", "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n")
        self.session = header["session"].split(";")[0]
        self.ask("PLAY")

    def take(self, now, frames_only=False):
        """Everything complete in the buffer: RTP of the video, and the answers to keep-alives."""
        at, data = 0, self.data
        while len(data) - at >= 4:
            if data[at] != 0x24:
                if frames_only:
                    break
                end = data.find(b"\r\n\r\n", at)
                if end < 0:
                    break
                at = end + 4
                continue
            channel, size = data[at + 1], struct.unpack_from(">H", data, at + 2)[0]
            if len(data) - at < 4 + size:
                break
            if channel == 0:
                self.rtp(data[at + 4:at + 4 + size], now)
            at += 4 + size
        self.data = data[at:]

    def rtp(self, packet, now):
        done = self.depacketizer.packet(packet)
        if done is None:
            return
        message = done[1]
        if message is None:
            self.without_message += 1
            return
        self.frames.append((now, message["epoch"], message["sequence"], message["capture_ns"]))

    def watch(self, stop):
        """Until `stop` becomes readable, or the stream ends."""
        alive = time.monotonic()
        self.sock.settimeout(SILENCE_S)
        try:
            while True:
                ready, _, _ = select.select([self.sock, stop], [], [], SILENCE_S)
                if stop in ready:
                    return
                if not ready:
                    raise ConnectionError(f"nothing came for {SILENCE_S} s")
                now = time.monotonic_ns()
                self.more()
                self.take(now)
                if time.monotonic() - alive > KEEP_ALIVE_S:
                    alive = time.monotonic()
                    self.send("OPTIONS")
        except OSError as problem:
            self.problem = str(problem) or type(problem).__name__


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--camera", required=True)
    options = parser.parse_args()
    viewer = Viewer(options.port, options.camera)
    viewer.play()
    print("playing", flush=True)
    viewer.watch(sys.stdin)
    json.dump({"frames": viewer.frames, "problem": viewer.problem, "packets_lost": viewer.depacketizer.lost,
               "without_message": viewer.without_message}, sys.stdout)


if __name__ == "__main__":
    main()
