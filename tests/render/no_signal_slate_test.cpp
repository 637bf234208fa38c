// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/no_signal_slate.hpp"

#include <gtest/gtest.h>

#include "test_images.hpp"

namespace sightline {
namespace {

using test::GrayImage;

TEST(NoSignalSlate, SaysWhoAndSinceWhen) {
  EXPECT_EQ(no_signal_text("left", 1'700'000'000'000'000'000),
            "left: no signal since 22:13:20 UTC");
}

TEST(NoSignalSlate, TakesTheColorAndDimsTheLastImage) {
  GrayImage last(320, 240, 216);
  GrayImage::fill(last.mutable_view().u, 60);
  Image shown(320, 240);
  const auto slate = NoSignalSlate::create(320, 240, {});
  const I420View view = last.view();
  slate->draw(shown.mutable_view(), &view, "left: no signal since 22:13:20 UTC");
  EXPECT_EQ(shown.view().y.row(0)[0], 116);
  EXPECT_EQ(shown.view().u.row(0)[0], 128);
  EXPECT_EQ(shown.view().v.row(119)[159], 128);
  const auto written = test::differing_luma(shown.view(), 116);
  ASSERT_GT(written.size(), 200u);
  for (const auto& [x, y] : written) EXPECT_NEAR(y, 120, 40);
}

TEST(NoSignalSlate, IsPlainGrayWithoutALastImage) {
  Image shown(320, 240);
  NoSignalSlate::create(320, 240, {})->draw(shown.mutable_view(), nullptr, "");
  EXPECT_TRUE(test::differing_luma(shown.view(), 72).empty());
}

TEST(NoSignalSlate, BreaksATextThatIsTooWide) {
  Image wide(640, 480), narrow(128, 96);
  const std::string text = no_signal_text("a-rather-long-name", 0);
  NoSignalSlate::create(640, 480, {})->draw(wide.mutable_view(), nullptr, text);
  NoSignalSlate::create(128, 96, {})->draw(narrow.mutable_view(), nullptr, text);
  const auto rows = [](const Image& image) {
    int first = image.height(), last = 0;
    for (const auto& [x, y] : test::differing_luma(image.view(), 72)) {
      first = std::min(first, y);
      last = std::max(last, y);
    }
    return static_cast<double>(last - first);
  };
  EXPECT_LT(rows(wide), 480 / 10.0);
  EXPECT_GT(rows(narrow), 96 / 6.0);
}

TEST(NoSignalSlate, LeavesTheTextOutWithoutAFont) {
  Image shown(64, 64);
  NoSignalSlate::create(64, 64, "missing.ttf")->draw(shown.mutable_view(), nullptr, "a: b");
  EXPECT_TRUE(test::differing_luma(shown.view(), 72).empty());
}

}  // namespace
}  // namespace sightline
