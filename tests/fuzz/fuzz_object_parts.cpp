// SPDX-License-Identifier: Apache-2.0
//
// What the files of an object name, which a recording takes along. The first byte chooses the kind
// of file.
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string_view>

#include "record/object_parts.hpp"
#include "sightline/base/check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static constexpr const char* kFiles[] = {"a.toml", "a.OBJ", "a.mtl", "a.gltf", "a.glb", "a.png"};
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  for (const auto& part :
       sightline::record::parts_named_by(kFiles[data[0] % std::size(kFiles)], text)) {
    SL_CHECK(!part.empty(), "a reference has a reading");
    // What stands percent-coded in an address is shorter when decoded.
    for (const auto& name : part)
      SL_CHECK(name.size() <= text.size(), "a name comes from the file");
  }
  return 0;
}
