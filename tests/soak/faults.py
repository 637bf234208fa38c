# SPDX-License-Identifier: Apache-2.0
"""The faults of a soak, each begun at its time and mended when it has lasted."""
import threading
import time

import rig as parts
from rig import ENDLESS, KINDS, NAMES, pick
from verdict import IMPOSSIBLE


class Faults:
    """One fault of a kind at a time; what is drawn while one lasts is left out, and that is counted, too."""

    def __init__(self, rig):
        self.rig, self.counts, self.watchers, self.threads = rig, {}, [], []
        self.running, self.lock = set(), threading.Lock()

    def begin(self, kind, seconds, number):
        if kind == "viewer":
            watcher = parts.Watching(self.rig.rtsp, pick(NAMES, number), seconds)
            self.watchers.append(watcher)
            watcher.start()
            self.threads.append(watcher)
            return self.count(kind)
        alone = kind not in ("viewer_stops_reading", "events_reader", "pictures")
        with self.lock:
            if alone and kind in self.running:
                return self.count("left out")
            self.running.add(kind)
        thread = threading.Thread(target=self.live, args=(kind, seconds, number), daemon=True)
        self.threads.append(thread)
        thread.start()
        return None

    def count(self, kind):
        self.counts[kind] = self.counts.get(kind, 0) + 1

    def live(self, kind, seconds, number):
        """Counts what took place, not what was begun."""
        try:
            done = getattr(self, kind)(seconds, number)
            self.count(kind if done is not False else kind + IMPOSSIBLE)
        except Exception as error:  # of a thread: the verdict says what was not done
            print(f"fault {kind}: {error!r}", flush=True)
            self.count(kind + " failed")
        finally:
            with self.lock:
                self.running.discard(kind)

    def calm(self, patience_s):
        """Waits until every fault is mended and every viewer has left."""
        end = time.monotonic() + patience_s
        for thread in self.threads:
            thread.join(timeout=max(0.1, end - time.monotonic()))
        left = [thread for thread in self.threads if thread.is_alive()]
        self.threads = left
        return not left

    def camera_dies(self, seconds, _):
        self.rig.source.process.kill()
        self.rig.source.close()
        time.sleep(seconds)
        self.rig.start_source()

    def viewer_stops_reading(self, seconds, number):
        parts.stop_reading(self.rig.rtsp, pick(NAMES, number), seconds)

    def events_reader(self, seconds, _):
        parts.read_endless(self.rig.http, ENDLESS[0], seconds)

    def pictures(self, seconds, number):
        parts.read_endless(self.rig.http, pick(ENDLESS[1:], number), seconds)

    def reload(self, _, number):
        with self.rig.reloading:
            self.rig.reload(number=number)
            time.sleep(1)

    def bad_reload(self, _, number):
        with self.rig.reloading:
            self.rig.reload("[rtps]\n", number)
            time.sleep(1)
            self.rig.reload(number=number)

    def recording(self, seconds, number):
        kinds = [pick(KINDS, number)]
        self.rig.order("/api/v1/recordings/start", {"kinds": kinds})
        time.sleep(seconds)
        self.rig.order("/api/v1/recordings/stop", {"kinds": kinds})

    def broker_away(self, seconds, _):
        if not self.rig.broker:
            return False
        self.rig.broker.kill()
        self.rig.broker.wait()
        time.sleep(seconds)
        self.rig.start_broker()
        return True

    def disk_full(self, seconds, _):
        if not self.rig.disk:
            return False
        self.rig.disk.set("full")
        time.sleep(seconds)
        self.rig.disk.set("")
        return True

    def order_overlay(self, seconds, number):
        self.rig.order("/api/v1/overlay", {"camera": pick(NAMES, number), "theme": "high_contrast"}, "PUT")
        time.sleep(seconds)
        self.rig.order("/api/v1/overlay", {}, "DELETE")
