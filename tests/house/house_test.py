#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests that the checks of the house can fail: each is given a small tree with one thing wrong."""
import os
import sys
import tempfile

sys.path.insert(0, os.path.dirname(__file__))
import cpp_text  # noqa: E402
import house  # noqa: E402

SPDX = "// SPDX-License-Identifier: Apache-2.0\n"
PLACE = "namespace sightline::fuse {\nstruct Place {\n  int x;\n};\nstruct Seen;\n}  // namespace sightline::fuse\n"
UNNAMED = "namespace sightline::fuse {\nnamespace {\nstruct Place {\n  int x;\n};\n}  // namespace\n}  // namespace sightline::fuse\n"
# (check, file, its text, findings); or files with their texts.
CASES = [
    ("arrows", "src/fuse/a.cpp", '#include "sightline/render/raster.hpp"\n', 1),
    ("arrows", "src/base/a.cpp", '#include "sightline/geometry/rigid3.hpp"\n', 1),
    ("arrows", "src/attic/a.cpp", "", 1),
    ("arrows", "src/fuse/a.cpp", '#include "sightline/model/frame.hpp"\n', 0),
    ("arrows", "daemon/a.cpp", '#include "sightline/stream/encoder.hpp"\n', 0),
    ("arrows", "src/pipeline/a.cpp", '#include "sightline/config/installation.hpp"\n', 0),
    ("arrows", "src/config/a.cpp", '#include "sightline/pipeline/rig.hpp"\n', 1),
    ("arrows", "cli/a.cpp", '#include "sightline/pipeline/rig.hpp"\n', 0),
    ("subroom_arrows", "src/observe/track/a.cpp", '#include "sightline/observe/detect/b.hpp"\n', 1),
    ("subroom_arrows", "src/observe/track/a.cpp", '#include "observe/scene/b.hpp"\n', 1),
    ("subroom_arrows", "src/observe/track/a.cpp", '#include "observe/terms/b.hpp"\n', 0),
    ("subroom_arrows", "src/observe/terms/a.cpp", '#include "observe/shape/b.hpp"\n', 1),
    ("subroom_arrows", "include/sightline/observe/terms/a.hpp", '#include "sightline/observe/shape/b.hpp"\n', 1),
    ("subroom_arrows", "src/observe/a.cpp", "", 1),
    ("subroom_arrows", "src/capture/common/a.cpp", '#include "capture/decode/b.hpp"\n', 1),
    ("subroom_arrows", "src/capture/v4l2/a.cpp", '#include "capture/libcamera/b.hpp"\n', 1),
    ("subroom_arrows", "src/render/raster/a.cpp", '#include "sightline/render/overlay/b.hpp"\n', 1),
    ("subroom_arrows", "src/render/overlay/a.cpp", '#include "render/gpu/b.hpp"\n', 0),
    ("private_headers", "src/fuse/a.cpp", '#include "record/csv.hpp"\n', 1),
    ("private_headers", "src/fuse/a.cpp", '#include "history.hpp"\n', 1),
    ("private_headers", "src/fuse/a.cpp", '#include "fuse/history.hpp"\n', 0),
    ("private_headers", "include/sightline/fuse/a.hpp", '#include "fuse/history.hpp"\n', 1),
    ("private_headers", "daemon/a.cpp", '#include "fuse/history.hpp"\n', 1),
    ("private_headers", "daemon/a.cpp", '#include "a.cpp"\n', 0),
    ("private_headers", "cli/a.cpp", '#include "camera_worker.hpp"\n', 1),
    ("private_headers", "cli/a.cpp", '#include "daemon.hpp"\n', 0),
    ("private_namespaces", "src/fuse/a.hpp", "namespace sightline {\n}\n", 1),
    ("private_namespaces", "src/fuse/a.hpp", "namespace sightline::render {\n}\n", 1),
    ("private_namespaces", "src/fuse/a.hpp", "namespace sightline::fuse::kernels {\n}\n", 0),
    ("one_definition", {"src/fuse/a.hpp": PLACE, "src/fuse/b.hpp": PLACE}, None, 1),
    ("one_definition", {"src/fuse/a.cpp": PLACE, "daemon/b.hpp": PLACE.replace("struct", "class")}, None, 1),
    ("one_definition", {"src/fuse/a.hpp": PLACE, "src/fuse/b.hpp": PLACE.replace("fuse", "render")}, None, 0),
    ("one_definition", {"src/fuse/a.cpp": PLACE, "src/fuse/b.cpp": UNNAMED, "src/fuse/c.cpp": UNNAMED}, None, 0),
    ("program_sources", "tests/fuse/CMakeLists.txt", "add_executable(a ../../daemon/daemon.cpp)\n", 1),
    ("program_sources", "bench/CMakeLists.txt", "SOURCES ${PROJECT_SOURCE_DIR}/cli/report.cpp\n", 1),
    ("program_sources", "tests/daemon/CMakeLists.txt", "SOURCES daemon_test.cpp\n", 0),
    ("lengths", "src/fuse/a.cpp", "int x;\n" * 451, 1),
    ("lengths", "src/fuse/a.cpp", "int x;\n" * 450, 0),
    ("lengths", "src/fuse/a.cpp", "int f() {\n" + "  x();\n" * 59 + "}\n", 1),
    ("lengths", "src/fuse/a.cpp", "int f() {\n" + "  x();\n" * 58 + "}\n", 0),
    ("lengths", "tests/fuse/a.cpp", "int f() {\n" + "  x();\n" * 139 + "}\n", 1),
    ("lengths", "tests/fuse/a.cpp", "int f() {\n" + "  x();\n" * 138 + "}\n", 0),
    ("spelling", "src/fuse/a.cpp", "// the colour of it\n", 1),
    ("spelling", "docs/a.md", "two millimetres\n", 1),
    ("spelling", "docs/a.md", "symmetric, parameter, color, GREY\n", 0),
    ("license", "src/fuse/a.cpp", "int x;\n", 1),
    ("license", "src/fuse/a.cpp", SPDX, 0),
    ("vendor_headers", "include/sightline/observe/a.hpp", "#include <opencv2/core.hpp>\n", 1),
    ("vendor_headers", "src/observe/a.cpp", "#include <opencv2/core.hpp>\n", 0),
    ("line_length", "src/fuse/a.cpp", "// " + "x" * 100 + "\n", 1),
    ("paths", "docs/a.md", "see /ho" "me/somebody/file\n", 1),
]

FUNCTIONS = """namespace a {
struct B : C {
  B() : x_(1), y_{2} {}
  int f() const {
    return '{' + sizeof("}") + 1'000;  // {
  }
  std::array<int, 2> z_{1, 2};
};
const auto kTable = std::array{
    1,
};
template <typename T>
  requires(sizeof(T) > 1)
auto g(T t) -> int {
  if (t) {
    return [] { return 1; }();
  }
  return 0;
}
TEST(B, IsGood) {
  g(2);
}
}
"""


def check_functions():
    found = [(name, first, number) for first, number, name in cpp_text.functions(FUNCTIONS)]
    long = [entry for entry in found if entry[2] > 1]
    expected = [("f", 4, 3), ("g", 13, 8), ("TEST", 21, 3)]
    if [entry[2] for entry in long] == [entry[2] for entry in expected] and len(long) == 3:
        return 0
    print(f"functions: found {long}, expected {expected}")
    return 1


def check_folders():
    with tempfile.TemporaryDirectory() as root:
        os.makedirs(os.path.join(root, "src/fuse"))
        for number in range(31):
            with open(os.path.join(root, f"src/fuse/{number}.cpp"), "w", encoding="utf-8"):
                pass
        if len(list(house.folders(root))) == 1:
            return 0
    print("folders: 31 files were not found")
    return 1


failed = check_functions() + check_folders()
for check, name, content, expected in CASES:
    with tempfile.TemporaryDirectory() as root:
        for path, text in (name if isinstance(name, dict) else {name: content}).items():
            os.makedirs(os.path.join(root, os.path.dirname(path)), exist_ok=True)
            with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                file.write(text)
        found = len(list(house.CHECKS[check](root)))
        if (found > 0) != (expected > 0):
            print(f"{check} on {name}: {found} findings, expected {expected}")
            failed += 1
print(f"{len(CASES) + 2 - failed} of {len(CASES) + 2} cases right")
sys.exit(1 if failed else 0)
