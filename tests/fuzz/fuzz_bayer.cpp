// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "capture/decode/bayer_decoder.hpp"
#include "sightline/image/image.hpp"

namespace {

using namespace sightline;
using namespace sightline::capture;

// The eight high bits of sample `x`, straight from the definition of the packing.
uint8_t expected(BayerPacking packing, const uint8_t* row, int x) {
  const auto word = [&] { return row[2 * x] | row[2 * x + 1] << 8; };
  switch (packing) {
    case BayerPacking::k8:
      return row[x];
    case BayerPacking::k10:
      return static_cast<uint8_t>(std::min(word(), 0x3ff) >> 2);
    case BayerPacking::k12:
      return static_cast<uint8_t>(std::min(word(), 0xfff) >> 4);
    case BayerPacking::k16:
      return row[2 * x + 1];
    case BayerPacking::kPacked10:
      return row[x / 4 * 5 + x % 4];
    case BayerPacking::kPacked12:
      return row[x / 2 * 3 + x % 2];
  }
  return 0;
}

bool in_range(BayerPacking packing, const uint8_t* row, int width) {
  const int bits = packing == BayerPacking::k10 ? 10 : packing == BayerPacking::k12 ? 12 : 16;
  for (int x = 0; x < width; ++x) {
    if ((row[2 * x] | row[2 * x + 1] << 8) >> bits != 0) return false;
  }
  return true;
}

}  // namespace

/// Rows of any packing, size and content are unpacked as defined, and whatever the buffer holds is
/// decoded or refused without a step outside of it.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 4) return 0;
  constexpr std::array kPackings = {BayerPacking::k8,        BayerPacking::k10,
                                    BayerPacking::k12,       BayerPacking::k16,
                                    BayerPacking::kPacked10, BayerPacking::kPacked12};
  const BayerPacking packing = kPackings[data[0] % kPackings.size()];
  const auto pattern = static_cast<MosaicPattern>(data[0] / kPackings.size() % 4);
  const int width = 2 + data[1] % 63, height = 2 + data[2] % 15;
  const size_t row_bytes = bayer_row_bytes(packing, width);
  const auto stride = static_cast<ptrdiff_t>(row_bytes + data[3] % 8);
  // Exactly as much as there is, so that the sanitizer sees a step too far.
  const std::vector<uint8_t> bytes(data + 4, data + size);
  if (bytes.size() >= row_bytes) {
    std::vector<uint8_t> row(static_cast<size_t>(width));
    unpack_bayer_row(packing, bytes.data(), width, row.data());
    const bool words = packing == BayerPacking::k10 || packing == BayerPacking::k12;
    for (int x = 0; (!words || in_range(packing, bytes.data(), width)) && x < width; ++x) {
      if (row[static_cast<size_t>(x)] != expected(packing, bytes.data(), x)) std::abort();
    }
  }
  BayerDecoder decoder(pattern, packing, width, height);
  Image image(width, height);
  const bool enough =
      bytes.size() >= static_cast<size_t>(stride) * static_cast<size_t>(height - 1) + row_bytes;
  const bool decoded = decoder.decode(bytes, stride, image.mutable_view()).has_value();
  if (decoded && !enough) std::abort();
  return 0;
}
