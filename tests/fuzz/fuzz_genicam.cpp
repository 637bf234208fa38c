// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <vector>

#include "capture/aravis/genicam_image.hpp"

/// Whatever bytes a GenICam camera sends, of whatever format and size, they become an image of
/// that size without a look past their end, and unpacked samples have no more bits than the format.
/// Input: format, width, height, padding, then the camera's bytes.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  using namespace sightline::capture;
  if (size < 4) return 0;
  const auto formats = genicam_formats();
  const GenicamFormat& format = formats[data[0] % formats.size()];
  const int width = 1 + data[1] % 96, height = 1 + data[2] % 32, padding = data[3] % 9;
  if (genicam_row_bytes(format, width) == 0) return 0;
  GenicamImage image(format, width, height, padding);
  const size_t needed = image.bytes_needed();
  // Exactly as many as it may read, so that one more is found.
  const auto bytes = std::make_unique<uint8_t[]>(needed);
  for (size_t i = 0; i < needed; ++i) bytes[i] = size > 4 ? data[4 + i % (size - 4)] : 0;
  FrameInfo info;
  const FramePtr frame = image.copied_frame(info, {bytes.get(), needed});
  if (frame->info().width != width || frame->info().height != height) std::abort();
  (void)frame->i420();
  if (format.packing == Packing::kNone) return 0;
  std::vector<uint16_t> words(static_cast<size_t>(width));
  unpack_row(format.packing, format.bits, bytes.get(), width, words.data());
  for (const uint16_t word : words) {
    if (word >> format.bits != 0) std::abort();
  }
  return 0;
}
