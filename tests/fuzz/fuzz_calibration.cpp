// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "sightline/calibrate/calibration_file.hpp"

/// What is accepted can be written and read again, and its lenses answer without harm.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto cameras = sightline::parse_calibration(text, "fuzz");
  if (!cameras) return 0;
  for (const auto& camera : *cameras) {
    for (double pixel : {0.0, 300.0, 1e6}) {
      const auto ray = camera.model.unproject({pixel, pixel});
      if (ray && !camera.model.project(*ray)) std::abort();
    }
  }
  if (!sightline::parse_calibration(sightline::format_calibration(*cameras), "again")) std::abort();
  return 0;
}
