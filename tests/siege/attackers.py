#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""All attackers in one process of the lowest priority. Started by siege.py, which speaks to it in lines of JSON: it is told
the target, then `start`, `pause` or `stop`, and answers each with what the attacks achieved until then."""
import asyncio
import json
import os
import sys
import traceback

import hostile_cameras
import http_attacks
import rtsp_attacks
from wire import Target


class Squad:
    def __init__(self, target, only):
        kinds = rtsp_attacks.ATTACKS + http_attacks.ATTACKS
        self.attacks = [kind(target) for kind in kinds if not only or kind.name in only]
        self.errors, self.tasks = [], []

    async def keep_up(self, attack):
        while True:
            try:
                await attack.run()
            except Exception:  # pylint: disable=broad-except
                self.errors.append(f"{attack.name}: {traceback.format_exc(limit=-4)}")
                await asyncio.sleep(1)

    def start(self):
        self.tasks = [asyncio.create_task(self.keep_up(attack)) for attack in self.attacks]

    async def pause(self):
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)
        self.tasks = []

    def report(self, cameras):
        rows = {a.name: {"least": a.least, "counts": dict(a.counts)} for a in self.attacks}
        rows.update({"camera_" + c.name: {"least": {"connections": 1, "bytes_sent": 10_000}, "counts": dict(c.counts)}
                     for c in cameras})
        return {"attacks": rows, "errors": self.errors[:5]}


def say(what):
    print(json.dumps(what), flush=True)


async def main():
    os.setpriority(os.PRIO_PROCESS, 0, 19)
    loop = asyncio.get_running_loop()

    async def hear():
        return await loop.run_in_executor(None, sys.stdin.readline)

    cameras = hostile_cameras.make()
    say({camera.name: await camera.start() for camera in cameras})
    told = json.loads(await hear())
    squad = Squad(Target(told["rtsp"], told["http"], tuple(told["cameras"]), told["max_clients"]), told["only"])
    while command := (await hear()).strip():
        if command == "start":
            squad.start()
        else:
            await squad.pause()
        say(squad.report(cameras))
        if command == "stop":
            return


if __name__ == "__main__":
    asyncio.run(main())
