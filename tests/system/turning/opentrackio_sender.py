# SPDX-License-Identifier: Apache-2.0
"""A tracker that sends OpenTrackIO samples over UDP, written from the protocol's description; shares nothing with the
daemon."""
import json
import socket
import struct
import threading
import time

from heads import Head


def fletcher16(data, modulus=256):
    low = high = 0
    for byte in data:
        low = (low + byte) % modulus
        high = (high + low) % modulus
    return high << 8 | low


def cbor(value):
    """RFC 8949, what OpenTrackIO needs of it."""
    def head(kind, number):
        for more, size in ((24, 1), (25, 2), (26, 4), (27, 8)):
            if number < 24:
                return bytes([kind << 5 | number])
            if number < 1 << 8 * size:
                return bytes([kind << 5 | more]) + number.to_bytes(size, "big")
        raise ValueError(number)
    if isinstance(value, bool):
        return b"\xf5" if value else b"\xf4"
    if isinstance(value, int):
        return head(0, value) if value >= 0 else head(1, -1 - value)
    if isinstance(value, float):
        return b"\xfb" + struct.pack(">d", value)
    if isinstance(value, str):
        return head(3, len(value.encode())) + value.encode()
    if isinstance(value, list):
        return head(4, len(value)) + b"".join(map(cbor, value))
    return head(5, len(value)) + b"".join(cbor(key) + cbor(item) for key, item in value.items())


def sample(pan_deg, tilt_deg, seconds, source=3, zoom=0.25, encode=lambda value: json.dumps(value).encode()):
    """One sample, as long as real ones are: more than a packet of Ethernet takes."""
    return encode({
        "protocol": {"name": "OpenTrackIO", "version": [1, 0, 1]}, "sourceId": "urn:uuid:9f21", "sourceNumber": source,
        "static": {"camera": {"make": "none", "label": "x" * 1600}},
        "timing": {"mode": "internal", "sampleRate": {"num": 50, "denom": 1},
                   "sampleTimestamp": {"seconds": int(seconds), "nanoseconds": int(seconds % 1 * 1e9)}},
        "lens": {"encoders": {"focus": 0.5, "iris": 0.5, "zoom": zoom}},
        "transforms": [{"id": "Base", "translation": {"x": 1, "y": 2, "z": 3}, "rotation": {"pan": 77, "tilt": 7, "roll": 0}},
                       {"id": "Camera", "translation": {"x": 0, "y": 0, "z": 0},
                        "rotation": {"pan": pan_deg, "tilt": tilt_deg, "roll": 0}}]})


def datagrams(payload, sequence, spoil=0, encoding=1, most=1200):
    """A sample in segments."""
    for start in range(0, len(payload), most):
        part = payload[start:start + most]
        last = start + most >= len(payload)
        head = struct.pack(">4sBBHIH", b"OTrk", 0, encoding, sequence & 0xFFFF, start, last << 15 | len(part))
        yield head + struct.pack(">H", (fletcher16(head + part) + spoil) & 0xFFFF) + part


class OpenTrackIoSender(Head):
    """Sends 50 samples a second to a port, or to a group on the loopback interface; `mode` is what is wrong with them."""

    def __init__(self, port, group=None, encoding=1):
        self.address = (group or "127.0.0.1", port)
        self.encoding = encoding
        self.mode = "good"
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def parts(self, count):
        now = time.monotonic()
        pan, tilt = self.angles(now)
        if self.encoding == 2:
            return self.parts_of_cbor(count, now, pan, tilt)
        if self.mode == "bare":
            return [sample(pan, tilt, now)]
        if self.mode == "frozen":  # it says the same again and again
            return datagrams(sample(12, 3, 1000.0), count)
        if self.mode == "source":
            return datagrams(sample(pan, tilt, now, source=9), count)
        if self.mode == "jumps":
            return datagrams(sample(90 if count % 2 else -90, tilt, now), count)
        good = list(datagrams(sample(pan, tilt, now), count))
        return {"good": good, "silent": [], "checksum": datagrams(sample(pan, tilt, now), count, spoil=1),
                "cbor": datagrams(sample(pan, tilt, now), count, encoding=2), "other": datagrams(sample(pan, tilt, now), count, encoding=3), "torn": good[1:],
                "swapped": good[::-1], "text": [b"{" + bytes(40)]}[self.mode]

    def parts_of_cbor(self, count, now, pan, tilt):
        payload = sample(pan, tilt, now, encode=cbor)
        if self.mode == "damaged":
            payload = payload[:-3]  # with a checksum that fits: its sender is at fault
        if self.mode == "deep":
            payload = b"\x81" * 10000
        good = list(datagrams(payload, count, encoding=2))
        if self.mode == "mixed":  # its second half says that it is JSON
            good[1:] = list(datagrams(payload, count, encoding=1))[1:]
        return [] if self.mode == "silent" else good

    def run(self):
        out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        count = 0
        while self.running:
            count += 1
            for datagram in self.parts(count):
                out.sendto(datagram, self.address)
            time.sleep(0.02)
        out.close()

    def close(self):
        self.running = False
        self.thread.join()
