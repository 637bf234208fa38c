#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A shelf of USB cameras beside the guest: plugs them in, pulls them and passes commands on.

shelf.py PROGRAMS PICTURES, with VMRIG_USB (folder of the sockets usb0 to usb3) and VMRIG_OUT from
run-in-guest.sh. The guest asks by files: VMRIG_OUT/shelf/NAME.ask holds one line, NAME.done appears when it
is done, with a complaint in it if it failed.
    plug PORT uvc|u3v SERIAL [option ...]
    unplug PORT
    say PORT COMMAND ...           what the camera's program takes: cut 3, stall, freeze, ...
"""
import os
import subprocess
import sys
import time

PROGRAMS, PICTURES = sys.argv[1:3]
USB = os.environ["VMRIG_USB"]
ASKED = os.path.join(os.environ["VMRIG_OUT"], "shelf")


class Shelf:
    def __init__(self):
        self.cameras = {}

    def plug(self, port, kind, serial, *options):
        if self.running(port):
            return f"{port} is taken"
        command = [os.path.join(PROGRAMS, "fake-" + kind), "-s", serial, *options]
        if kind == "uvc":
            command += ["-j", PICTURES]
        self.cameras[port] = subprocess.Popen([*command, os.path.join(USB, port)], stdin=subprocess.PIPE, text=True)
        return ""

    def unplug(self, port):
        if not self.running(port):
            return f"nothing is plugged in at {port}"
        self.say(port, "unplug")
        try:
            self.cameras[port].wait(timeout=5)
        except subprocess.TimeoutExpired:
            self.cameras[port].kill()
            self.cameras[port].wait(timeout=5)
            return f"the camera at {port} had to be killed"
        return ""

    def say(self, port, *words):
        if not self.running(port):
            return f"nothing is plugged in at {port}"
        self.cameras[port].stdin.write(" ".join(words) + "\n")
        self.cameras[port].stdin.flush()
        return ""

    def running(self, port):
        return port in self.cameras and self.cameras[port].poll() is None

    def answer(self, line):
        what, *rest = line.split()
        if what not in ("plug", "unplug", "say"):
            return f"unknown: {line}"
        try:
            return getattr(self, what)(*rest)
        except (OSError, TypeError) as error:
            return str(error)


def main():
    os.makedirs(ASKED, exist_ok=True)
    shelf = Shelf()
    while True:
        for name in sorted(name for name in os.listdir(ASKED) if name.endswith(".ask")):
            path = os.path.join(ASKED, name)
            with open(path, encoding="utf-8") as file:
                complaint = shelf.answer(file.read().strip())
            with open(path, "w", encoding="utf-8") as file:
                file.write(complaint)
            os.rename(path, path[:-len("ask")] + "done")
        time.sleep(0.02)


main()
