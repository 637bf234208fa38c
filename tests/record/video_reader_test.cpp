// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/video_reader.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>

#include "record/media.hpp"
#include "record/media/avc.hpp"

namespace sightline {
namespace {

using namespace test;
using namespace record;

std::vector<VideoFrame> read_all(const std::filesystem::path& path, const std::string& codec,
                                 bool payload = false) {
  auto reader = VideoReader::open(path, codec, kWidth, kHeight, {payload, {}});
  if (!reader) {
    ADD_FAILURE() << reader.error().message();
    return {};
  }
  std::vector<VideoFrame> frames;
  for (;;) {
    auto frame = (*reader)->next();
    if (!frame || !*frame) {
      EXPECT_TRUE(frame);
      return frames;
    }
    EXPECT_EQ((*frame)->index, frames.size());
    frames.push_back(**std::move(frame));
  }
}

/// Mean difference of luma.
double difference(const I420View& a, const I420View& b) {
  double sum = 0;
  for (int y = 0; y < a.height(); ++y) {
    for (int x = 0; x < a.width(); ++x) sum += std::abs(a.y.row(y)[x] - b.y.row(y)[x]);
  }
  return sum / (a.width() * a.height());
}

struct Coding {
  const char* codec;
  const char* encoder;
  int b_frames;
  double tolerance;
};

class EveryCodec : public testing::TestWithParam<Coding> {};

TEST_P(EveryCodec, GivesTheImagesInDisplayOrder) {
  const Coding coding = GetParam();
  TempFolder temp;
  const Stream stream = encode_patterns(coding.encoder, 30, 10, coding.b_frames);
  if (stream.packets.empty()) GTEST_SKIP() << "no encoder " << coding.encoder;
  write_stream(temp / "v.mkv", coding.codec, stream);
  EXPECT_EQ(*count_video_frames(temp / "v.mkv", coding.codec, kWidth, kHeight), 30u);
  const auto frames = read_all(temp / "v.mkv", coding.codec);
  ASSERT_EQ(frames.size(), 30u);
  for (size_t i = 0; i < 30; ++i) {
    EXPECT_EQ(frames[i].status, FrameStatus::kGood);
    const auto source = pattern(static_cast<int>(i));
    const auto next = pattern(static_cast<int>(i) + 1);
    const double here = difference(frames[i].image->view(), source->view());
    EXPECT_LE(here, coding.tolerance) << i;
    EXPECT_LT(here, difference(frames[i].image->view(), next->view())) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, EveryCodec,
                         testing::Values(Coding{"h264", "libx264", 0, 5},
                                         Coding{"h264", "libx264", 2, 5},
                                         Coding{"mpeg4", "mpeg4", 0, 5},
                                         Coding{"mpeg4", "mpeg4", 2, 5},
                                         Coding{"ffv1", "ffv1", 0, 0}));

TEST(VideoReader, BringsFullRangeIntoLimitedRange) {
  TempFolder temp;
  write_stream(temp / "v.mkv", "mjpeg", encode_patterns("mjpeg", 3, 1));
  const auto frames = read_all(temp / "v.mkv", "mjpeg");
  ASSERT_EQ(frames.size(), 3u);
  const auto source = pattern(1);
  const auto got = frames[1].image->view(), from = source->view();
  double luma = 0, chroma = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      luma += std::abs(got.y.row(y)[x] - (16.0 + from.y.row(y)[x] * 219.0 / 255.0));
      chroma += std::abs(got.u.row(y / 2)[x / 2] -
                         (128.0 + (from.u.row(y / 2)[x / 2] - 128.0) * 224.0 / 255.0));
    }
  }
  EXPECT_LT(luma / (kWidth * kHeight), 3.0);
  EXPECT_LT(chroma / (kWidth * kHeight), 3.0);
}

TEST(VideoReader, RewindGivesTheSameImagesAgain) {
  TempFolder temp;
  write_stream(temp / "v.mkv", "mpeg4", encode_patterns("mpeg4", 12, 6));
  auto reader = *VideoReader::open(temp / "v.mkv", "mpeg4", kWidth, kHeight);
  std::vector<uint64_t> turns[2];
  for (auto& turn : turns) {
    for (;;) {
      const auto frame = reader->next();
      ASSERT_TRUE(frame);
      if (!*frame) break;
      turn.push_back(hash_of((*frame)->image->view()));
    }
    ASSERT_TRUE(reader->rewind());
  }
  EXPECT_EQ(turns[0].size(), 12u);
  EXPECT_EQ(turns[0], turns[1]);
}

/// Damages packet `broken` so that its image does not come out, and expects every image that
/// does not build on it to keep its place.
void expect_place_kept(const char* codec, const char* encoder, int b_frames, size_t broken) {
  TempFolder temp;
  Stream stream = encode_patterns(encoder, 30, 10, b_frames);
  if (stream.packets.empty()) GTEST_SKIP() << "no encoder " << encoder;
  write_stream(temp / "good.mkv", codec, stream);
  auto& bytes = stream.packets[broken].bytes;
  std::fill(bytes.begin() + 4, bytes.end(), uint8_t{0});
  write_stream(temp / "bad.mkv", codec, stream);
  const auto good = read_all(temp / "good.mkv", codec);
  const auto bad = read_all(temp / "bad.mkv", codec);
  ASSERT_EQ(good.size(), 30u);
  ASSERT_EQ(bad.size(), 30u);
  const auto displayed = static_cast<size_t>(stream.packets[broken].pts / 100);
  EXPECT_EQ(bad[displayed].status, FrameStatus::kDamaged);
  // Groups of ten start anew.
  for (size_t i = 0; i < 30; ++i) {
    if (i / 10 == displayed / 10) continue;
    EXPECT_EQ(hash_of(bad[i].image->view()), hash_of(good[i].image->view())) << i;
    EXPECT_EQ(bad[i].status, FrameStatus::kGood) << i;
  }
}

TEST(VideoReader, LostImageKeepsItsPlace) { expect_place_kept("h264", "libx264", 0, 14); }
TEST(VideoReader, LostImageKeepsItsPlaceWhenReordered) {
  expect_place_kept("h264", "libx264", 2, 15);
}

TEST(VideoReader, LostJpegIsReplacedByTheOneBefore) {
  TempFolder temp;
  Stream stream = encode_patterns("mjpeg", 5, 1);
  stream.packets[0].bytes = {1, 2, 3, 4};
  stream.packets[2].bytes = {1, 2, 3, 4};
  write_stream(temp / "v.mkv", "mjpeg", stream);
  const auto frames = read_all(temp / "v.mkv", "mjpeg");
  ASSERT_EQ(frames.size(), 5u);
  EXPECT_EQ(frames[0].status, FrameStatus::kDamaged);
  EXPECT_EQ(frames[0].image->view().y.row(3)[3], 128);
  EXPECT_EQ(frames[1].status, FrameStatus::kGood);
  EXPECT_EQ(frames[2].status, FrameStatus::kDamaged);
  EXPECT_EQ(hash_of(frames[2].image->view()), hash_of(frames[1].image->view()));
  EXPECT_EQ(frames[3].status, FrameStatus::kGood);
}

TEST(VideoReader, PayloadIsOnlyGivenWhereItCanBeRecordedAgain) {
  TempFolder temp;
  write_stream(temp / "j.mkv", "mjpeg", encode_patterns("mjpeg", 3, 1));
  const auto jpegs = read_all(temp / "j.mkv", "mjpeg", true);
  ASSERT_EQ(jpegs.size(), 3u);
  EXPECT_EQ(jpegs[1].format, PixelFormat::kMjpeg);
  EXPECT_EQ(jpegs[1].payload.bytes[0], 0xff);
  EXPECT_EQ(jpegs[1].payload.bytes[1], 0xd8);
  write_stream(temp / "m.mkv", "mpeg4", encode_patterns("mpeg4", 3, 3));
  EXPECT_TRUE(read_all(temp / "m.mkv", "mpeg4", true).at(1).payload.bytes.empty());
  const Stream reordered = encode_patterns("libx264", 20, 10, 2);
  if (reordered.packets.empty()) GTEST_SKIP() << "no encoder libx264";
  write_stream(temp / "h.mkv", "h264", reordered);
  for (const auto& frame : read_all(temp / "h.mkv", "h264", true)) {
    EXPECT_TRUE(frame.payload.bytes.empty());
    EXPECT_EQ(frame.format, PixelFormat::kI420);
  }
}

/// Any byte may be wrong in a file from outside.
TEST(VideoReader, SurvivesDamagedFiles) {
  TempFolder temp;
  write_stream(temp / "good.mkv", "mpeg4", encode_patterns("mpeg4", 8, 4));
  const std::string good = read_text(temp / "good.mkv");
  uint32_t random = 1;
  for (size_t run = 0; run < 100; ++run) {
    std::string bad = good;
    for (int i = 0; i < 5; ++i) {
      random = random * 1664525u + 1013904223u;
      bad[(random >> 4) % bad.size()] = static_cast<char>(random >> 24);
    }
    if (run % 3 == 0) bad.resize(bad.size() * run / 100);
    write_text(temp / "bad.mkv", bad);
    auto reader = VideoReader::open(temp / "bad.mkv", "mpeg4", kWidth, kHeight);
    size_t frames = 0;
    while (reader && frames < 1000) {
      const auto frame = (*reader)->next();
      if (!frame || !*frame) break;
      ++frames;
    }
    EXPECT_LT(frames, 1000u);
  }
}

TEST(Avc, BecomesAByteStream) {
  const std::vector<uint8_t> avcc = {1, 100, 0, 10, 0xff, 0xe1, 0, 3, 0x67, 1, 2, 1, 0, 2, 0x68, 3};
  const auto avc = parse_avc_configuration(avcc);
  EXPECT_EQ(avc.length_size, 4);
  EXPECT_THAT(avc.parameter_sets,
              testing::ElementsAre(0, 0, 0, 1, 0x67, 1, 2, 0, 0, 0, 1, 0x68, 3));
  EXPECT_EQ(parse_avc_configuration(avc.parameter_sets).parameter_sets, avc.parameter_sets);
  const std::vector<uint8_t> packet = {0, 0, 0, 2, 0x65, 9, 0, 0, 0, 9, 1};
  EXPECT_THAT(to_annex_b(packet, avc, false), testing::ElementsAre(0, 0, 0, 1, 0x65, 9));
  EXPECT_EQ(to_annex_b(packet, avc, true).size(), 13u + 6u);
  for (size_t n = 0; n < avcc.size(); ++n) {
    EXPECT_LE(parse_avc_configuration(std::span(avcc).first(n)).parameter_sets.size(), 13u);
  }
}

}  // namespace
}  // namespace sightline
