#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A judge who cannot say no is none: each criterion of the siege fails on what it is there for, and on that alone."""
import os
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import judge  # noqa: E402
from viewer import Depacketizer  # noqa: E402

PERIOD_NS = 33_333_333


def seen(count=300, problem="", **changes):
    frames = [[i * PERIOD_NS, 1, i, i * PERIOD_NS] for i in range(count)]
    for index, frame in changes.get("frames", {}).items():
        frames[int(index)] = frame
    frames = [f for f in frames if f]
    return {"frames": frames, "problem": problem, "packets_lost": 0, "without_message": 0, "seconds": count / 30,
            "stalls": changes.get("stalls", [])}


def rows(count=40, **changes):
    out = [{"t": 0.5 * i, "rss_kb": 300_000, "threads": 50, "descriptors": 60, "log_lines": 1, "load": 1.0} for i in range(count)]
    for index, change in changes.get("rows", {}).items():
        out[int(index)].update(change)
    return out


CALM = {"rss_kb": 300_000, "threads": 50, "descriptors": 60}


class Judged(unittest.TestCase):
    def failed(self, function, *arguments):
        verdict = judge.Verdict()
        function(verdict, *arguments)
        return [c["criterion"] for c in verdict.criteria if not c["ok"]]

    def only(self, part, failed):
        self.assertEqual(len(failed), 1, failed)
        self.assertIn(part, failed[0])

    def test_frames(self):
        frames = lambda s, drops=None: self.failed(judge.judge_frames, s, drops or {"encode": 0})  # noqa: E731
        self.assertEqual(frames(seen()), [])
        self.only("frames missing", frames(seen(frames={"7": None})))
        self.only("longest gap", frames(seen(frames={str(i): [i * PERIOD_NS + 110_000_000, 1, i, 0] for i in range(50, 300)})))
        self.only("shown again", frames(seen(frames={str(i): [i * PERIOD_NS, 1, i - 1, 0] for i in range(7, 300)})))
        self.only("opened again", frames(seen(frames={str(i): [i * PERIOD_NS, 2, i, 0] for i in range(9, 300)})))
        self.only("connected", frames(seen(problem="closed")))
        self.only("dropped", frames(seen(), {"encode": 1}))
        self.only("dropped", self.failed(judge.judge_frames, seen(), None))

    def test_the_machine_answers_for_what_it_did(self):
        frames = {str(i): [i * PERIOD_NS + 110_000_000, 1, i, 0] for i in range(50, 300)}
        frames["50"] = None
        late = seen(frames=frames, stalls=[(50 * PERIOD_NS + 100_000_000, 0.12)])
        self.assertEqual(self.failed(judge.judge_frames, late, {"draw": 1}), [])
        self.only("dropped", self.failed(judge.judge_frames, late, {"draw": 2}))
        elsewhere = seen(frames=frames, stalls=[(20 * PERIOD_NS, 0.12)])
        self.assertEqual(len(self.failed(judge.judge_frames, elsewhere, {"draw": 1})), 3)

    def test_resources(self):
        judged = lambda r, settled=CALM: self.failed(judge.judge_resources, r, CALM, settled)  # noqa: E731
        self.assertEqual(judged(rows()), [])
        self.only("highest", judged(rows(rows={"3": {"rss_kb": 900_000}})))
        self.only("growth", judged(rows(rows={str(i): {"rss_kb": 400_000} for i in range(28, 40)})))
        self.only("descriptors", judged(rows(), dict(CALM, descriptors=90)))
        self.only("threads", judged(rows(), dict(CALM, threads=90)))

    def test_signs_of_life(self):
        polls = [(i, 0.01, "") for i in range(20)]
        fed = [0.5 * i for i in range(40)]

        def judged(r=None, p=None, f=None):
            return self.failed(judge.judge_signs_of_life, r or rows(), p or polls, f or fed)

        self.assertEqual(judged(), [])
        self.only("most lines", judged(rows(rows={"5": {"log_lines": 30}, "6": {"log_lines": 30}})))
        self.only("on average", judged(rows(rows={str(i): {"log_lines": 8} for i in range(40)})))
        self.only("health", judged(p=polls[:10] + [(10, 1.0, "timed out")] + polls[11:]))
        self.only("health", judged(p=polls[:3]))
        self.only("watchdog", judged(f=fed[:10] + fed[20:]))

    def test_attacks_reloads_and_stop(self):
        good = {"attacks": {"a": {"least": {"connections": 10}, "counts": {"connections": 25}}}, "errors": []}
        self.assertEqual(self.failed(judge.judge_attacks, good, 120), [])
        self.only("took place", self.failed(judge.judge_attacks, dict(good, attacks={
            "a": {"least": {"connections": 10}, "counts": {}}}), 120))
        self.only("mistakes", self.failed(judge.judge_attacks, dict(good, errors=["oops"]), 120))
        self.only("could watch", self.failed(judge.judge_attacks, dict(good, attacks={
            "rtsp_sixty_viewers": {"least": {}, "counts": {"played": 80, "turned_away": 20}}}), 120))
        self.only("tunnels", self.failed(judge.judge_attacks, dict(good, attacks={
            "rtsp_http_tunnel_foreign_host": {"least": {}, "counts": {"tunnels_opened": 1}}}), 120))
        self.only("foreign", self.failed(judge.judge_attacks, dict(good, attacks={
            "http_foreign_host": {"least": {}, "counts": {"answer_200": 1}}}), 120))
        self.only("reloads", self.failed(judge.judge_reloads, [{"ok": True, "what": ""}, {"ok": False, "what": "x"}]))
        self.only("reloads", self.failed(judge.judge_reloads, []))
        self.only("seconds", self.failed(judge.judge_stop, 2.4, 0))
        self.only("status", self.failed(judge.judge_stop, 0.4, 1))


    def test_a_busy_machine_excuses_times_and_nothing_else(self):
        verdict = judge.Verdict()
        judge.judge_stop(verdict, 0.4, 0)
        self.assertTrue(verdict.passed())
        judge.judge_frames(verdict, seen(frames={"7": None}), {"encode": 0})
        self.assertFalse(verdict.passed())
        self.assertTrue(verdict.passed_but_for_times())
        judge.judge_stop(verdict, 0.4, 1)
        self.assertFalse(verdict.passed_but_for_times())

    def test_what_no_busy_machine_explains(self):
        frames = {str(i): None for i in range(7, 200)}
        polls = [(i, 1.0, "timed out") for i in range(20)]
        for function, arguments in ((judge.judge_frames, (seen(frames=frames), {"encode": 0})),
                                    (judge.judge_stop, (25, 0)),
                                    (judge.judge_signs_of_life, (rows(), polls, [0.5 * i for i in range(40)])),
                                    (judge.judge_signs_of_life, (rows(), polls[:1], [0, 19]))):
            verdict = judge.Verdict()
            function(verdict, *arguments)
            self.assertFalse(verdict.passed_but_for_times(), function.__name__)


class Packets(unittest.TestCase):
    def test_a_missing_packet_is_counted(self):
        depacketizer = Depacketizer()
        for number in (65534, 65535, 0, 3):
            depacketizer.packet(bytes([0x80, 96]) + number.to_bytes(2, "big") + bytes(8) + b"\x61\x80")
        self.assertEqual(depacketizer.lost, 2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
