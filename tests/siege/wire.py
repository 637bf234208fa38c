# SPDX-License-Identifier: Apache-2.0
"""What the attacks share: a target, a connection that counts what goes through it, and RTSP as a client speaks it."""
import asyncio
import collections
import dataclasses
import socket
import struct

PATIENCE_S = 5.0  # bound of every single wait of an attacker


@dataclasses.dataclass(frozen=True)
class Target:
    rtsp: int
    http: int
    cameras: tuple
    max_clients: int
    host: str = "127.0.0.1"

    def url(self, camera):
        return f"rtsp://{self.host}:{self.rtsp}/{camera}"


class Attack:
    """One kind of attack, again and again until it is canceled. `least` names what it must achieve in a minute."""
    name = ""
    least = {}

    def __init__(self, target):
        self.target = target
        self.counts = collections.Counter()

    async def run(self):
        raise NotImplementedError

    async def peer(self, port, **options):
        return await Peer.connect(self.counts, self.target.host, port, **options)


def without_frames(data):
    """Less the whole frames of a stream at its beginning: the first may come before the answer to PLAY."""
    while data[:1] == b"$" and len(data) >= 4 and len(data) >= 4 + int.from_bytes(data[2:4], "big"):
        data = data[4 + int.from_bytes(data[2:4], "big"):]
    return data


class Cut(Exception):
    """The other side closed or reset the connection, or did not take it."""


class Peer:
    """A connection. Use it as a context: it is closed at the end, in the way asked for last."""

    def __init__(self, counts, sock):
        self.counts, self.sock = counts, sock
        self.loop = asyncio.get_running_loop()
        self.left_over = b""

    @classmethod
    async def connect(cls, counts, host, port, receive_buffer=None):
        sock = socket.socket()
        sock.setblocking(False)
        if receive_buffer:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        peer = cls(counts, sock)
        try:
            async with asyncio.timeout(PATIENCE_S):
                await peer.loop.sock_connect(sock, (host, port))
        except (OSError, TimeoutError) as problem:
            peer.close()
            counts["not_connected"] += 1
            raise Cut(str(problem)) from problem
        except BaseException:
            peer.close()
            raise
        counts["connections"] += 1
        return peer

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self.sock.fileno() < 0:
            return
        # A canceled wait would otherwise take its watch off a later connection with the same number.
        self.loop.remove_reader(self.sock.fileno())
        self.loop.remove_writer(self.sock.fileno())
        self.sock.close()

    def reset(self):
        if self.sock.fileno() >= 0:
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.close()

    async def send(self, data, patience_s=PATIENCE_S):
        """False if the other side takes no more for now."""
        try:
            async with asyncio.timeout(patience_s):
                await self.loop.sock_sendall(self.sock, data)
        except TimeoutError:
            return False
        except OSError as problem:
            self.counts["cut"] += 1
            raise Cut(str(problem)) from problem
        self.counts["bytes_sent"] += len(data)
        return True

    async def receive(self, patience_s=PATIENCE_S, size=65536):
        """Some bytes, or None if nothing came in time."""
        if self.left_over:
            data, self.left_over = self.left_over, b""
            return data
        try:
            async with asyncio.timeout(patience_s):
                data = await self.loop.sock_recv(self.sock, size)
        except TimeoutError:
            return None
        except OSError as problem:
            self.counts["cut"] += 1
            raise Cut(str(problem)) from problem
        if not data:
            self.counts["cut"] += 1
            raise Cut("closed")
        self.counts["bytes_received"] += len(data)
        return data

    def drain(self, buffer):
        """Throws away what has come; how much that was."""
        total = 0
        while True:
            try:
                size = self.sock.recv_into(buffer)
            except BlockingIOError:
                return total
            except OSError as problem:
                self.counts["cut"] += 1
                raise Cut(str(problem)) from problem
            if size == 0:
                self.counts["cut"] += 1
                raise Cut("closed")
            total += size
            self.counts["bytes_received"] += size

    async def answer(self, patience_s=PATIENCE_S):
        """Status and header of the next answer (RTSP or HTTP), its body read; None if none came in time."""
        text = b""
        while b"\r\n\r\n" not in (text := without_frames(text)) or text[:1] == b"$":
            data = await self.receive(patience_s)
            if data is None:
                return None
            text += data
        head, _, rest = text.partition(b"\r\n\r\n")
        lines = head.decode(errors="replace").split("\r\n")
        header = {key.strip().lower(): value.strip() for key, _, value in (line.partition(":") for line in lines[1:])}
        words = lines[0].split()
        status = int(words[1]) if len(words) > 1 and words[1].isdigit() else 0
        length = int(header.get("content-length", 0))
        while len(rest) < length:
            data = await self.receive(patience_s)
            if data is None:
                return None
            rest += data
        self.left_over = rest[length:]
        self.counts["answers"] += 1
        self.counts[f"answer_{status}"] += 1
        return status, header


class RtspPeer:
    """A viewer of one camera, over the connection it asks on."""

    def __init__(self, peer, target, camera):
        self.peer, self.url, self.session, self.number = peer, target.url(camera), "", 0

    def request(self, method, url=None, extra=""):
        self.number += 1
        session = f"Session: {self.session}\r\n" if self.session else ""
        return f"{method} {url or self.url} RTSP/1.0\r\nCSeq: {self.number}\r\n{session}{extra}\r\n".encode()

    async def ask(self, method, url=None, extra=""):
        """The header of a good answer; raises Cut for another one."""
        await self.peer.send(self.request(method, url, extra))
        answer = await self.peer.answer()
        if answer is None or answer[0] != 200:
            raise Cut(f"{method}: {answer}")
        return answer[1]

    async def set_up(self):
        await self.ask("DESCRIBE", extra="Accept: application/sdp\r\n")
        header = await self.ask("SETUP", self.url + "/stream=0",
                                "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n")
        self.session = header.get("session", "").split(";")[0]

    async def play(self):
        await self.set_up()
        await self.ask("PLAY")
        self.peer.counts["played"] += 1
