// SPDX-License-Identifier: Apache-2.0
//
// Depth of the static scene: OpenEXR, PNG and TIFF, told by their first bytes.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "sightline/record/still_image.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto image = parse_depth_image(bytes, "fuzz", 0.001);
  if (!image) {
    SL_CHECK(!image.error().where.empty(), "every mistake names its file");
    return 0;
  }
  SL_CHECK(
      image->depth.size() == static_cast<size_t>(image->width) * static_cast<size_t>(image->height),
      "a number for every pixel");
  for (const float depth : image->depth) {
    SL_CHECK(std::isfinite(depth) && depth >= 0, "a depth or none");
  }
  return 0;
}
