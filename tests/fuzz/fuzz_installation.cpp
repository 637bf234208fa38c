// SPDX-License-Identifier: Apache-2.0
// Installation and object files from memory, in a made-up world of files.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "../config/fake_files.hpp"
#include "sightline/config/cell_draft.hpp"
#include "sightline/config/object_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  static const InstallationFiles files = test::fake_files();
  const auto installation = parse_installation(text, "dir/cell.toml", files);
  if (installation) {
    SL_CHECK(!installation->cameras.empty() || installation->cell.role == CellRole::kFusion,
             "an installation has cameras, or another host has");
    SL_CHECK(compare(*installation, *installation).none(), "equal to itself");
  } else {
    SL_CHECK(!installation.error().where.empty(), "every mistake has its place");
  }
  if (const auto draft = read_cell_draft(text, "dir/cell.toml")) {
    const std::string section = "[cell]\nrole = \"fusion\"\nbroker = \"b\"\nhost = \"h\"\n";
    const std::string lines = std::string(text) + "\n";  // as `sightline cell init` reads it
    const auto again = read_cell_draft(with_cell(lines, *draft, {}, section), "dir/cell.toml");
    SL_CHECK(again && again->cameras.size() == draft->cameras.size() && again->host == "h",
             "what is written can be read");
  }
  const auto object = parse_object_file(text, "dir/object.toml", files.is_file);
  SL_CHECK(object || !object.error().where.empty(), "every mistake has its place");
  return 0;
}
