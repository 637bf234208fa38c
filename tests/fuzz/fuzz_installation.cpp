// SPDX-License-Identifier: Apache-2.0
// Installation and object files from memory, in a made-up world of files.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "../config/fake_files.hpp"
#include "sightline/config/object_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  static const InstallationFiles files = test::fake_files();
  const auto installation = parse_installation(text, "dir/cell.toml", files);
  if (installation) {
    SL_CHECK(!installation->cameras.empty(), "an installation has cameras");
    SL_CHECK(compare(*installation, *installation).none(), "equal to itself");
  } else {
    SL_CHECK(!installation.error().where.empty(), "every mistake has its place");
  }
  const auto object = parse_object_file(text, "dir/object.toml", files.is_file);
  SL_CHECK(object || !object.error().where.empty(), "every mistake has its place");
  return 0;
}
