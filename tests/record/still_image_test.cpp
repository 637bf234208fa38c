// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/still_image.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "../support/matchers.hpp"
#include "sightline/base/files.hpp"
#include "sightline/record/overlay_video.hpp"

namespace sightline {
namespace {

using test::FailsWith;
using test::IsOk;

// Smooth, so that halved chroma loses nothing.
std::shared_ptr<Image> ramp(int width, int height) {
  auto image = std::make_shared<Image>(width, height);
  const auto view = image->mutable_view();
  const auto fill = [](const MutablePlaneView& plane, int low, int across, int down) {
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        plane.row(y)[x] =
            static_cast<uint8_t>(low + across * x / plane.width + down * y / plane.height);
      }
    }
  };
  fill(view.y, 60, 80, 60);
  fill(view.u, 110, 30, 0);
  fill(view.v, 115, 0, 25);
  return image;
}

class StillImage : public testing::Test {
 protected:
  std::filesystem::path path(const std::string& name) {
    const auto folder = std::filesystem::path(testing::TempDir()) / "still_image_test";
    std::filesystem::create_directories(folder);
    return folder / name;
  }
};

TEST_F(StillImage, FourBytesOfAContainerAreNoImage) {
  using namespace std::string_literals;
  for (const std::string& bytes : {"RIFF"s, "RIFF\0\0\0\0"s, "RIFF\0\0\0\0WEBP"s, "BM"s, "junk"s}) {
    EXPECT_FALSE(parse_image(bytes, "a.png")) << bytes;
    EXPECT_FALSE(parse_depth_image(bytes, "a.png", 1.0)) << bytes;
  }
}

TEST_F(StillImage, ComesBackFromPng) {
  for (const auto& [width, height] : {std::pair(64, 48), std::pair(63, 47), std::pair(1, 1)}) {
    const auto written = ramp(width, height);
    ASSERT_THAT(write_png(path("a.png"), written->view()), IsOk());
    const auto read = read_image(path("a.png"));
    ASSERT_THAT(read, IsOk());
    ASSERT_EQ((*read)->width(), width);
    ASSERT_EQ((*read)->height(), height);
    int worst = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        worst =
            std::max(worst, std::abs((*read)->view().y.row(y)[x] - written->view().y.row(y)[x]));
      }
    }
    EXPECT_LE(worst, 3) << width;
  }
}

TEST_F(StillImage, PortableGraymapIsRead) {
  const auto read =
      parse_image(std::string("P5\n2 2\n255\n") + std::string("\x00\xff\x80\x40", 4), "a.pgm");
  ASSERT_THAT(read, IsOk());
  EXPECT_EQ((*read)->view().y.row(0)[0], 16);
  EXPECT_EQ((*read)->view().y.row(0)[1], 235);
}

// TIFF needs no compression, so that it can be made by hand.
std::string gray_tiff(uint16_t width, uint16_t height, uint16_t bits,
                      const std::vector<uint16_t>& numbers) {
  std::string out("II*\0\x08\0\0\0", 8);
  const auto put = [&out](auto value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const uint32_t data = 8 + 2 + 9 * 12 + 4;
  const std::array<std::array<uint32_t, 2>, 9> entries = {
      {{256, width},
       {257, height},
       {258, bits},
       {259, 1},
       {262, 1},
       {273, data},
       {277, 1},
       {278, height},
       {279, uint32_t{width} * height * bits / 8}}};
  put(uint16_t{9});
  for (const auto& [tag, value] : entries) {
    put(static_cast<uint16_t>(tag));
    put(uint16_t{4});
    put(uint32_t{1});
    put(value);
  }
  put(uint32_t{0});
  for (const uint16_t number : numbers) {
    if (bits == 16) put(number);
    if (bits == 8) put(static_cast<uint8_t>(number));
  }
  return out;
}

TEST_F(StillImage, DepthIsReadWithItsScale) {
  const auto depth = parse_depth_image(gray_tiff(2, 2, 16, {0, 1000, 65535, 513}), "d.tif", 0.001);
  ASSERT_THAT(depth, IsOk());
  EXPECT_EQ(depth->width, 2);
  EXPECT_EQ(depth->depth, (std::vector<float>{0, 0.001f * 1000, 0.001f * 65535, 0.001f * 513}));
}

TEST_F(StillImage, DepthRefusesByName) {
  EXPECT_THAT(parse_depth_image(gray_tiff(2, 1, 8, {1, 2}), "d.tif", 1),
              FailsWith("d.tif: holds gray"));
  EXPECT_THAT(parse_depth_image(gray_tiff(2, 1, 16, {0, 0}), "d.tif", 1), FailsWith("no depth"));
  EXPECT_THAT(parse_depth_image("hello", "d.png", 1), FailsWith("d.png: is none of"));
  ASSERT_THAT(write_png(path("c.png"), ramp(64, 48)->view()), IsOk());
  EXPECT_THAT(read_depth_image(path("c.png"), 1), FailsWith("16-bit gray"));
  EXPECT_THAT(read_depth_image("/nowhere/d.png", 1), FailsWith("/nowhere/d.png"));
}

TEST_F(StillImage, RefusesByName) {
  EXPECT_THAT(read_image("/nowhere/a.png"), FailsWith("/nowhere/a.png"));
  EXPECT_THAT(parse_image("GIF89a", "a.gif"), FailsWith("a.gif: is none of"));
  EXPECT_THAT(parse_image("", "a.png"), FailsWith("a.png"));
  ASSERT_THAT(write_png(path("b.png"), ramp(64, 48)->view()), IsOk());
  const auto whole = read_file(path("b.png"));
  ASSERT_THAT(whole, IsOk());
  for (const size_t length : {size_t{8}, size_t{20}, size_t{60}, whole->size() / 2}) {
    EXPECT_THAT(parse_image(whole->substr(0, length), "cut.png"), FailsWith("cut.png")) << length;
  }
}

}  // namespace
}  // namespace sightline
