// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/writer.hpp"

#include <gmock/gmock.h>

#include <cstring>

#include "record/media.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/image/h264.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::HasSubstr;

std::unique_ptr<RecordingWriter> one_camera(const fs::path& folder, PixelFormat format,
                                            RawStorage storage = RawStorage::kRaw) {
  RecordingWriterOptions options;
  options.cameras = {{"cam", format, kWidth, kHeight}};
  options.raw_storage = storage;
  auto writer = RecordingWriter::create(folder, options);
  SL_CHECK(writer.has_value(), writer.error().message());
  return *std::move(writer);
}

FrameInfo info_at(int number, PixelFormat format) {
  FrameInfo info = frame_at(0, number, 1000 + 100 * number)->info();
  info.format = format;
  return info;
}

/// All frames of the only camera, payloads included.
std::vector<FramePtr> replay_all(const fs::path& folder) {
  auto recording = open_recording(folder, RecordingMode::kStrict);
  if (!recording) {
    ADD_FAILURE() << recording.error().message();
    return {};
  }
  auto replay =
      *VirtualReplay::open(std::make_shared<const Recording>(*std::move(recording)), {true, {}});
  std::vector<FramePtr> frames;
  while (auto set = *replay->next()) frames.insert(frames.end(), set->begin(), set->end());
  return frames;
}

std::vector<uint8_t> noise(size_t size, uint32_t seed) {
  std::vector<uint8_t> bytes(size);
  for (auto& byte : bytes) {
    seed = seed * 1664525u + 1013904223u;
    byte = static_cast<uint8_t>(seed >> 24);
  }
  return bytes;
}

/// A raw frame of noise; `stride` 0 means tightly packed.
FramePtr noise_frame(int number, PixelFormat format, ptrdiff_t stride = 0) {
  const size_t size = *raw_image_bytes(format, kWidth, kHeight, stride);
  FramePayload payload = payload_of(noise(size, static_cast<uint32_t>(number)));
  payload.stride = stride;
  return Frame::raw(info_at(number, format), payload, std::make_shared<ImagePool>(kWidth, kHeight));
}

std::string name_of(const testing::TestParamInfo<PixelFormat>& info) {
  return std::string(to_string(info.param));
}

class EveryRawFormat : public testing::TestWithParam<PixelFormat> {};

TEST_P(EveryRawFormat, PayloadComesBackAsItWas) {
  TempFolder temp;
  std::vector<FramePtr> written;
  auto writer = one_camera(temp / "r", GetParam());
  for (int i = 0; i < 5; ++i) {
    written.push_back(noise_frame(i, GetParam()));
    ASSERT_TRUE(writer->append(*written.back()));
  }
  ASSERT_TRUE(writer->close());
  const auto read = replay_all(temp / "r");
  ASSERT_EQ(read.size(), 5u);
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(read[i]->info().format, GetParam());
    EXPECT_THAT(read[i]->payload().bytes, testing::ElementsAreArray(written[i]->payload().bytes));
    EXPECT_EQ(hash_of(read[i]->i420()), hash_of(written[i]->i420()));
    EXPECT_EQ(read[i]->info().capture, written[i]->info().capture);
    EXPECT_EQ(read[i]->info().arrival, written[i]->info().arrival);
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, EveryRawFormat,
                         testing::Values(PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv,
                                         PixelFormat::kUyvy, PixelFormat::kGray, PixelFormat::kY10,
                                         PixelFormat::kY12, PixelFormat::kY16, PixelFormat::kRgb24,
                                         PixelFormat::kBgr24),
                         name_of);

TEST(RecordingWriter, PaddingOfRowsIsNotStored) {
  TempFolder temp;
  for (const auto format : {PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv}) {
    const ptrdiff_t stride = (format == PixelFormat::kYuyv ? 2 * kWidth : kWidth) + 32;
    const auto frame = noise_frame(3, format, stride);
    const fs::path folder = temp / std::string(to_string(format));
    auto writer = one_camera(folder, format);
    ASSERT_TRUE(writer->append(*frame));
    ASSERT_TRUE(writer->close());
    const auto read = replay_all(folder);
    ASSERT_EQ(read.size(), 1u);
    EXPECT_EQ(read[0]->payload().bytes.size(), *raw_image_bytes(format, kWidth, kHeight, 0));
    EXPECT_EQ(hash_of(read[0]->i420()), hash_of(frame->i420()));
  }
}

TEST(RecordingWriter, AsI420TakesFramesOfEveryFormat) {
  TempFolder temp;
  auto writer = one_camera(temp / "any", PixelFormat::kI420);
  const auto frame = noise_frame(3, PixelFormat::kYuyv, 2 * kWidth);
  const Status written = writer->append(*frame);
  ASSERT_TRUE(written) << written.error().message();
  ASSERT_TRUE(writer->close());
  const auto read = replay_all(temp / "any");
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(hash_of(read[0]->i420()), hash_of(frame->i420()));
}

class EveryFfv1Format : public testing::TestWithParam<PixelFormat> {};

TEST_P(EveryFfv1Format, IsLossless) {
  TempFolder temp;
  const auto frame = noise_frame(5, GetParam());
  auto writer = one_camera(temp / "r", GetParam(), RawStorage::kFfv1);
  ASSERT_TRUE(writer->append(*frame));
  ASSERT_TRUE(writer->close());
  const auto read = replay_all(temp / "r");
  ASSERT_EQ(read.size(), 1u);
  const PlaneView got = read[0]->gray(), expected = frame->i420().y;
  for (int y = 0; y < kHeight; ++y) {
    ASSERT_EQ(0, std::memcmp(got.row(y), expected.row(y), kWidth)) << y;
  }
  // 4:2:2 is stored whole, but reaches 4:2:0 by another filter than from the camera.
  if (GetParam() == PixelFormat::kYuyv || GetParam() == PixelFormat::kUyvy) return;
  EXPECT_EQ(hash_of(read[0]->i420()), hash_of(frame->i420()));
}

INSTANTIATE_TEST_SUITE_P(Formats, EveryFfv1Format,
                         testing::Values(PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kGray,
                                         PixelFormat::kYuyv, PixelFormat::kUyvy),
                         name_of);

TEST(RecordingWriter, Ffv1RefusesFormatsItCannotHold) {
  TempFolder temp;
  RecordingWriterOptions options;
  options.cameras = {{"cam", PixelFormat::kRgb24, kWidth, kHeight}};
  options.raw_storage = RawStorage::kFfv1;
  const auto writer = RecordingWriter::create(temp / "r", options);
  ASSERT_FALSE(writer);
  EXPECT_THAT(writer.error().message(), HasSubstr("cam: FFV1 does not hold"));
}

TEST(RecordingWriter, JpegsPassThrough) {
  TempFolder temp;
  const Stream stream = encode_patterns("mjpeg", 6, 1);
  auto writer = one_camera(temp / "r", PixelFormat::kMjpeg);
  for (int i = 0; i < 6; ++i) {
    const auto& packet = stream.packets[static_cast<size_t>(i)];
    ASSERT_TRUE(writer->append(
        *Frame::decoded(info_at(i, PixelFormat::kMjpeg), pattern(i), payload_of(packet.bytes))));
  }
  ASSERT_TRUE(writer->close());
  const auto read = replay_all(temp / "r");
  ASSERT_EQ(read.size(), 6u);
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_THAT(read[i]->payload().bytes, testing::ElementsAreArray(stream.packets[i].bytes));
  }
}

/// As a camera sends it: Annex B, parameter sets before key frames.
std::vector<Packet> camera_h264(int count, int gop) {
  Stream stream = encode_patterns("libx264", count, gop);
  for (auto& packet : stream.packets) {
    if (!packet.keyframe || !annex_b_parameter_sets(packet.bytes).empty()) continue;
    const auto sets = annex_b_parameter_sets(stream.extradata);
    packet.bytes.insert(packet.bytes.begin(), sets.begin(), sets.end());
  }
  return stream.packets;
}

std::vector<std::vector<uint8_t>> units_of(std::span<const uint8_t> bytes) {
  std::vector<std::vector<uint8_t>> units;
  NalReader reader(bytes);
  while (const auto unit = reader.next()) units.emplace_back(unit->body.begin(), unit->body.end());
  return units;
}

TEST(RecordingWriter, H264PassesThroughFromTheFirstKeyFrame) {
  TempFolder temp;
  const auto packets = camera_h264(20, 5);
  if (packets.empty()) GTEST_SKIP() << "no encoder libx264";
  auto writer = one_camera(temp / "r", PixelFormat::kH264);
  for (int i = 3; i < 20; ++i) {
    const auto& packet = packets[static_cast<size_t>(i)];
    ASSERT_TRUE(writer->append(*Frame::decoded(info_at(i, PixelFormat::kH264), pattern(i),
                                               payload_of(packet.bytes, packet.keyframe))));
  }
  EXPECT_EQ(writer->skipped(), 2u);
  EXPECT_EQ(writer->written(), 15u);
  ASSERT_TRUE(writer->close());
  const auto read = replay_all(temp / "r");
  ASSERT_EQ(read.size(), 15u);
  EXPECT_EQ(read[0]->info().sequence, 5u);
  for (size_t i = 0; i < 15; ++i) {
    EXPECT_EQ(read[i]->info().status, FrameStatus::kGood);
    EXPECT_EQ(read[i]->payload().keyframe, packets[i + 5].keyframe);
    EXPECT_EQ(units_of(read[i]->payload().bytes), units_of(packets[i + 5].bytes)) << i;
  }
  // And what was replayed can be recorded again.
  auto again = one_camera(temp / "again", PixelFormat::kH264);
  for (const auto& frame : read) ASSERT_TRUE(again->append(*frame));
  ASSERT_TRUE(again->close());
  EXPECT_EQ(read_text(temp.path() / "again" / "frames.csv"),
            read_text(temp.path() / "r" / "frames.csv"));
  const auto second = replay_all(temp / "again");
  ASSERT_EQ(second.size(), read.size());
  for (size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(hash_of(second[i]->i420()), hash_of(read[i]->i420()));
  }
}

TEST(RecordingWriter, NumbersGrowOverReopenedSourcesAndTimesNeverRunBackwards) {
  TempFolder temp;
  auto writer = one_camera(temp / "r", PixelFormat::kI420);
  const auto append = [&](uint32_t epoch, int number, int64_t ms, uint32_t dropped) {
    FrameInfo info = frame_at(0, number, ms)->info();
    info.epoch = epoch;
    info.dropped_before = dropped;
    ASSERT_TRUE(writer->append(*Frame::decoded(info, pattern(number))));
  };
  append(0, 7, 1000, 0);
  append(0, 8, 1100, 0);
  append(0, 8, 1200, 0);  // the same number
  append(0, 9, 1050, 0);  // an earlier time
  append(0, 10, 1300, 1);
  append(1, 0, 1500, 0);  // reopened
  append(1, 2, 1600, 1);
  ASSERT_TRUE(writer->close());
  EXPECT_EQ(writer->skipped(), 2u);
  const auto recording = open_recording(temp / "r", RecordingMode::kStrict);
  ASSERT_TRUE(recording) << recording.error().message();
  std::vector<uint64_t> numbers, dropped;
  for (const auto& row : recording->cameras[0].rows) {
    numbers.push_back(row.sequence);
    dropped.push_back(row.dropped_before);
  }
  EXPECT_THAT(numbers, testing::ElementsAre(7, 8, 10, 11, 13));
  EXPECT_THAT(dropped, testing::ElementsAre(0, 0, 3, 0, 1));
}

TEST(RecordingWriter, StampsAreKeptAsTheCameraSaidThem) {
  TempFolder temp;
  auto writer = one_camera(temp / "r", PixelFormat::kGray);
  std::vector<FramePtr> stamped;
  for (int i = 0; i < 3; ++i) {
    stamped.push_back(noise_frame(i, PixelFormat::kGray));
    const FramePtr later = Frame::with_time_offset(stamped.back(), std::chrono::milliseconds(17));
    EXPECT_EQ(later->info().capture - stamped.back()->info().capture,
              std::chrono::milliseconds(17));
    ASSERT_TRUE(writer->append(*later));
  }
  ASSERT_TRUE(writer->close());
  const auto back = replay_all(temp / "r");
  ASSERT_EQ(back.size(), 3u);
  for (size_t i = 0; i < back.size(); ++i) {
    EXPECT_EQ(back[i]->info().capture, stamped[i]->info().capture);
  }
}

TEST(RecordingWriter, RefusesToOverwrite) {
  TempFolder temp;
  write_small_recording(temp / "r", 2);
  const std::string before = read_text(temp.path() / "r" / "frames.csv");
  RecordingWriterOptions options;
  options.cameras = {{"cam", PixelFormat::kI420, kWidth, kHeight}};
  const auto writer = RecordingWriter::create(temp / "r", options);
  ASSERT_FALSE(writer);
  EXPECT_THAT(writer.error().message(), HasSubstr("never overwritten"));
  EXPECT_EQ(read_text(temp.path() / "r" / "frames.csv"), before);
}

TEST(RecordingWriter, RefusesBadOptions) {
  TempFolder temp;
  RecordingWriterOptions options;
  EXPECT_FALSE(RecordingWriter::create(temp / "a", options));
  options.cameras = {{"../x", PixelFormat::kI420, kWidth, kHeight}};
  EXPECT_FALSE(RecordingWriter::create(temp / "a", options));
  options.cameras = {{"x", PixelFormat::kI420, 0, kHeight}};
  EXPECT_FALSE(RecordingWriter::create(temp / "a", options));
  options.cameras = {{"x", PixelFormat::kI420, 32, 32}};
  EXPECT_FALSE(RecordingWriter::create(temp.path() / "no" / "such" / "folder", options));
  options.objects = {temp / "missing.toml"};
  EXPECT_FALSE(RecordingWriter::create(temp / "b", options));
}

TEST(RecordingWriter, RefusesFramesOfAnotherKind) {
  TempFolder temp;
  RecordingWriterOptions options;
  options.cameras = {{"x", PixelFormat::kI420, 32, 32}};
  auto writer = *RecordingWriter::create(temp / "c", options);
  const auto status = writer->append(*frame_at(0, 0, 0));
  ASSERT_FALSE(status);
  EXPECT_THAT(status.error().message(), HasSubstr("x: sends 64 x 48 images"));
  EXPECT_FALSE(writer->append(*frame_at(0, 1, 100))) << "an error is final";
  auto other = one_camera(temp / "d", PixelFormat::kI420);
  EXPECT_FALSE(other->append(*frame_at(5, 0, 0)));
  auto closed = one_camera(temp / "e", PixelFormat::kI420);
  ASSERT_TRUE(closed->close());
  EXPECT_FALSE(closed->append(*frame_at(0, 0, 0)));
}

TEST(RecordingWriter, CopiesObjectsWithTheirParts) {
  TempFolder temp;
  const fs::path lib = temp / "lib", other = temp / "other";
  fs::create_directories(lib / "meshes");
  fs::create_directories(other);
  write_text(lib / "cup.toml", "name = \"cup\"\nmesh = \"meshes/cup.obj\"\n");
  write_text(lib / "meshes" / "cup.obj", "mtllib the cup.mtl\nv 0 0 0\nf 1 1 1\n");
  write_text(lib / "meshes" / "the cup.mtl", "newmtl a\nmap_Kd cup.png\n");
  write_text(lib / "meshes" / "cup.png", "png");
  write_text(other / "box.ply", "ply");
  write_text(other / "box.toml", "mesh = \"box.ply\"\n");
  RecordingWriterOptions options;
  options.name = "with \"quotes\"";
  options.cameras = {{"cam", PixelFormat::kI420, kWidth, kHeight}};
  options.calibration_toml = "# calibration\n";
  options.objects = {lib / "cup.toml", other / "box.toml"};
  options.scene = lib / "meshes" / "cup.obj";
  auto writer = RecordingWriter::create(temp / "r", options);
  ASSERT_TRUE(writer) << writer.error().message();
  ASSERT_TRUE((*writer)->append(*frame_at(0, 0, 1000)));
  ASSERT_TRUE((*writer)->append_pose({Time{}, "cup", TrackState::kSearching, {}, 0, 0, {}}));
  ASSERT_TRUE((*writer)->close());
  const auto recording = open_recording(temp / "r", RecordingMode::kStrict);
  ASSERT_TRUE(recording) << recording.error().message();
  EXPECT_EQ(recording->name, "with \"quotes\"");
  EXPECT_TRUE(recording->calibration.has_value());
  EXPECT_TRUE(recording->poses.has_value());
  EXPECT_TRUE(recording->scene.has_value());
  EXPECT_EQ(recording->objects.size(), 2u);
  for (const char* part :
       {"objects/0/cup.toml", "objects/0/meshes/cup.obj", "objects/0/meshes/the cup.mtl",
        "objects/0/meshes/cup.png", "objects/1/box.ply", "scene/cup.obj"}) {
    EXPECT_TRUE(fs::exists(temp.path() / "r" / part)) << part;
  }
  EXPECT_EQ(read_text(temp.path() / "r" / "objects" / "1" / "box.toml"), "mesh = \"box.ply\"\n");
}

}  // namespace
}  // namespace sightline
