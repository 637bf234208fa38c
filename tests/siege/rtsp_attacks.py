# SPDX-License-Identifier: Apache-2.0
"""Attacks on the RTSP port."""
import asyncio
import os
import random

from wire import Attack, Cut, RtspPeer

CHUNK_S = 0.05
CHUNK = 65536  # bytes each CHUNK_S: 1.3 MB/s a connection, which one process at the lowest priority can do


async def pour(peer, chunk, most):
    """Sends a chunk again and again until it is cut off or `most` bytes are gone. True in the second case."""
    for _ in range(most // len(chunk)):
        if not await peer.send(chunk, patience_s=1):
            peer.counts["held_up"] += 1
        await asyncio.sleep(CHUNK_S)
    peer.counts["gave_up"] += 1
    return True


class EndlessHeader(Attack):
    """Requests whose header does not end: many lines, and one line."""
    name = "rtsp_endless_header"
    least = {"connections": 4, "bytes_sent": 50_000}

    async def run(self):
        line = b"X-More: " + b"a" * 1014 + b"\r\n"
        await asyncio.gather(self.repeat(line * (CHUNK // len(line))), self.repeat(b"X: " + b"b" * (CHUNK - 3)),
                             self.repeat(b"y: z\r\n" * (CHUNK // 60)))

    async def repeat(self, chunk):
        while True:
            try:
                with await self.peer(self.target.rtsp) as peer:
                    await peer.send(f"OPTIONS {self.target.url('')} RTSP/1.0\r\nCSeq: 1\r\n".encode())
                    await pour(peer, chunk, 24 << 20)
            except Cut:
                pass
            await asyncio.sleep(1)


class HugeBody(Attack):
    """Requests that promise bodies of gigabytes, and send some of them."""
    name = "rtsp_huge_content_length"
    least = {"connections": 20, "bytes_sent": 5_000}
    lengths = ("2000000000", "4294967295", "99999999999999999999", "-1", "268435456")

    async def run(self):
        await asyncio.gather(*(self.repeat(length) for length in self.lengths))

    async def repeat(self, length):
        head = (f"SET_PARAMETER {self.target.url('left')} RTSP/1.0\r\nCSeq: 1\r\nContent-Type: text/parameters\r\n"
                f"Content-Length: {length}\r\n\r\n").encode()
        while True:
            try:
                with await self.peer(self.target.rtsp) as peer:
                    await peer.send(head)
                    await pour(peer, b"c" * (CHUNK // 4), 2 << 20)
            except Cut:
                pass
            await asyncio.sleep(1)


class IdleFlood(Attack):
    """Connections up to the limit and beyond that say nothing, or half a word, for longer than the server waits."""
    name = "rtsp_idle_connections"
    least = {"connections": 60}
    hold_s, rest_s = 24, 16

    async def run(self):
        while True:
            await asyncio.gather(*(self.sit(i) for i in range(self.target.max_clients + 40)))
            await asyncio.sleep(self.rest_s)

    async def sit(self, index):
        await asyncio.sleep(index * 0.02)
        try:
            with await self.peer(self.target.rtsp) as peer:
                if index % 3 == 1:
                    await peer.send(b"OPTI")
                elif index % 3 == 2:
                    await peer.send(b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n")
                if await peer.receive(patience_s=self.hold_s) is None:
                    self.counts["held_to_the_end"] += 1
        except Cut:
            pass


class Tunnels(Attack):
    """RTSP over HTTP as a page of another site would open it: a foreign Host. Any 200 is an open door."""
    name = "rtsp_http_tunnel_foreign_host"
    least = {"connections": 30}

    async def run(self):
        await asyncio.gather(*(self.repeat(i) for i in range(4)))

    async def repeat(self, index):
        number = index
        while True:
            number += 4
            cookie = f"siege{number:016d}"
            head = f"HTTP/1.0\r\nHost: evil.example:{self.target.rtsp}\r\nx-sessioncookie: {cookie}\r\n"
            try:
                with await self.peer(self.target.rtsp) as getter:
                    await getter.send(f"GET /left {head}Accept: application/x-rtsp-tunnelled\r\n\r\n".encode())
                    answer = await getter.answer(patience_s=2)
                    if answer is not None and answer[0] == 200:
                        self.counts["tunnels_opened"] += 1
                        await self.post(head)
            except Cut:
                pass
            await asyncio.sleep(0.5)

    async def post(self, head):
        with await self.peer(self.target.rtsp) as poster:
            await poster.send(f"POST /left {head}Content-Type: application/x-rtsp-tunnelled\r\n"
                              f"Content-Length: 32767\r\n\r\n".encode() + b"AAAA" * random.randint(1, 2000))
            await asyncio.sleep(1)


class Garbage(Attack):
    """Bytes that are no RTSP, frames of channels nobody set up among them."""
    name = "rtsp_garbage"
    least = {"connections": 60, "bytes_sent": 100_000}

    async def run(self):
        await asyncio.gather(*(self.repeat(i) for i in range(3)))

    async def repeat(self, index):
        while True:
            data = os.urandom(random.randint(16, 8192))
            if index == 1:
                data = (b"$\x00\xff\xff" + data) * 4
            elif index == 2:
                data = data.replace(b"\n", b"\r\n") + b"\r\n\r\n"
            try:
                with await self.peer(self.target.rtsp) as peer:
                    await peer.send(data)
                    if await peer.receive(patience_s=1) is not None:
                        self.counts["answers"] += 1
            except Cut:
                pass
            await asyncio.sleep(0.2)


class HalfRequests(Attack):
    """Requests that stop in the middle, or come a byte at a time."""
    name = "rtsp_half_requests"
    least = {"connections": 10, "bytes_sent": 500}

    async def run(self):
        await asyncio.gather(*(self.repeat(i % 2 == 0) for i in range(6)))

    async def repeat(self, slowly):
        text = f"DESCRIBE {self.target.url('left')} RTSP/1.0\r\nCSeq: 7\r\nAccept: application/sdp\r\nX: ".encode()
        while True:
            try:
                with await self.peer(self.target.rtsp) as peer:
                    if slowly:
                        for byte in text + b"a" * 1000:
                            await peer.send(bytes([byte]))
                            await asyncio.sleep(0.5)
                    else:
                        await peer.send(text[:random.randint(1, len(text))])
                        await peer.receive(patience_s=8)
                        peer.reset()
                    self.counts["gave_up"] += 1
            except Cut:
                pass
            await asyncio.sleep(0.5)


class ComingAndGoing(Attack):
    """Sixty viewers at a time, who watch for a moment and leave as viewers do: politely, at once, or with a reset."""
    name = "rtsp_sixty_viewers"
    least = {"connections": 200, "played": 30, "bytes_received": 200_000}
    count, every_s = 60, 6

    async def run(self):
        buffer = bytearray(1 << 18)
        loop = asyncio.get_running_loop()
        while True:
            due = loop.time() + self.every_s
            await asyncio.gather(*(self.watch(i, buffer) for i in range(self.count)))
            self.counts["waves"] += 1
            await asyncio.sleep(max(0.5, due - loop.time()))

    async def watch(self, index, buffer):
        try:
            with await self.peer(self.target.rtsp) as peer:
                viewer = RtspPeer(peer, self.target, self.target.cameras[index % len(self.target.cameras)])
                await viewer.play()
                for _ in range(random.randint(1, 20)):
                    await asyncio.sleep(0.1)
                    peer.drain(buffer)
                if index % 3 == 0:
                    await peer.send(viewer.request("TEARDOWN"))
                elif index % 3 == 1:
                    peer.reset()
                self.counts["left"] += 1
        except Cut:
            self.counts["turned_away"] += 1


class StalledViewers(Attack):
    """Viewers that ask for a stream and never read it."""
    name = "rtsp_stalled_viewers"
    least = {"connections": 4, "played": 2}
    hold_s = 45

    async def run(self):
        await asyncio.gather(*(self.repeat(i) for i in range(4)))

    async def repeat(self, index):
        await asyncio.sleep(index)
        while True:
            try:
                with await self.peer(self.target.rtsp, receive_buffer=4096) as peer:
                    await RtspPeer(peer, self.target, self.target.cameras[index % len(self.target.cameras)]).play()
                    await asyncio.sleep(self.hold_s)
                    buffer = bytearray(1 << 18)
                    for _ in range(20):
                        await asyncio.sleep(0.05)
                        peer.drain(buffer)  # raises if the server gave it up meanwhile
                    self.counts["never_cut_off"] += 1
            except Cut:
                pass
            await asyncio.sleep(1)


class Resets(Attack):
    """Connections reset at any point of the conversation, in the middle of a frame among them."""
    name = "rtsp_resets"
    least = {"connections": 60, "resets": 30}

    async def run(self):
        await asyncio.gather(*(self.repeat() for _ in range(3)))

    async def repeat(self):
        while True:
            try:
                with await self.peer(self.target.rtsp) as peer:
                    await self.talk(peer, random.randrange(4))
                    peer.reset()
                    self.counts["resets"] += 1
            except Cut:
                pass
            await asyncio.sleep(0.3)

    async def talk(self, peer, stage):
        viewer = RtspPeer(peer, self.target, random.choice(self.target.cameras))
        if stage == 0:
            await peer.send(viewer.request("DESCRIBE", extra="Accept: application/sdp\r\n"))
        elif stage == 1:
            await viewer.set_up()
        elif stage == 2:
            await viewer.set_up()
            await peer.send(viewer.request("PLAY"))
        else:
            await viewer.play()
            await peer.receive(size=random.randint(1, 1000))


ATTACKS = (EndlessHeader, HugeBody, IdleFlood, Tunnels, Garbage, HalfRequests, ComingAndGoing, StalledViewers, Resets)
