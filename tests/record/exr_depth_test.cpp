// SPDX-License-Identifier: Apache-2.0
//
// Depth in OpenEXR, as renderers and scanners write it; the files are made by the C++ library of
// OpenEXR.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>

#include "../support/matchers.hpp"
#include "record/media.hpp"
#include "sightline/base/files.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;
using test::TempFolder;

constexpr int kW = 37, kH = 53;

/// Depth of pixel (x, y) [m].
float depth_at(int x, int y) { return 0.5f + 0.01f * static_cast<float>(x + 100 * y); }

struct Written {
  std::map<std::string, Imf::PixelType> channels = {{"Z", Imf::FLOAT}};
  std::string depth = "Z";  ///< the channel that holds depth_at(); others hold -1
  Imf::Compression compression = Imf::ZIP_COMPRESSION;
  int tile = 0;  ///< 0: scan lines
  Imath::Box2i data{{0, 0}, {kW - 1, kH - 1}};

  std::string bytes() const {
    Imf::Header header({{0, 0}, {kW - 1, kH - 1}}, data, 1, {0, 0}, 1, Imf::INCREASING_Y,
                       compression);
    std::vector<float> floats, none;
    std::vector<half> halves;
    const int width = data.max.x - data.min.x + 1;
    for (int y = data.min.y; y <= data.max.y; ++y) {
      for (int x = data.min.x; x <= data.max.x; ++x) {
        floats.push_back(depth_at(x, y));
        halves.emplace_back(depth_at(x, y));
        none.push_back(-1);
      }
    }
    Imf::FrameBuffer buffer;
    for (const auto& [name, type] : channels) {
      header.channels().insert(name, Imf::Channel(type));
      const bool is_half = type == Imf::HALF;
      const size_t size = is_half ? sizeof(half) : sizeof(float);
      char* const base = is_half         ? reinterpret_cast<char*>(halves.data())
                         : name == depth ? reinterpret_cast<char*>(floats.data())
                                         : reinterpret_cast<char*>(none.data());
      const ptrdiff_t before = data.min.x + ptrdiff_t{data.min.y} * width;
      buffer.insert(name, Imf::Slice(type, base - before * static_cast<ptrdiff_t>(size), size,
                                     size * static_cast<size_t>(width)));
    }
    TempFolder temp;
    const std::string path = (temp / "d.exr").string();
    if (tile > 0) {
      header.setTileDescription(
          Imf::TileDescription(static_cast<unsigned>(tile), static_cast<unsigned>(tile / 2)));
      Imf::TiledOutputFile file(path.c_str(), header, 0);
      file.setFrameBuffer(buffer);
      file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
    } else {
      Imf::OutputFile file(path.c_str(), header, 0);
      file.setFrameBuffer(buffer);
      file.writePixels(data.max.y - data.min.y + 1);
    }
    return test::read_text(path);
  }
};

/// Largest difference from depth_at(), where the file has pixels; anything but 0 elsewhere counts
/// too.
float worst(const DepthImage& image, const Imath::Box2i& data) {
  float most = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const bool there = x >= data.min.x && x <= data.max.x && y >= data.min.y && y <= data.max.y;
      const float wanted = there ? depth_at(x, y) : 0;
      most =
          std::max(most, std::abs(image.depth[static_cast<size_t>(y * image.width + x)] - wanted));
    }
  }
  return most;
}

void expect_read(const Written& written, float tolerance = 1e-6f) {
  const auto image = parse_depth_image(written.bytes(), "d.exr", 1.0);
  ASSERT_THAT(image, IsOk());
  ASSERT_EQ(image->width, kW);
  ASSERT_EQ(image->height, kH);
  EXPECT_LE(worst(*image, written.data), tolerance);
}

TEST(ExrDepth, ChannelsThatHoldDepth) {
  for (const char* name :
       {"Z", "V", "R", "Y", "G", "Depth.Z", "depth", "ViewLayer.Depth.V", "odd"}) {
    SCOPED_TRACE(name);
    Written written;
    written.channels = {{name, Imf::FLOAT}};
    written.depth = name;
    expect_read(written);
  }
}

TEST(ExrDepth, DepthIsChosenAmongOtherChannels) {
  Written written;
  written.channels = {{"R", Imf::FLOAT}, {"G", Imf::FLOAT}, {"B", Imf::FLOAT},
                      {"A", Imf::FLOAT}, {"Z", Imf::FLOAT}, {"ZBack", Imf::FLOAT}};
  expect_read(written);
  written.channels = {{"R", Imf::FLOAT}, {"G", Imf::FLOAT}, {"B", Imf::FLOAT}};
  written.depth = std::string("G");
  expect_read(written);
  written.channels = {{"A", Imf::FLOAT}, {"B", Imf::FLOAT}};
  EXPECT_THAT(parse_depth_image(written.bytes(), "d.exr", 1),
              FailsWith("d.exr: has channels A, B"));
}

TEST(ExrDepth, CompressionsTilesAndHalfPrecision) {
  for (const Imf::Compression compression :
       {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
        Imf::PIZ_COMPRESSION}) {
    for (const int tile : {0, 16, 64}) {
      SCOPED_TRACE(testing::Message() << compression << " " << tile);
      Written written;
      written.compression = compression;
      written.tile = tile;
      expect_read(written);
    }
  }
  Written written;
  written.channels = {{"Z", Imf::HALF}};
  expect_read(written, 0.05f);
}

TEST(ExrDepth, PixelsOfAWindowAreWhereTheyBelong) {
  Written written;
  written.data = {{5, 7}, {20, 30}};
  expect_read(written);
  written.tile = 8;
  expect_read(written);
  written.data = {{-6, -9}, {kW + 4, 10}};
  expect_read(written);
}

TEST(ExrDepth, ScaleAndNoSurface) {
  const auto image = parse_depth_image(Written().bytes(), "d.exr", 0.001);
  ASSERT_THAT(image, IsOk());
  EXPECT_FLOAT_EQ(image->depth[1], 0.001f * depth_at(1, 0));
  Written nothing;
  nothing.depth.clear();
  EXPECT_THAT(parse_depth_image(nothing.bytes(), "d.exr", 1), FailsWith("d.exr: holds no depth"));
}

/// The four numbers of a window in the header, made others.
std::string with_window(std::string bytes, const std::string& name,
                        const std::array<int32_t, 4>& box) {
  const size_t at = bytes.find(name + '\0' + "box2i" + '\0');
  EXPECT_NE(at, std::string::npos);
  std::memcpy(bytes.data() + at + name.size() + 1 + 6 + 4, box.data(), sizeof box);
  return bytes;
}

TEST(ExrDepth, SizesThatNoImageHasAreRefused) {
  const std::string good = Written().bytes();
  for (const std::array<int32_t, 4>& box :
       {std::array<int32_t, 4>{0, 0, 2'000'000'000, 2'000'000'000},
        {0, 0, 32767, 32767},
        {0, 0, 40'000, 1},
        {5, 5, 0, 0},
        {-2'147'483'647, -2'147'483'647, 2'147'483'647, 2'147'483'647}}) {
    for (const char* window : {"dataWindow", "displayWindow"}) {
      const auto refused = parse_depth_image(with_window(good, window, box), "d.exr", 1);
      ASSERT_FALSE(refused) << window << " " << box[2];
      EXPECT_EQ(exit_code(refused.error()), 2) << refused.error().message();
    }
  }
}

TEST(ExrDepth, CutAndAlteredFilesAreRefused) {
  Written written;
  written.compression = Imf::PIZ_COMPRESSION;
  for (const std::string& good : {Written().bytes(), written.bytes()}) {
    for (size_t length = 4; length < good.size(); length += 1 + good.size() / 150) {
      const auto refused = parse_depth_image(std::string_view(good).substr(0, length), "d.exr", 1);
      ASSERT_FALSE(refused) << length;
      EXPECT_EQ(exit_code(refused.error()), 2) << refused.error().message();
    }
    for (size_t at = 4; at < good.size(); at += 1 + good.size() / 2000) {
      std::string altered = good;
      altered[at] = static_cast<char>(~altered[at]);
      (void)parse_depth_image(altered, "d.exr", 1).has_value();
    }
  }
}

}  // namespace
}  // namespace sightline
