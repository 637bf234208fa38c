#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The judge of a soak: what leaks is seen, what is well passes; and a plan is its seed's."""
import unittest

import plan
import verdict


def row(rss_kb=200_000, descriptors=40, threads=60):
    return {"rss_kb": rss_kb, "descriptors": descriptors, "threads": threads, "most_descriptors": descriptors,
            "most_threads": threads}


def well(**changes):
    seen = {"calm": [row(180_000), row(190_000)] + [row()] * 10, "counts": {"reload": 3, "viewer": 10}, "planned": ["reload", "viewer"],
            "polls": [(0, 0.01, "")] * 100, "fed": [0, 1, 2, 3], "opened": {"cam0": 0}, "present": {"cam0": True},
            "stop": (1.0, 0), "viewers": {"all": 10, "with_frames": 10}}
    return dict(seen, **changes)


def failing(seen):
    return [what for what, ok, _, _ in verdict.judge(seen) if not ok]


class Judge(unittest.TestCase):
    def test_what_is_well_passes(self):
        self.assertEqual(failing(well()), [])

    def test_what_is_not_is_seen(self):
        leak = [row(200_000 + 2_000 * i, 40 + i, 60) for i in range(12)]
        self.assertEqual(failing(well(calm=leak)), ["memory: growth after the warm-up",
                                                    "descriptors: more at the end than after the warm-up"])
        for change in ({"polls": [(0, 1, "503")] * 9}, {"polls": []}, {"fed": [0, 9]}, {"opened": {"cam0": 1}},
                       {"present": {"cam0": False}}, {"counts": {}}, {"stop": (1.0, 1)}, {"stop": (30.0, 0)},
                       {"viewers": {"all": 10, "with_frames": 5}}, {"calm": [row(threads=60 + 2 * i) for i in range(12)]}):
            self.assertEqual(len(failing(well(**change))), 1, change)

    def test_growth_before_the_warm_up_ends_is_none(self):
        self.assertEqual(verdict.growth([row(100_000), row(150_000)] + [row()] * 6)[0], 0)


class Plan(unittest.TestCase):
    def test_is_its_seeds(self):
        self.assertEqual(plan.make(7, 5), plan.make(7, 5))
        self.assertNotEqual(plan.make(7, 5), plan.make(8, 5))

    def test_has_everything_and_is_calm_at_the_end_of_each_cycle(self):
        made = plan.make(1, 2)
        self.assertEqual(set(plan.KINDS) - {kind for _, kind, _, _ in made}, set())
        for at, kind, lasts, _ in made:
            self.assertLessEqual(at % plan.CYCLE_S + lasts, plan.CYCLE_S - plan.CALM_S + 1e-6, kind)


if __name__ == "__main__":
    unittest.main()
