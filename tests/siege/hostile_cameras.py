# SPDX-License-Identifier: Apache-2.0
"""Network cameras that the daemon is told to open, and that answer without end."""
import asyncio
import collections

CHUNK, CHUNK_S = 65536, 0.05  # 1.3 MB/s to each connection


class HostileCamera:
    """Answers whatever it is asked with a beginning, and then for ever with more of the same."""

    def __init__(self, name, scheme, beginning, more):
        self.name, self.scheme, self.beginning = name, scheme, beginning
        self.chunk = more * (CHUNK // len(more))
        self.counts = collections.Counter()
        self.server = None

    async def start(self):
        self.server = await asyncio.start_server(self.serve, "127.0.0.1", 0)
        port = self.server.sockets[0].getsockname()[1]
        return f"{self.scheme}://127.0.0.1:{port}/live"

    async def serve(self, reader, writer):
        self.counts["connections"] += 1
        try:
            async with asyncio.timeout(5):
                request = await reader.readuntil(b"\r\n\r\n")
            sequence = next((line for line in request.split(b"\r\n") if line.lower().startswith(b"cseq")), b"CSeq: 1")
            writer.write(self.beginning.replace(b"CSEQ", sequence))
            while True:
                writer.write(self.chunk)
                async with asyncio.timeout(30):
                    await writer.drain()
                self.counts["bytes_sent"] += len(self.chunk)
                await asyncio.sleep(CHUNK_S)
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            self.counts["cut"] += 1
        finally:
            writer.close()


def make():
    rtsp = b"RTSP/1.0 200 OK\r\nCSEQ\r\n"
    return [
        HostileCamera("endless_header", "rtsp", rtsp, b"X-More: " + b"a" * 1014 + b"\r\n"),
        HostileCamera("endless_body", "rtsp", rtsp + b"Public: OPTIONS, DESCRIBE, SETUP, PLAY\r\n"
                      b"Content-Type: application/sdp\r\nContent-Length: 4000000000\r\n\r\n", b"a=x:" + b"y" * 506 + b"\r\n"),
        HostileCamera("no_boundary", "http", b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace\r\n\r\n",
                      b"\xff\xd8" + b"z" * 1022),
    ]
