// SPDX-License-Identifier: Apache-2.0
#include "capture/decode/mjpeg_decoder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "jpeg_maker.hpp"
#include "sightline/image/image.hpp"
#include "support/matchers.hpp"

namespace sightline::capture {
namespace {

using test::FailsWith;
using test::IsOk;
using test::make_jpeg;

// Of the smooth image that make_jpeg() draws, BT.601 limited range.
double luma_at(int x, int y, int width, int height) {
  const double r = 40 + 150 * x / width, g = 60 + 120 * y / height, b = 90;
  return 16 + (65.481 * r + 128.553 * g + 24.966 * b) / 255;
}
double blue_at(int x, int y, int width, int height) {
  const double r = 40 + 150 * x / width, g = 60 + 120 * y / height, b = 90;
  return 128 + (-37.797 * r - 74.203 * g + 112.0 * b) / 255;
}

class Samplings : public testing::TestWithParam<std::tuple<int, std::pair<int, int>>> {};

TEST_P(Samplings, AllDecodeToTheSameImageInLimitedRange) {
  const auto [sampling, size] = GetParam();
  const auto [width, height] = size;
  Image image(width, height);
  MjpegDecoder decoder;
  ASSERT_THAT(decoder.decode(make_jpeg(width, height, sampling), image.mutable_view()), IsOk());
  const auto view = image.view();
  double worst_luma = 0, worst_chroma = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      worst_luma = std::max(worst_luma, std::abs(view.y.row(y)[x] - luma_at(x, y, width, height)));
      const double blue = sampling == TJSAMP_GRAY ? 128 : blue_at(x, y, width, height);
      worst_chroma = std::max(worst_chroma, std::abs(view.u.row(y / 2)[x / 2] - blue));
    }
  }
  EXPECT_LE(worst_luma, 4);
  EXPECT_LE(worst_chroma, 5);
}

INSTANTIATE_TEST_SUITE_P(
    Mjpeg, Samplings,
    testing::Combine(testing::Values(TJSAMP_420, TJSAMP_422, TJSAMP_444, TJSAMP_440, TJSAMP_GRAY),
                     testing::Values(std::pair(64, 48), std::pair(65, 47), std::pair(1, 1))));

class Damage : public testing::Test {
 protected:
  Status decode(const std::vector<uint8_t>& bytes) {
    return decoder_.decode(bytes, image_.mutable_view());
  }
  const std::vector<uint8_t> good_ = make_jpeg(160, 120, TJSAMP_422);
  Image image_{160, 120};
  MjpegDecoder decoder_;
};

TEST_F(Damage, PaddingBehindTheEndIsHarmless) {
  auto padded = good_;
  padded.resize(good_.size() + 1000, 0);
  EXPECT_THAT(decode(padded), IsOk());
}

TEST_F(Damage, EveryTruncationIsFound) {
  for (size_t size = 0; size < good_.size(); size += 7) {
    EXPECT_THAT(decode({good_.begin(), good_.begin() + static_cast<ptrdiff_t>(size)}),
                FailsWith("no start or end marker"))
        << size;
  }
}

TEST_F(Damage, DataMissingInTheMiddleIsFound) {
  auto holed = good_;
  const auto middle = holed.begin() + static_cast<ptrdiff_t>(holed.size() / 2);
  holed.erase(middle, middle + 200);
  EXPECT_THAT(decode(holed), FailsWith("damaged MJPEG image"));
}

TEST_F(Damage, GarbageIsFound) {
  EXPECT_FALSE(decode({}));
  EXPECT_FALSE(decode(std::vector<uint8_t>(5000, 0)));
  EXPECT_FALSE(decode({0xff, 0xd8, 0xff, 0xd9}));
  auto scrambled = good_;
  for (size_t i = scrambled.size() / 2; i + 2 < scrambled.size(); ++i) scrambled[i] ^= 0x5a;
  EXPECT_FALSE(decode(scrambled));
}

TEST_F(Damage, AnotherSizeIsFound) {
  EXPECT_THAT(decode(make_jpeg(176, 144, TJSAMP_422)), FailsWith("another size"));
}

TEST_F(Damage, TheDecoderGoesOnAfterwards) {
  EXPECT_FALSE(decode({good_.begin(), good_.end() - 100}));
  EXPECT_THAT(decode(good_), IsOk());
}

}  // namespace
}  // namespace sightline::capture
