#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""TLS for HTTP and RTSP with a certificate of our own: real clients, clients that speak plainly, broken files."""
import http.client
import os
import shutil
import signal
import socket
import ssl
import subprocess
import unittest

from support import WAIT_S, DaemonCase, fixed_port, installation, sightline, wait_until

SECRET = "0123456789abcdef-wall"


@unittest.skipUnless(shutil.which("openssl"), "no openssl on this machine (scripts/deps installs it)")
class Tls(DaemonCase):
    def certificate(self, name="rig"):
        """(certificate, key)"""
        files = self.path(name + ".pem"), self.path(name + ".key")
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost",
                        "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-out", files[0], "-keyout", files[1]],
                       check=True, capture_output=True, timeout=WAIT_S)
        os.chmod(files[1], 0o600)
        return files

    def text(self, certificate, key, tokens=True):
        self.http_port, self.rtsp_port = fixed_port(), fixed_port() + 1
        access = f'[access]\ncertificate = "{certificate}"\nkey = "{key}"\n'
        if tokens:
            self.write("tokens", f"wall viewer {SECRET}\n")
            os.chmod(self.path("tokens"), 0o600)
            access += f'tokens = "{self.path("tokens")}"\n'
        return installation(rtsp=self.rtsp_port, http=self.http_port, extra=access)

    def get(self, path, certificate, **headers):
        connection = http.client.HTTPSConnection("127.0.0.1", self.http_port, timeout=WAIT_S,
                                                 context=ssl.create_default_context(cafile=certificate))
        connection.request("GET", path, headers={"Authorization": "Bearer " + SECRET, **headers})
        answer = connection.getresponse()
        result = answer.status, answer.read()
        connection.close()
        return result

    def play(self, address, *options, frames=5):
        return subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", *options, "-i", address, "-frames:v", str(frames), "-f",
                               "null", "-"], timeout=WAIT_S, capture_output=True, check=False)

    def test_both_servers_speak_tls_alone(self):
        certificate, key = self.certificate()
        daemon = self.start(self.text(certificate, key))
        self.assertEqual(self.get("/api/v1/state", certificate)[0], 200)
        status, picture = self.get("/cameras/left/snapshot.jpg", certificate)  # waits inside, and is larger than a record
        self.assertEqual((status, picture[:2]), (200, b"\xff\xd8"))
        own = f"https://127.0.0.1:{self.http_port}"
        self.assertEqual(self.get("/api/v1/version", certificate, Origin=own)[0], 200)
        self.assertEqual(self.get("/api/v1/version", certificate, Origin=own.replace("https", "http"))[0], 403)
        with self.assertRaises(ssl.SSLError):  # who does not know the certificate finds out
            http.client.HTTPSConnection("127.0.0.1", self.http_port, timeout=WAIT_S).request("GET", "/")
        stream = f"127.0.0.1:{self.rtsp_port}/left"
        done = self.play(f"rtsps://wall:{SECRET}@{stream}")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotEqual(self.play(f"rtsps://wall:a-wrong-guess@{stream}").returncode, 0)
        self.assertNotEqual(self.play(f"rtsps://{stream}").returncode, 0)
        self.assertNotEqual(self.play(f"rtsp://wall:{SECRET}@{stream}", "-rtsp_transport", "tcp").returncode, 0)
        # Plain words get no answer, and harm nobody.
        for port in (self.http_port, self.rtsp_port):
            with socket.create_connection(("127.0.0.1", port), timeout=WAIT_S) as plain:
                plain.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" * 10000)
                try:
                    self.assertNotIn(b"200", plain.recv(100))
                except ConnectionError:
                    pass
        files = f"/proc/{daemon.process.pid}/fd"
        before = len(os.listdir(files))
        for _ in range(20):
            with socket.create_connection(("127.0.0.1", self.rtsp_port), timeout=WAIT_S) as plain:
                plain.sendall(b"OPTIONS * RTSP/1.0\r\nCSeq: 1\r\n\r\n")
        wait_until(lambda: len(os.listdir(files)) <= before + 1, "their descriptors are given back")
        self.assertEqual(self.get("/healthz", certificate)[0], 200)
        self.assertEqual(self.play(f"rtsps://wall:{SECRET}@{stream}").returncode, 0)
        self.assertRegex(daemon.log_text(), rf"rtsps://127\.0\.0\.1:{self.rtsp_port}/left")
        self.assertEqual(daemon.stop(), 0)

    def test_a_new_certificate_comes_with_a_reload(self):
        certificate, key = self.certificate()
        daemon = self.start(self.text(certificate, key, tokens=False))
        self.assertEqual(self.play(f"rtsps://127.0.0.1:{self.rtsp_port}/left").returncode, 0)
        before = ssl.get_server_certificate(("127.0.0.1", self.http_port))
        self.certificate()
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_word("READY=1", count=2)
        wait_until(lambda: ssl.get_server_certificate(("127.0.0.1", self.http_port)) != before, "the new one is in force")
        self.assertEqual(self.get("/healthz", certificate)[0], 200)
        self.assertEqual(daemon.stop(), 0)

    def test_files_that_cannot_be_used_are_named(self):
        certificate, key = self.certificate()
        _, other = self.certificate("other")
        os.chmod(other, 0o644)
        for pair, reason in (((certificate, "missing"), "no such private key"), (("missing", key), "no such certificate"),
                             ((key, key), "no certificate in PEM"), ((certificate, certificate), "chmod|no private key"),
                             ((certificate, other), "everybody on this machine can read it")):
            config = self.write("sightline.toml", self.text(*pair))
            self.assertRegex(sightline("check", config, status=None)[1], reason)
        one = installation(extra=f'[access]\ncertificate = "{certificate}"\n')
        self.assertRegex(sightline("check", self.write("sightline.toml", one), status=2)[1], "certificate and key, or neither")


if __name__ == "__main__":
    unittest.main(verbosity=2)
