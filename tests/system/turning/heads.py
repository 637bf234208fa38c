# SPDX-License-Identifier: Apache-2.0
"""Pan and tilt heads as processes of a test see them: FreeD senders and VISCA cameras, written from the protocols'
descriptions and sharing nothing with the daemon, and a camera that sends JPEGs over HTTP."""
import math
import socket
import struct
import threading
import time


def freed_packet(pan_deg, tilt_deg, zoom=0, device=1, spoil=0):
    """A FreeD D1 packet; `spoil` is added to its checksum."""
    def signed(value):
        return struct.pack(">i", round(value * 32768))[1:]
    body = bytes([0xD1, device]) + signed(pan_deg) + signed(tilt_deg) + signed(0) + bytes(9)
    body += struct.pack(">I", zoom)[1:] + bytes(3) + bytes(2)
    return body + bytes([(0x40 - sum(body) + spoil) % 256])


class Head:
    """Something that turns to and fro: 20 degrees, 60 degrees a second at the fastest."""

    @staticmethod
    def angles(when):
        return 20 * math.sin(3 * when), 4 * math.sin(2 * when)


class FreedSender(Head):
    """Sends 50 packets a second to a port, or to a group on the loopback interface; `mode` is what is wrong with them."""

    def __init__(self, port, group=None):
        self.address = (group or "127.0.0.1", port)
        self.mode = "good"
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        count = 0
        while self.running:
            pan, tilt = self.angles(time.monotonic())
            count += 1
            if self.mode == "good":
                out.sendto(freed_packet(pan, tilt), self.address)
            elif self.mode == "checksum":
                out.sendto(freed_packet(pan, tilt, spoil=1), self.address)
            elif self.mode == "device":
                out.sendto(freed_packet(pan, tilt, device=9), self.address)
            elif self.mode == "short":
                out.sendto(freed_packet(pan, tilt)[:28], self.address)
            elif self.mode == "jumps":
                out.sendto(freed_packet(90 if count % 2 else -90, tilt), self.address)
            time.sleep(0.02)
        out.close()

    def close(self):
        self.running = False
        self.thread.join()


class ViscaCamera(Head):
    """Answers VISCA's inquiries of position and zoom; `mode` is what is wrong with the answers."""

    COUNTS = 14.4  # per degree

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.1)
        self.port = self.socket.getsockname()[1]
        self.mode = "good"
        self.asked = set()
        self.running = True
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    @staticmethod
    def nibbles(value):
        value &= 0xFFFF
        return bytes((value >> shift) & 0xF for shift in (12, 8, 4, 0))

    def answer(self, payload):
        self.asked.add(bytes(payload))
        if payload == bytes.fromhex("81090612FF"):
            pan, tilt = self.angles(time.monotonic())
            return b"\x90\x50" + self.nibbles(round(pan * self.COUNTS)) + self.nibbles(round(tilt * self.COUNTS)) + b"\xff"
        if payload == bytes.fromhex("81090447FF"):
            return b"\x90\x50" + self.nibbles(0) + b"\xff"
        return b"\x90\x60\x02\xff"  # syntax error

    def run(self):
        while self.running:
            try:
                message, sender = self.socket.recvfrom(256)
            except socket.timeout:
                continue
            kind, length, sequence = struct.unpack(">HHI", message[:8])
            if kind != 0x0110 or length != len(message) - 8 or self.mode == "silent":
                continue
            payload = self.answer(message[8:])
            if self.mode == "late":
                sequence -= 1
            elif self.mode == "nonsense":
                payload = b"\x90\x50" + b"\xee" * (len(payload) - 3) + b"\xff"
            elif self.mode == "cut":
                payload = payload[:-1]
            self.socket.sendto(struct.pack(">HHI", 0x0111, len(payload), sequence) + payload, sender)

    def close(self):
        self.running = False
        self.thread.join()
        self.socket.close()


class JpegCamera:
    """Sends JPEGs over HTTP, 30 a second, again and again."""

    def __init__(self, images):
        self.images = images
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self.serve, args=(client,), daemon=True).start()

    def serve(self, client):
        try:
            client.recv(4096)
            client.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=cut\r\n\r\n")
            for count in range(1 << 30):
                image = self.images[count % len(self.images)]
                client.sendall(b"--cut\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(image) + image + b"\r\n")
                time.sleep(1 / 30)
        except OSError:
            pass
        finally:
            client.close()

    def close(self):
        self.listener.close()
