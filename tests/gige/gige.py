# SPDX-License-Identifier: Apache-2.0
"""Simulated GigE Vision cameras as processes, in a network namespace of the test's own. Every wait is bounded."""
import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
import time

WAIT_S = float(os.environ.get("SIGHTLINE_TEST_WAIT_S", "90"))
ADDRESSES = ["127.0.0.2", "127.0.0.3", "127.0.0.4", "127.0.0.5"]
MARK = "SIGHTLINE_IN_NAMESPACE"


def enter_namespace(*tools):
    """Runs this program again inside user and network namespaces, with loopback up and some addresses. Exits 77,
    which means skipped, where a tool is missing or no namespace can be made."""
    if os.environ.get(MARK) == "1":
        return
    for tool in ("unshare", "ip", *tools):
        if shutil.which(tool) is None:
            print(f"skipped: no {tool} (scripts/deps installs it)")
            sys.exit(77)
    setup = "ip link set lo up" + "".join(f" && ip addr add {a}/8 dev lo" for a in ADDRESSES)
    probe = subprocess.run(["unshare", "-Urn", "sh", "-c", setup], capture_output=True, text=True, timeout=WAIT_S,
                           check=False)
    if probe.returncode != 0:
        print(f"skipped: cannot make a network namespace here: {probe.stderr.strip()}")
        sys.exit(77)
    command = ["unshare", "-Urn", "sh", "-c", setup + ' && exec "$@"', "sh", sys.executable, *sys.argv]
    os.execvpe("unshare", command, dict(os.environ, **{MARK: "1"}))


class Lines:
    """A process whose lines can be waited for."""

    def __init__(self, command, **options):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options)
        self.lines = []
        self.new = queue.Queue()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))
            self.new.put(line.rstrip("\n"))
        self.new.put(None)

    def wait_for(self, condition, what):
        """The next line that fulfils the condition; those before it are not looked at again."""
        end = time.monotonic() + WAIT_S
        while True:
            try:
                line = self.new.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                line = None
            if line is None:
                raise AssertionError(f"never saw {what}; the last lines:\n" + "\n".join(self.lines[-15:]))
            if condition(line):
                return line

    def close(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
        self.process.wait(timeout=WAIT_S)
        self.process.stdin.close()
        self.reader.join(timeout=WAIT_S)
        self.process.stdout.close()


class Simulator(Lines):
    """One gige_simulator; options as on its command line, settings as `loss=0.01`."""

    def __init__(self, program, address, *options, **settings):
        self.command = [program, "--address", address, *map(str, options)]
        for name, value in settings.items():
            self.command += ["--set", f"{name.replace('_', '-')}={value}"]
        super().__init__(self.command)
        self.wait_for(lambda line: line == "ready", "the simulator's start")

    def set(self, name, value=1):
        """Sets a fault, or makes something happen, and waits until it is done."""
        self.process.stdin.write(f"{name} {value}\n")
        self.process.stdin.flush()
        self.wait_for(lambda line: line == f"ok {name}", f"an answer to {name}")

    def stop(self):
        self.process.send_signal(signal.SIGSTOP)

    def go_on(self):
        self.process.send_signal(signal.SIGCONT)
