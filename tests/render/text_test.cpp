// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <string>

#include "render/overlay/text/glyph_atlas.hpp"
#include "render/overlay/text/text_tile.hpp"
#include "sightline/render/overlay/label.hpp"
#include "sightline/render/overlay/overlay_style.hpp"
#include "test_images.hpp"

namespace sightline {
namespace {

using test::GrayImage;

TEST(OverlayStyle, ColorsAreBt601Limited) {
  EXPECT_EQ(to_yuv({255, 255, 255}), (Yuv{235, 128, 128}));
  EXPECT_EQ(to_yuv({0, 0, 0}), (Yuv{16, 128, 128}));
  EXPECT_EQ(to_yuv({255, 0, 0}), (Yuv{81, 90, 240}));
  EXPECT_EQ(to_yuv({0, 255, 0}), (Yuv{145, 54, 34}));
  EXPECT_EQ(to_yuv({0, 0, 255}), (Yuv{41, 240, 110}));
}

TEST(OverlayStyle, EveryNameHasItsOwnFlag) {
  for (const std::string_view name : style_names()) {
    OverlayStyle style = bare_style();
    bool* flag = style_flag(style, name);
    ASSERT_NE(flag, nullptr) << name;
    EXPECT_FALSE(*flag) << name;
    *flag = true;
    int on = 0;
    for (const std::string_view other : style_names()) on += *style_flag(style, other) ? 1 : 0;
    EXPECT_EQ(on, 1) << name;
  }
  OverlayStyle style;
  EXPECT_EQ(style_flag(style, "outlines"), nullptr);
  EXPECT_EQ(style_flag(style, ""), nullptr);
}

PoseEstimate estimate_at(double range) {
  PoseEstimate estimate;
  estimate.state = TrackState::kTracking;
  estimate.world_from_object.translation = {0, 0, range};
  estimate.covariance(3, 3) = 0.0008 * 0.0008;
  estimate.covariance(4, 4) = 0.0005 * 0.0005;
  estimate.last_measured = time_from_ns(1'000'000'000);
  return estimate;
}

TEST(Label, SaysNameStateRangeSigmaAge) {
  const LabelText text =
      label_text("carton", estimate_at(1.234), Rigid3(), time_from_ns(1'012'400'000));
  EXPECT_EQ(text.view(), "carton · tracking\n1.23 m  σ 0.8 mm  12 ms");
}

TEST(Label, RangeIsFromTheCamera) {
  Rigid3 world_from_camera;
  world_from_camera.translation = {0, 0, -20};
  PoseEstimate estimate = estimate_at(3);
  estimate.state = TrackState::kCoasting;
  estimate.covariance(4, 4) = 4e-4;
  const auto noticed = label_text("a", estimate, Rigid3(), time_from_ns(0), "camera knocked");
  EXPECT_NE(noticed.view().find(" · camera knocked\n"), std::string_view::npos);
  const LabelText text = label_text("a", estimate, world_from_camera, time_from_ns(1'250'000'000));
  EXPECT_EQ(text.view(), "a · coasting\n23.0 m  σ 20 mm  250 ms");
}

TEST(Label, SurvivesOddNumbersAndNames) {
  PoseEstimate estimate = estimate_at(5e6);
  estimate.covariance(3, 3) = 1e12;
  const LabelText far = label_text("x\ny", estimate, Rigid3(), time_from_ns(0));
  EXPECT_EQ(far.view(), "x y · tracking\n5000000 m  σ > 10 m  0 ms");
  std::string name;
  for (int i = 0; i < 100; ++i) name += "ü";
  const LabelText cut = label_text(name, estimate_at(1), Rigid3(), time_from_ns(1'000'000'000));
  EXPECT_NE(cut.view().find("ü… · tracking\n1.00 m"), std::string_view::npos) << cut.view();
}

TEST(Label, OtherTexts) {
  EXPECT_EQ(status_text("carton", TrackState::kSearching).view(), "carton: searching");
  EXPECT_EQ(status_text("carton", TrackState::kLost).view(), "carton: lost");
  EXPECT_EQ(offscreen_text("carton", 2.5).view(), "carton 2.50 m");
  EXPECT_EQ(last_seen_text("carton", from_seconds(3.21)).view(), "carton last seen 3.2 s ago");
}

TEST(Label, StateWithoutPose) {
  EXPECT_EQ(state_without_pose(nullptr), TrackState::kSearching);
  EXPECT_EQ(state_without_pose(
                std::make_shared<PoseTrack>(ObjectId(0), std::vector<PoseEstimate>{}, MotionNoise{})
                    .get()),
            TrackState::kSearching);
  for (const auto& [newest, shown] : {std::pair{TrackState::kSearching, TrackState::kSearching},
                                      std::pair{TrackState::kLost, TrackState::kLost},
                                      std::pair{TrackState::kTracking, TrackState::kLost}}) {
    PoseEstimate estimate;
    estimate.state = newest;
    EXPECT_EQ(
        state_without_pose(
            std::make_shared<PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{}).get()),
        shown);
  }
}

std::vector<uint32_t> decode(std::string_view text) {
  std::vector<uint32_t> points;
  while (!text.empty()) points.push_back(next_code_point(text));
  return points;
}

TEST(Utf8, Decodes) {
  EXPECT_EQ(decode("aé·σ…😀"), (std::vector<uint32_t>{'a', 0xE9, 0xB7, 0x3C3, 0x2026, 0x1F600}));
}

TEST(Utf8, ReplacesWhatIsNot) {
  EXPECT_EQ(decode("\x80"), (std::vector<uint32_t>{0xFFFD}));
  EXPECT_EQ(decode("\xC3"), (std::vector<uint32_t>{0xFFFD}));
  EXPECT_EQ(decode("\xE2\x82"), (std::vector<uint32_t>{0xFFFD, 0xFFFD}));
  EXPECT_EQ(decode("\xC0\xAF"), (std::vector<uint32_t>{0xFFFD, 0xFFFD}));  // overlong
  EXPECT_EQ(decode("\xED\xA0\x80z"),
            (std::vector<uint32_t>{0xFFFD, 0xFFFD, 0xFFFD, 'z'}));  // surrogate
  EXPECT_EQ(decode("\xF5\x80\x80\x80").front(), 0xFFFDu);
}

std::shared_ptr<const GlyphAtlas> atlas_or_skip(int em_px) {
  auto atlas = GlyphAtlas::create({}, em_px);
  return atlas ? *atlas : nullptr;
}

TEST(GlyphAtlas, AMissingFontSaysWhereAndWhatToInstall) {
  const auto atlas = GlyphAtlas::create("/nowhere/font.ttf", 16);
  ASSERT_FALSE(atlas.has_value());
  EXPECT_EQ(atlas.error().code, ErrorCode::kNotFound);
  EXPECT_NE(atlas.error().message().find("/nowhere/font.ttf"), std::string::npos);
  EXPECT_NE(atlas.error().message().find("fonts-dejavu-core"), std::string::npos);
}

TEST(GlyphAtlas, AFileThatIsNoFontIsRefused) {
  const std::string path = testing::TempDir() + "/sightline_no_font.ttf";
  std::ofstream(path) << "this is not a font";
  const auto atlas = GlyphAtlas::create(path, 16);
  ASSERT_FALSE(atlas.has_value());
  EXPECT_EQ(atlas.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(atlas.error().message().find(path), std::string::npos);
}

TEST(GlyphAtlas, HoldsLatin1AndTheLabelsSymbols) {
  const auto atlas = atlas_or_skip(16);
  if (!atlas) GTEST_SKIP() << "no DejaVu Sans here";
  const Glyph& missing = atlas->glyph(0x4E2D);
  for (const uint32_t point : {uint32_t{'A'}, uint32_t{0xE9}, uint32_t{0xB7}, uint32_t{0xB1},
                               uint32_t{0x3C3}, uint32_t{0x2026}, uint32_t{0x2192}}) {
    const Glyph& glyph = atlas->glyph(point);
    EXPECT_NE(&glyph, &missing) << point;
    EXPECT_GT(glyph.width, 0) << point;
    EXPECT_GT(glyph.advance, 0) << point;
  }
  EXPECT_EQ(&atlas->glyph(0x1F600), &missing);
  EXPECT_GT(atlas->glyph('W').advance, atlas->glyph('i').advance);
}

class TextTileTest : public testing::Test {
 protected:
  void SetUp() override {
    atlas_ = atlas_or_skip(16);
    if (!atlas_) GTEST_SKIP() << "no DejaVu Sans here";
  }
  std::shared_ptr<const GlyphAtlas> atlas_;
  const std::array<Yuv, 1> white_ = {Yuv{235, 128, 128}};
};

TEST_F(TextTileTest, LegibleOnBrightAndDark) {
  TextTile tile(atlas_, 40, 2);
  tile.set("Häuser 0123", white_);
  for (const int background : {16, 128, 235}) {
    GrayImage image(200, 60, background);
    blend_tile(tile.at(10, 10), image.mutable_view());
    int darkest = 255;
    int brightest = 0;
    test::for_each_luma(image.view(), [&](int, int, int y) {
      darkest = std::min(darkest, y);
      brightest = std::max(brightest, y);
    });
    EXPECT_LT(darkest, 80) << background;
    EXPECT_GT(brightest, 220) << background;
    for (const auto& [x, y] : test::differing_luma(image.view(), background)) {
      EXPECT_TRUE(x >= 10 && y >= 10 && x < 10 + tile.width() && y < 10 + tile.height());
    }
  }
}

TEST_F(TextTileTest, LinesStackAndTakeTheirColors) {
  TextTile tile(atlas_, 40, 3);
  tile.set("one", white_);
  const int one = tile.height();
  const std::array<Yuv, 2> colors = {Yuv{81, 90, 240}, Yuv{235, 128, 128}};
  tile.set("one\nthree long\nx", colors);
  EXPECT_NEAR(tile.height(), one + 2 * atlas_->line_height(), 2);
  GrayImage image(200, 90, 100);
  blend_tile(tile.at(0, 0), image.mutable_view());
  int top_red = 0;
  int bottom_red = 0;
  for (int y = 0; y < 45; ++y) {
    for (int x = 0; x < 100; ++x) {
      const bool red = image.view().v.row(y)[x] > 150;
      (2 * y < one ? top_red : bottom_red) += red ? 1 : 0;
    }
  }
  EXPECT_GT(top_red, 3);
  EXPECT_EQ(bottom_red, 0);
}

TEST_F(TextTileTest, WhatDoesNotFitIsLeftOutAndNothingRemains) {
  TextTile tile(atlas_, 4, 1);
  tile.set("WWWWWWWWWWWWWWWWWWWWWWWWWWWWWW\nW\nW", white_);
  EXPECT_LE(tile.width(), 4 * atlas_->widest_advance() + 16);
  EXPECT_LE(tile.height(), atlas_->line_height() + 16);
  TextTile fresh(atlas_, 4, 1);
  tile.set("i", white_);
  fresh.set("i", white_);
  GrayImage a(80, 40, 100);
  GrayImage b(80, 40, 100);
  blend_tile(tile.at(0, 0), a.mutable_view());
  blend_tile(fresh.at(0, 0), b.mutable_view());
  EXPECT_TRUE(test::same_pixels(a.view(), b.view()));
  tile.set("", white_);
  EXPECT_EQ(tile.width(), 0);
  EXPECT_EQ(tile.height(), 0);
}

}  // namespace
}  // namespace sightline
