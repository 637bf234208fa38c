# SPDX-License-Identifier: Apache-2.0
"""A disk for recordings that is slow for a while, then full, then well again (slow_disk.cpp)."""
import collections
import os
import shutil
import threading

ROOM_BYTES = 2 << 30  # recordings take 3 MB/s, and old ones go every CYCLE
CYCLE = (("", 10), ("slow", 15), ("full", 8))  # state and its seconds, again and again


def in_memory():
    """A folder without a disk of its own under it, which nobody else can make slow; None if there is none with room."""
    folder = "/dev/shm"
    return folder if os.access(folder, os.W_OK) and shutil.disk_usage(folder).free > ROOM_BYTES else None


class Disk:
    def __init__(self, library, folder):
        self.library, self.folder = library, os.path.join(in_memory() or folder, os.path.basename(folder) + ".recordings")
        self.control = os.path.join(folder, "disk_fault")
        os.makedirs(self.folder)
        self.set("")
        self.ended, self.thread = threading.Event(), None

    def configuration(self):
        return f'[record]\nenabled = true\ndirectory = "{self.folder}"\n'

    def environment(self):
        return {"LD_PRELOAD": self.library, "SIGHTLINE_DISK_FAULT": self.control, "SIGHTLINE_DISK_FOLDER": self.folder}

    def set(self, state):
        with open(self.control, "w", encoding="utf-8") as file:
            file.write(state)

    def start(self):
        self.ended.clear()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def stop(self):
        """The disk is well from here on."""
        self.ended.set()
        self.thread.join()
        self.set("")

    def run(self):
        while True:
            for state, seconds in CYCLE:
                self.set(state)
                if self.ended.wait(seconds):
                    return
            self.make_room()

    def remove(self):
        shutil.rmtree(self.folder, ignore_errors=True)

    def recordings(self):
        return sorted(os.path.join(self.folder, name) for name in os.listdir(self.folder))

    def make_room(self):
        """A siege of an hour would fill a real disk: all but the newest go."""
        for old in self.recordings()[:-2]:
            shutil.rmtree(old, ignore_errors=True)

    def counts(self):
        try:
            with open(self.control + ".done", encoding="utf-8") as file:
                done = collections.Counter(file.read())
        except FileNotFoundError:
            done = {}
        return {"slow_syncs": done.get("s", 0), "refused_writes": done.get("f", 0)}
