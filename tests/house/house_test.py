#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests that the checks of the house can fail: each is given a small tree with one thing wrong."""
import os
import sys
import tempfile

sys.path.insert(0, os.path.dirname(__file__))
import house  # noqa: E402

SPDX = "// SPDX-License-Identifier: Apache-2.0\n"
CASES = [
    ("arrows", "src/fuse/a.cpp", '#include "sightline/render/raster.hpp"\n', 1),
    ("arrows", "src/base/a.cpp", '#include "sightline/geometry/rigid3.hpp"\n', 1),
    ("arrows", "src/attic/a.cpp", "", 1),
    ("arrows", "src/fuse/a.cpp", '#include "sightline/model/frame.hpp"\n', 0),
    ("arrows", "daemon/a.cpp", '#include "sightline/stream/encoder.hpp"\n', 0),
    ("licence", "src/fuse/a.cpp", "int x;\n", 1),
    ("licence", "src/fuse/a.cpp", SPDX, 0),
    ("vendor_headers", "include/sightline/observe/a.hpp", "#include <opencv2/core.hpp>\n", 1),
    ("vendor_headers", "src/observe/a.cpp", "#include <opencv2/core.hpp>\n", 0),
    ("line_length", "src/fuse/a.cpp", "// " + "x" * 100 + "\n", 1),
    ("paths", "docs/a.md", "see /ho" "me/somebody/file\n", 1),
]

failed = 0
for check, name, content, expected in CASES:
    with tempfile.TemporaryDirectory() as root:
        os.makedirs(os.path.join(root, os.path.dirname(name)))
        with open(os.path.join(root, name), "w", encoding="utf-8") as file:
            file.write(content)
        found = len(list(house.CHECKS[check](root)))
        if (found > 0) != (expected > 0):
            print(f"{check} on {name}: {found} findings, expected {expected}")
            failed += 1
print(f"{len(CASES) - failed} of {len(CASES)} cases right")
sys.exit(1 if failed else 0)
