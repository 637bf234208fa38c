// SPDX-License-Identifier: Apache-2.0
#include "capture/decode/bayer_decoder.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "sightline/image/convert.hpp"
#include "sightline/image/image.hpp"
#include "support/matchers.hpp"

namespace sightline::capture {
namespace {

using test::FailsWith;
using test::IsOk;

constexpr int kWidth = 24, kHeight = 16;
constexpr std::array<uint8_t, 3> kColor = {200, 120, 40};  // r, g, b

// Which of r, g, b the sample at (x, y) shows.
size_t channel(MosaicPattern pattern, int x, int y) {
  constexpr std::array<std::array<size_t, 4>, 4> kChannels = {
      {{0, 1, 1, 2}, {1, 0, 2, 1}, {1, 2, 0, 1}, {2, 1, 1, 0}}};
  return kChannels[static_cast<size_t>(pattern)][static_cast<size_t>(y % 2 * 2 + x % 2)];
}

std::vector<uint8_t> pack(const std::vector<uint8_t>& samples, BayerPacking packing) {
  std::vector<uint8_t> bytes;
  const auto word = [&](unsigned value) {
    bytes.push_back(static_cast<uint8_t>(value & 0xff));
    bytes.push_back(static_cast<uint8_t>(value >> 8));
  };
  for (size_t i = 0; i < samples.size(); ++i) {
    const unsigned value = samples[i];
    switch (packing) {
      case BayerPacking::k8:
        bytes.push_back(samples[i]);
        break;
      case BayerPacking::k10:
        word(value << 2 | 3);
        break;
      case BayerPacking::k12:
        word(value << 4 | 9);
        break;
      case BayerPacking::k16:
        word(value << 8 | 77);
        break;
      case BayerPacking::kPacked10:
        bytes.push_back(samples[i]);
        if (i % 4 == 3) bytes.push_back(0xe4);  // the low bits of four samples
        break;
      case BayerPacking::kPacked12:
        bytes.push_back(samples[i]);
        if (i % 2 == 1) bytes.push_back(0x5a);
        break;
    }
  }
  return bytes;
}

using Param = std::tuple<MosaicPattern, BayerPacking>;
class Mosaics : public testing::TestWithParam<Param> {};

TEST_P(Mosaics, OneColorComesOutAsThatColor) {
  const auto [pattern, packing] = GetParam();
  std::vector<uint8_t> samples;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) samples.push_back(kColor[channel(pattern, x, y)]);
  }
  std::vector<uint8_t> rgb;
  for (int i = 0; i < kWidth * kHeight; ++i) rgb.insert(rgb.end(), kColor.begin(), kColor.end());
  Image expected(kWidth, kHeight), got(kWidth, kHeight);
  ASSERT_THAT(raw_to_i420(PixelFormat::kRgb24, rgb, 0, expected.mutable_view()), IsOk());

  BayerDecoder decoder(pattern, packing, kWidth, kHeight);
  const auto stride = static_cast<ptrdiff_t>(bayer_row_bytes(packing, kWidth));
  ASSERT_THAT(decoder.decode(pack(samples, packing), stride, got.mutable_view()), IsOk());
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      ASSERT_EQ(got.view().y.row(y)[x], expected.view().y.row(y)[x]) << x << "," << y;
      ASSERT_EQ(got.view().u.row(y / 2)[x / 2], expected.view().u.row(y / 2)[x / 2]);
      ASSERT_EQ(got.view().v.row(y / 2)[x / 2], expected.view().v.row(y / 2)[x / 2]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Bayer, Mosaics,
    testing::Combine(testing::Values(MosaicPattern::kRggb, MosaicPattern::kGrbg,
                                     MosaicPattern::kGbrg, MosaicPattern::kBggr),
                     testing::Values(BayerPacking::k8, BayerPacking::k10, BayerPacking::k12,
                                     BayerPacking::k16, BayerPacking::kPacked10,
                                     BayerPacking::kPacked12)));

TEST(Bayer, RefusesTooFewBytes) {
  BayerDecoder decoder(MosaicPattern::kRggb, BayerPacking::k8, kWidth, kHeight);
  Image image(kWidth, kHeight);
  const std::vector<uint8_t> bytes(kWidth * kHeight - 1);
  EXPECT_THAT(decoder.decode(bytes, kWidth, image.mutable_view()), FailsWith("are needed"));
}

TEST(Bayer, PackedRowsMayEndWithinAGroup) {
  const std::vector<uint8_t> samples = {10, 20, 30, 40, 50, 60, 70};
  for (const BayerPacking packing : {BayerPacking::kPacked10, BayerPacking::kPacked12}) {
    const auto bytes = pack(samples, packing);
    EXPECT_GE(bayer_row_bytes(packing, 7), bytes.size());
    std::vector<uint8_t> out(samples.size());
    unpack_bayer_row(packing, bytes.data(), 7, out.data());
    EXPECT_EQ(out, samples);
  }
}

TEST(Bayer, ValuesAboveTheirBitsSaturate) {
  const std::vector<uint8_t> wild = {0xff, 0xff, 0xff, 0x0f};
  std::array<uint8_t, 2> out{};
  unpack_bayer_row(BayerPacking::k10, wild.data(), 2, out.data());
  EXPECT_EQ(out[0], 255);
  EXPECT_EQ(out[1], 255);
}

}  // namespace
}  // namespace sightline::capture
