#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fits the constants of src/pipeline/search_cost.cpp to what measure_search_cost has printed.

    bench/fit_search_cost.py CSV ...

Least squares on relative errors, no constant below zero. What the check of a place costs is given: the steps of the
climbs, of which there are the more the more places were checked, cannot be told from it.
"""
import csv
import math
import sys

UNITS = "images places checked scored masks overlaps looked_at fits textures near_poses".split()
CHECKED_NS = 100
CHECKED = UNITS.index("checked")


def read(paths):
    rows = []
    for path in paths:
        with open(path, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                if float(row["cpu_ms"]) > 0.05:
                    rows.append((path, row["what"], [float(row[unit]) for unit in UNITS], 1e6 * float(row["cpu_ms"])))
    return rows


def fit(counts, cpu):
    """Coordinate descent on the normal equations, scaled."""
    size = len(UNITS)
    scale = [max(row[i] for row in counts) or 1 for i in range(size)]
    weights = [1 / (ns + 1e7) for ns in cpu]
    scaled = [[value / s * w for value, s in zip(row, scale)] for row, w in zip(counts, weights)]
    target = [(ns - CHECKED_NS * row[CHECKED]) * w for row, ns, w in zip(counts, cpu, weights)]
    matrix = [[sum(row[i] * row[j] for row in scaled) for j in range(size)] for i in range(size)]
    right = [sum(row[i] * value for row, value in zip(scaled, target)) for i in range(size)]
    x = [0.0] * size
    for _ in range(20000):
        for i in range(size):
            if matrix[i][i] > 0 and i != CHECKED:
                rest = right[i] - sum(matrix[i][j] * x[j] for j in range(size) if j != i)
                x[i] = max(0.0, rest / matrix[i][i])
    x = [value / s for value, s in zip(x, scale)]
    x[CHECKED] = CHECKED_NS
    return x


def main():
    rows = read(sys.argv[1:])
    if not rows:
        sys.exit(__doc__)
    constants = fit([row[2] for row in rows], [row[3] for row in rows])
    for unit, value in zip(UNITS, constants):
        print(f"{unit:10} {value:14.2f} ns")
    for path, what in sorted({row[:2] for row in rows}):
        those = [row for row in rows if row[:2] == (path, what)]
        off = [sum(a * b for a, b in zip(row[2], constants)) / row[3] - 1 for row in those]
        mean = sum(row[3] for row in those) / len(those) * 1e-6
        print(f"{path} {what}: {len(those)}, {mean:.0f} ms; model off by {math.sqrt(sum(o * o for o in off) / len(off)):.1%}")


if __name__ == "__main__":
    main()
