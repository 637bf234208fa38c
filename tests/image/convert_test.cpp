// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/convert.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

#include "sightline/image/image.hpp"

namespace sightline {
namespace {

using Bytes = std::vector<uint8_t>;

Bytes random_bytes(size_t n, uint32_t seed = 1) {
  std::mt19937 random(seed);
  Bytes bytes(n);
  for (auto& b : bytes) b = static_cast<uint8_t>(random());
  return bytes;
}

size_t needed(PixelFormat format, int width, int height, ptrdiff_t stride = 0) {
  auto bytes = raw_image_bytes(format, width, height, stride);
  EXPECT_TRUE(bytes.has_value());
  return *bytes;
}

struct Size {
  int width, height;
};
const Size kSizes[] = {{64, 48}, {65, 47}, {1, 1}, {33, 2}, {2, 33}, {640, 5}};

TEST(RawToI420, CopiesI420AndSplitsNv12) {
  for (const auto [w, h] : kSizes) {
    const int cw = (w + 1) / 2, ch = (h + 1) / 2;
    for (const int pad : {0, 6}) {
      const ptrdiff_t stride = pad == 0 ? 0 : w + (w & 1) + pad, row = stride ? stride : w;
      const ptrdiff_t planar_row = stride ? (stride + 1) / 2 : cw;
      const ptrdiff_t pair_row = stride ? stride : 2 * cw;
      const Bytes planar = random_bytes(needed(PixelFormat::kI420, w, h, stride));
      const Bytes pairs = random_bytes(needed(PixelFormat::kNv12, w, h, stride), 2);
      Image a(w, h), b(w, h);
      ASSERT_TRUE(raw_to_i420(PixelFormat::kI420, planar, stride, a.mutable_view()));
      ASSERT_TRUE(raw_to_i420(PixelFormat::kNv12, pairs, stride, b.mutable_view()));
      for (int y = 0; y < h; ++y) {
        for (int x = 0; x < w; ++x) {
          ASSERT_EQ(a.view().y.row(y)[x], planar[static_cast<size_t>(y * row + x)]);
          ASSERT_EQ(b.view().y.row(y)[x], pairs[static_cast<size_t>(y * row + x)]);
        }
      }
      for (int y = 0; y < ch; ++y) {
        for (int x = 0; x < cw; ++x) {
          const auto at = static_cast<size_t>(row * h + y * planar_row + x);
          ASSERT_EQ(a.view().u.row(y)[x], planar[at]);
          ASSERT_EQ(a.view().v.row(y)[x], planar[at + static_cast<size_t>(planar_row * ch)]);
          const auto pair = static_cast<size_t>(row * h + y * pair_row + 2 * x);
          ASSERT_EQ(b.view().u.row(y)[x], pairs[pair]);
          ASSERT_EQ(b.view().v.row(y)[x], pairs[pair + 1]);
        }
      }
    }
  }
}

TEST(RawToI420, PacksOf422KeepLumaAndAverageChromaOfTwoRows) {
  for (const auto [w, h] : kSizes) {
    for (const bool yuyv : {true, false}) {
      const PixelFormat format = yuyv ? PixelFormat::kYuyv : PixelFormat::kUyvy;
      const ptrdiff_t row = 4 * ((w + 1) / 2);
      const Bytes bytes = random_bytes(needed(format, w, h));
      ASSERT_EQ(bytes.size(), static_cast<size_t>(row * h));
      Image image(w, h);
      ASSERT_TRUE(raw_to_i420(format, bytes, 0, image.mutable_view()));
      const auto byte = [&](int y, int x) { return bytes[static_cast<size_t>(y * row + x)]; };
      for (int y = 0; y < h; ++y) {
        for (int x = 0; x < w; ++x) {
          ASSERT_EQ(image.view().y.row(y)[x], byte(y, 2 * x + (yuyv ? 0 : 1)));
        }
      }
      for (int y = 0; y < h; y += 2) {
        const int y2 = std::min(y + 1, h - 1);
        for (int x = 0; x < (w + 1) / 2; ++x) {
          const int u = 4 * x + (yuyv ? 1 : 0), v = u + 2;
          ASSERT_NEAR(image.view().u.row(y / 2)[x], (byte(y, u) + byte(y2, u)) / 2.0, 0.51);
          ASSERT_NEAR(image.view().v.row(y / 2)[x], (byte(y, v) + byte(y2, v)) / 2.0, 0.51);
        }
      }
    }
  }
}

TEST(RawToI420, GrayIsCompressedIntoVideoRange) {
  struct Case {
    PixelFormat format;
    int bits;
  };
  for (const auto [format, bits] : {Case{PixelFormat::kGray, 8}, Case{PixelFormat::kY10, 10},
                                    Case{PixelFormat::kY12, 12}, Case{PixelFormat::kY16, 16}}) {
    const int w = 37, h = 9, bytes_per_pixel = bits == 8 ? 1 : 2;
    const ptrdiff_t stride = w * bytes_per_pixel + 3;  // odd: 16-bit values lie unaligned
    Bytes bytes = random_bytes(needed(format, w, h, stride));
    const int limit = 1 << bits;
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        uint8_t* p = &bytes[static_cast<size_t>(y * stride + x * bytes_per_pixel)];
        if (bits > 8) p[1] = static_cast<uint8_t>(p[1] & ((limit - 1) >> 8));
      }
    }
    Image image(w, h);
    ASSERT_TRUE(raw_to_i420(format, bytes, stride, image.mutable_view()));
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        const uint8_t* p = &bytes[static_cast<size_t>(y * stride + x * bytes_per_pixel)];
        const int value = (bits == 8 ? p[0] : p[0] | p[1] << 8) >> (bits - 8);
        ASSERT_EQ(image.view().y.row(y)[x], std::lround(16 + value * 219.0 / 255.0));
      }
    }
    EXPECT_EQ(image.view().u.row(h / 2)[w / 2], 128);
    EXPECT_EQ(image.view().v.row(0)[0], 128);
  }
}

TEST(RawToI420, StrayHighBitsSaturate) {
  const Bytes bytes{0xff, 0xff};
  Image image(1, 1);
  ASSERT_TRUE(raw_to_i420(PixelFormat::kY10, bytes, 0, image.mutable_view()));
  EXPECT_EQ(image.view().y.data[0], 235);
}

TEST(RawToI420, RgbFollowsBt601AndTheByteOrder) {
  const int w = 34, h = 6;
  Bytes rgb(static_cast<size_t>(w * h * 3)), bgr(rgb.size());
  for (int i = 0; i < w * h; ++i) {
    const auto at = static_cast<size_t>(3 * i);
    rgb[at] = bgr[at + 2] = 200;
    rgb[at + 1] = bgr[at + 1] = 40;
    rgb[at + 2] = bgr[at] = 90;
  }
  const double y = 16 + (65.481 * 200 + 128.553 * 40 + 24.966 * 90) / 255;
  const double u = 128 + (-37.797 * 200 - 74.203 * 40 + 112.0 * 90) / 255;
  const double v = 128 + (112.0 * 200 - 93.786 * 40 - 18.214 * 90) / 255;
  for (const auto& [format, bytes] :
       {std::pair{PixelFormat::kRgb24, rgb}, {PixelFormat::kBgr24, bgr}}) {
    Image image(w, h);
    ASSERT_TRUE(raw_to_i420(format, bytes, 0, image.mutable_view()));
    EXPECT_NEAR(image.view().y.row(h - 1)[w - 1], y, 1.5);
    EXPECT_NEAR(image.view().u.row(1)[3], u, 1.5);
    EXPECT_NEAR(image.view().v.row(1)[3], v, 1.5);
    Bytes back(rgb.size());
    i420_to_rgb(image.view(), back.data());
    for (size_t i = 0; i < rgb.size(); ++i) ASSERT_NEAR(back[i], rgb[i], 3);
  }
}

TEST(RawToI420, RefusesWhatCannotBe) {
  Image image(16, 8);
  for (const PixelFormat format :
       {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy,
        PixelFormat::kGray, PixelFormat::kY10, PixelFormat::kRgb24}) {
    Bytes bytes = random_bytes(needed(format, 16, 8));
    EXPECT_TRUE(raw_to_i420(format, bytes, 0, image.mutable_view())) << to_string(format);
    bytes.pop_back();
    const Status status = raw_to_i420(format, bytes, 0, image.mutable_view());
    ASSERT_FALSE(status.has_value()) << to_string(format);
    EXPECT_EQ(status.error().code, ErrorCode::kDamaged);
    EXPECT_FALSE(raw_to_i420(format, bytes, 15, image.mutable_view()));
    EXPECT_FALSE(raw_to_i420(format, bytes, -16, image.mutable_view()));
  }
  for (const PixelFormat format : {PixelFormat::kMjpeg, PixelFormat::kH264}) {
    const Status status = raw_to_i420(format, Bytes(1000), 0, image.mutable_view());
    ASSERT_FALSE(status.has_value());
    EXPECT_NE(status.error().text.find("decoder"), std::string::npos);
  }
  EXPECT_FALSE(raw_image_bytes(PixelFormat::kGray, 0, 1, 0).has_value());
  EXPECT_FALSE(raw_image_bytes(PixelFormat::kGray, 1, 40000, 0).has_value());
}

TEST(HalvePlane, IsTheRoundedMeanOfTwoByTwo) {
  for (const auto [w, h] : kSizes) {
    Image from(w, h);
    const Bytes noise = random_bytes(static_cast<size_t>(w * h));
    for (int y = 0; y < h; ++y) {
      std::copy_n(&noise[static_cast<size_t>(y * w)], w, from.mutable_view().y.row(y));
    }
    Image to(std::max(1, w / 2), std::max(1, h / 2));
    MutablePlaneView half = to.mutable_view().y;
    half.width = w / 2;
    half.height = h / 2;
    halve_plane(from.view().y, half);
    for (int y = 0; y < h / 2; ++y) {
      for (int x = 0; x < w / 2; ++x) {
        const uint8_t* top = from.view().y.row(2 * y) + 2 * x;
        const uint8_t* bottom = from.view().y.row(2 * y + 1) + 2 * x;
        ASSERT_EQ(half.row(y)[x], (top[0] + top[1] + bottom[0] + bottom[1] + 2) / 4);
      }
    }
  }
}

TEST(ShrinkPlane, IsTheMeanOfSquares) {
  constexpr int kWidth = 53, kHeight = 31;
  const Bytes noise = random_bytes(kWidth * kHeight);
  const PlaneView from{noise.data(), kWidth, kHeight, kWidth};
  for (const int factor : {1, 2, 3, 4, 5}) {
    const int width = kWidth / factor, height = kHeight / factor;
    Bytes to(static_cast<size_t>(width * height));
    shrink_plane(from, factor, {to.data(), width, height, width});
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        for (int i = 0; i < factor * factor; ++i) {
          sum += from.row(factor * y + i / factor)[factor * x + i % factor];
        }
        ASSERT_NEAR(to[static_cast<size_t>(y * width + x)], sum / (factor * factor), 1.1);
      }
    }
  }
}

TEST(CopyI420, CopiesOddSizes) {
  Image from(7, 5), to(7, 5);
  from.mutable_view().y.row(4)[6] = 99;
  from.mutable_view().v.row(2)[3] = 98;
  copy_i420(from.view(), to.mutable_view());
  EXPECT_EQ(to.view().y.row(4)[6], 99);
  EXPECT_EQ(to.view().v.row(2)[3], 98);
}

}  // namespace
}  // namespace sightline
