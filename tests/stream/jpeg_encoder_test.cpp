// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/jpeg_encoder.hpp"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <cmath>
#include <vector>

#include "sightline/image/image.hpp"

namespace sightline {
namespace {

/// Levels as an image of limited range has them.
std::shared_ptr<const Image> ramp(int width, int height) {
  auto image = std::make_shared<Image>(width, height);
  const MutableI420View view = image->mutable_view();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      view.y.row(y)[x] = static_cast<uint8_t>(16 + 219 * x / std::max(1, width - 1));
    }
  }
  for (const MutablePlaneView& plane : {view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, uint8_t{128});
  }
  return image;
}

struct Decoded {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;
};

Decoded decode(const std::string& jpeg) {
  Decoded decoded;
  const tjhandle handle = tjInitDecompress();
  const auto* const bytes = reinterpret_cast<const unsigned char*>(jpeg.data());
  int subsampling = 0, colorspace = 0;
  EXPECT_EQ(tjDecompressHeader3(handle, bytes, jpeg.size(), &decoded.width, &decoded.height,
                                &subsampling, &colorspace),
            0);
  EXPECT_EQ(subsampling, TJSAMP_420);
  decoded.rgb.resize(static_cast<size_t>(3 * decoded.width * decoded.height));
  EXPECT_EQ(tjDecompress2(handle, bytes, jpeg.size(), decoded.rgb.data(), decoded.width, 0,
                          decoded.height, TJPF_RGB, 0),
            0);
  tjDestroy(handle);
  return decoded;
}

TEST(JpegEncoder, BlackIsBlackAndWhiteIsWhite) {
  auto encoder = JpegEncoder::create(90);
  ASSERT_TRUE(encoder);
  const auto jpeg = (*encoder)->encode(ramp(256, 64)->view());
  ASSERT_TRUE(jpeg);
  const Decoded decoded = decode(*jpeg);
  ASSERT_EQ(decoded.width, 256);
  for (int x = 0; x < 256; ++x) {
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_NEAR(decoded.rgb[static_cast<size_t>(3 * (32 * 256 + x) + channel)], x, 4) << x;
    }
  }
}

TEST(JpegEncoder, TakesAnySizeOneAfterAnother) {
  auto encoder = JpegEncoder::create(80);
  ASSERT_TRUE(encoder);
  for (const auto& [width, height] : {std::pair{641, 479}, {1, 1}, {1280, 720}, {17, 2}}) {
    const auto jpeg = (*encoder)->encode(ramp(width, height)->view());
    ASSERT_TRUE(jpeg) << width;
    const Decoded decoded = decode(*jpeg);
    EXPECT_EQ(decoded.width, width);
    EXPECT_EQ(decoded.height, height);
  }
}

TEST(JpegEncoder, AQualityThatIsNoneIsRefused) {
  EXPECT_FALSE(JpegEncoder::create(0));
  EXPECT_FALSE(JpegEncoder::create(101));
}

}  // namespace
}  // namespace sightline
