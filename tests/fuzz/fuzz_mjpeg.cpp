// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <utility>

#include "capture/decode/mjpeg_decoder.hpp"
#include "sightline/image/image.hpp"

/// Whatever a camera sends, the decoder stays inside the image and goes on with the next one;
/// what it accepts has both markers and decodes to the same again.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static sightline::capture::MjpegDecoder decoder;
  const std::span<const uint8_t> bytes(data, size);
  for (const auto& [width, height] : {std::pair(32, 24), std::pair(31, 17)}) {
    sightline::Image image(width, height), again(width, height);
    if (!decoder.decode(bytes, image.mutable_view())) continue;
    if (sightline::capture::trim_jpeg(bytes).empty()) std::abort();
    if (!decoder.decode(sightline::capture::trim_jpeg(bytes), again.mutable_view())) std::abort();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (image.view().y.row(y)[x] != again.view().y.row(y)[x]) std::abort();
      }
    }
  }
  return 0;
}
