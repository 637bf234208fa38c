# SPDX-License-Identifier: Apache-2.0
"""Attacks on the HTTP port."""
import asyncio
import os
import random

from wire import Attack, Cut

PATHS = ("/healthz", "/metrics", "/api/state")


class Drip(Attack):
    """160 connections that send a request a byte at a time, and are back as soon as they are thrown out."""
    name = "http_drip"
    least = {"connections": 200, "bytes_sent": 200}
    count, byte_s, shortest_s = 160, 1.0, 0.25

    async def run(self):
        await asyncio.gather(*(self.repeat(i) for i in range(self.count)))

    async def repeat(self, index):
        text = f"GET {PATHS[index % 3]} HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ".encode() + b"a" * 10_000
        loop = asyncio.get_running_loop()
        await asyncio.sleep(index * 0.01)
        while True:
            since = loop.time()
            try:
                with await self.peer(self.target.http) as peer:
                    for byte in text:
                        await peer.send(bytes([byte]))
                        if await peer.receive(patience_s=self.byte_s) is not None:
                            break
            except Cut:
                pass
            # One that is thrown out at once would spend our share of the machine on coming back.
            await asyncio.sleep(max(0, since + self.shortest_s - loop.time()))


class Flood(Attack):
    """A thousand requests a second over keep-alive connections."""
    name = "http_thousand_requests"
    least = {"requests": 1200}  # over connections that last
    clients, per_second = 20, 1000

    async def run(self):
        await asyncio.gather(*(self.repeat(i) for i in range(self.clients)))

    async def repeat(self, index):
        await asyncio.sleep(index * 0.05)
        while True:
            try:
                with await self.peer(self.target.http) as peer:
                    await self.ask_for_ever(peer, index)
            except Cut:
                pass
            await asyncio.sleep(0.25)

    async def ask_for_ever(self, peer, number):
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            number += 1
            due = max(due + self.clients / self.per_second, loop.time() - 1)  # what is late is made up for, a second of it
            self.counts["requests"] += 1
            await peer.send(f"GET {PATHS[number % 3]} HTTP/1.1\r\nHost: 127.0.0.1:{self.target.http}\r\n\r\n".encode())
            if await peer.answer(patience_s=3) is None:
                self.counts["unanswered"] += 1
                return
            await asyncio.sleep(max(0, due - loop.time()))


class ForeignHost(Attack):
    """Requests as a page of another site would send them. Any 200 shows the rig to that page."""
    name = "http_foreign_host"
    least = {"connections": 30}
    hosts = ("evil.example", "127.0.0.1.evil.example", "localhost.evil.example:80", "[::1].evil.example", "", "::1 x")

    async def run(self):
        while True:
            for host in self.hosts:
                try:
                    with await self.peer(self.target.http) as peer:
                        await peer.send(f"GET /api/state HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
                        await peer.answer(patience_s=2)
                except Cut:
                    pass
                await asyncio.sleep(0.2)


class Garbage(Attack):
    """Bytes that are no HTTP."""
    name = "http_garbage"
    least = {"connections": 60, "bytes_sent": 50_000}

    async def run(self):
        while True:
            data = os.urandom(random.randint(16, 8192))
            if random.random() < 0.5:
                data = b"GET /\x00" + data + b" HTTP/9.9\r\n\r\n"
            try:
                with await self.peer(self.target.http) as peer:
                    await peer.send(data)
                    await peer.receive(patience_s=0.5)
            except Cut:
                pass
            await asyncio.sleep(0.1)


class HugeHeader(Attack):
    """Headers of megabytes: one line, and many."""
    name = "http_huge_header"
    least = {"connections": 20, "bytes_sent": 100_000}

    async def run(self):
        line = b"X-More: " + b"a" * 1014 + b"\r\n"
        await asyncio.gather(self.repeat(line * 16), self.repeat(b"b" * 16384))

    async def repeat(self, chunk):
        while True:
            try:
                with await self.peer(self.target.http) as peer:
                    await peer.send(b"GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\n" + (b"X: " if chunk[0] == 98 else b""))
                    for _ in range(128):
                        if not await peer.send(chunk, patience_s=1):
                            break
                        await asyncio.sleep(0.05)
                    self.counts["gave_up"] += 1
            except Cut:
                pass
            await asyncio.sleep(0.5)


class Post(Attack):
    """Bodies that nobody asked for: of a gigabyte, in chunks, and with GET."""
    name = "http_post_bodies"
    least = {"connections": 40, "bytes_sent": 100_000}

    async def run(self):
        await asyncio.gather(self.repeat("POST", "Content-Length: 1000000000"),
                             self.repeat("PUT", "Transfer-Encoding: chunked"),
                             self.repeat("GET", "Content-Length: 1000000000"))

    async def repeat(self, method, how):
        while True:
            try:
                with await self.peer(self.target.http) as peer:
                    await peer.send(f"{method} /api/state HTTP/1.1\r\nHost: 127.0.0.1\r\n{how}\r\n\r\n".encode())
                    for _ in range(32):
                        body = b"d" * 16384
                        if "chunked" in how:
                            body = b"4000\r\n" + body + b"\r\n"
                        if not await peer.send(body, patience_s=1):
                            break
                        await asyncio.sleep(0.02)
                    await peer.receive(patience_s=1)
                    self.counts["gave_up"] += 1
            except Cut:
                pass
            await asyncio.sleep(0.5)


ATTACKS = (Drip, Flood, ForeignHost, Garbage, HugeHeader, Post)
