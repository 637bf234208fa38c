# SPDX-License-Identifier: Apache-2.0
"""What is seen of the daemon from outside while it runs: memory, descriptors, threads, log, notifications, health."""
import http.client
import os
import threading
import time

SAMPLE_S = 0.5
HEALTH_S = 1.0
TICKS = os.sysconf("SC_CLK_TCK")


def status_kb(pid, key):
    with open(f"/proc/{pid}/status", encoding="utf-8") as file:
        for line in file:
            if line.startswith(key + ":"):
                return int(line.split()[1])
    return 0


def cpu_seconds(pid):
    with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def machine_seconds():
    """(all, idle, stolen) of all cores since the start of the machine."""
    with open("/proc/stat", encoding="utf-8") as file:
        values = [int(v) / TICKS for v in file.readline().split()[1:9]]
    return sum(values), values[3] + values[4], values[7]


class Repeated(threading.Thread):
    """Does something at even times until stop()."""

    def __init__(self, period_s):
        super().__init__(daemon=True)
        self.period_s, self.ended = period_s, threading.Event()

    def run(self):
        due = time.monotonic()
        while not self.ended.is_set():
            self.step()
            due = max(due + self.period_s, time.monotonic())
            self.ended.wait(max(0, due - time.monotonic()))

    def step(self):
        raise NotImplementedError

    def stop(self):
        self.ended.set()
        self.join(timeout=30)


class Samples(Repeated):
    """Rows of what the kernel says of the daemon, what it logged since, and when it fed the watchdog."""

    def __init__(self, daemon):
        super().__init__(SAMPLE_S)
        self.daemon_process, self.pid = daemon, daemon.process.pid
        self.rows, self.fed, self.seen_words = [], [], 0
        self.log = open(daemon.log_path, "rb")

    def step(self):
        try:
            self.rows.append({"t": time.monotonic(), "rss_kb": status_kb(self.pid, "VmRSS"),
                              "threads": status_kb(self.pid, "Threads"),
                              "descriptors": len(os.listdir(f"/proc/{self.pid}/fd")),
                              "log_lines": self.log.read().count(b"\n"), "load": os.getloadavg()[0]})
        except OSError:
            return  # it has ended
        words = self.daemon_process.read_notifications()
        new, self.seen_words = words[self.seen_words:], len(words)
        self.fed += [time.monotonic() for word in new if word == "WATCHDOG=1"]

    def now(self):
        return self.rows[-1]


class Health(Repeated):
    """Asks for /healthz each second on a connection of its own, as a service monitor does."""

    def __init__(self, port):
        super().__init__(HEALTH_S)
        self.port, self.polls = port, []  # (when, seconds, "" or what was wrong)

    def step(self):
        since = time.monotonic()
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=HEALTH_S)
        try:
            connection.request("GET", "/healthz")
            answer = connection.getresponse()
            text = answer.read().decode(errors="replace").strip()
            problem = "" if answer.status == 200 else f"{answer.status} {text}"
        except (OSError, http.client.HTTPException) as error:
            problem = str(error) or type(error).__name__
        finally:
            connection.close()
        self.polls.append((since, time.monotonic() - since, problem))
