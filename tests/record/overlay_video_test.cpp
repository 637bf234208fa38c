// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/overlay_video.hpp"

#include <gmock/gmock.h>

#include <cstdlib>

#include "record/media.hpp"
#include "sightline/record/video_reader.hpp"

namespace sightline {
namespace {

using namespace test;

TEST(OverlayVideo, HoldsEveryImage) {
  TempFolder temp;
  auto writer = OverlayVideoWriter::create(temp / "v.mkv", {kWidth, kHeight, 30});
  ASSERT_TRUE(writer) << writer.error().message();
  for (int i = 0; i < 40; ++i) {
    // Times that stand still make no difference to the count.
    const Time capture(std::chrono::milliseconds(i / 2 * 33));
    ASSERT_TRUE((*writer)->append(pattern(i)->view(), capture));
  }
  ASSERT_TRUE((*writer)->close());
  auto reader = VideoReader::open(temp / "v.mkv", "h264", kWidth, kHeight);
  if (!reader) reader = VideoReader::open(temp / "v.mkv", "mpeg4", kWidth, kHeight);
  ASSERT_TRUE(reader) << reader.error().message();
  int count = 0;
  while (const auto frame = *(*reader)->next()) {
    const int here = frame->image->view().y.row(20)[20];
    const int expected = pattern(count)->view().y.row(20)[20];
    EXPECT_LT(std::abs(here - expected), 40);
    ++count;
  }
  EXPECT_EQ(count, 40);
}

TEST(OverlayVideo, Refusals) {
  TempFolder temp;
  EXPECT_FALSE(OverlayVideoWriter::create(temp / "v.mkv", {63, 48, 30}));
  EXPECT_FALSE(OverlayVideoWriter::create(temp.path() / "no" / "v.mkv", {64, 48, 30}));
  auto writer = *OverlayVideoWriter::create(temp / "v.mkv", {32, 32, 30});
  EXPECT_FALSE(writer->append(pattern(0)->view(), Time{}));
}

TEST(Png, IsAnImageOfTheRightSize) {
  TempFolder temp;
  ASSERT_TRUE(write_png(temp / "p.png", pattern(3)->view()));
  const std::string bytes = read_text(temp / "p.png");
  ASSERT_GT(bytes.size(), 33u);
  EXPECT_EQ(bytes.substr(1, 3), "PNG");
  EXPECT_EQ(bytes.substr(12, 4), "IHDR");
  EXPECT_EQ(bytes[19], kWidth);
  EXPECT_EQ(bytes[23], kHeight);
  EXPECT_EQ(bytes.substr(bytes.size() - 8, 4), "IEND");
  EXPECT_FALSE(write_png(temp.path() / "no" / "p.png", pattern(3)->view()));
}

}  // namespace
}  // namespace sightline
