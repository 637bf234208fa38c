// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <turbojpeg.h>

#include <cstdint>
#include <vector>

namespace sightline::test {

/// A baseline JPEG of a smooth color image that depends on `seed`. `sampling` as in TurboJPEG.
inline std::vector<uint8_t> make_jpeg(int width, int height, int sampling, int seed = 0) {
  std::vector<uint8_t> rgb;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      rgb.push_back(static_cast<uint8_t>(40 + 150 * x / width));
      rgb.push_back(static_cast<uint8_t>(60 + 120 * y / height));
      rgb.push_back(static_cast<uint8_t>(90 + seed % 60));
    }
  }
  const tjhandle turbo = tjInitCompress();
  unsigned char* jpeg = nullptr;
  unsigned long size = 0;
  tjCompress2(turbo, rgb.data(), width, 0, height, TJPF_RGB, &jpeg, &size, sampling, 95, 0);
  std::vector<uint8_t> bytes(jpeg, jpeg + size);
  tjFree(jpeg);
  tjDestroy(turbo);
  return bytes;
}

}  // namespace sightline::test
