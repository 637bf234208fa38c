// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "record/media.hpp"
#include "sightline/record/recording_sink.hpp"

namespace sightline {
namespace {

using namespace test;

// A key frame of half a megabyte, with its parameter sets.
ViewPacket key_frame(uint64_t number) {
  std::vector<uint8_t> bytes{0, 0,    0,    1,    0x67, 0x42, 0xC0, 0x1E, 0, 0,   0,
                             1, 0x68, 0xCE, 0x3C, 0x80, 0,    0,    0,    1, 0x65};
  bytes.resize(size_t{1} << 19, 0x55);
  ViewPacket packet;
  packet.camera = "left";
  packet.number = number;
  packet.packet.keyframe = true;
  packet.packet.capture = time_from_ns(static_cast<int64_t>(number) * 33'000'000);
  packet.packet.bytes = std::make_shared<const std::vector<uint8_t>>(std::move(bytes));
  return packet;
}

// What was kept from before a recording began comes in one go.
TEST(PosesWriter, KeepsLittleVideoInMemory) {
  TempFolder temp;
  auto writer = make_poses_writer(temp.path() / "poses", PoseFiles::kMcap);
  ASSERT_TRUE(writer);
  uintmax_t appended = 0;
  for (uint64_t i = 1; i <= 40; ++i) {
    const ViewPacket packet = key_frame(i);
    ASSERT_TRUE((*writer)->append(packet));
    appended += packet.packet.bytes->size() / 3 * 4;
    EXPECT_LT(appended, std::filesystem::file_size(temp.path() / "poses" / "poses.mcap") +
                            (uintmax_t{6} << 20));
  }
  EXPECT_EQ((*writer)->written(), 40u);
  EXPECT_TRUE((*writer)->close());
}

// A reader that comes to any of them alone can decode it; none is larger than asked for by more
// than what goes to the next key frame.
TEST(PosesWriter, GoesOnInAnotherFileAtAKeyFrame) {
  TempFolder temp;
  ViewingOptions parts;
  parts.segment_bytes = 3'000'000;
  const auto folder = temp.path() / "poses";
  auto writer = make_poses_writer(folder, PoseFiles::kMcap, parts);
  ASSERT_TRUE(writer);
  for (uint64_t i = 1; i <= 40; ++i) {
    ViewPacket packet = key_frame(i);
    packet.packet.keyframe = i % 4 == 1;
    ASSERT_TRUE((*writer)->append(packet));
  }
  EXPECT_EQ((*writer)->written(), 40u);
  EXPECT_TRUE((*writer)->close());
  // Four packets are 2.8 MB of base64: eight in each.
  for (const char* name :
       {"poses.mcap", "poses-0002.mcap", "poses-0003.mcap", "poses-0004.mcap", "poses-0005.mcap"}) {
    std::ifstream file(folder / name, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(file)), {});
    EXPECT_GT(bytes.size(), 5'000'000u) << name;
    EXPECT_LT(bytes.size(), 6'000'000u) << name;
    EXPECT_TRUE(bytes.ends_with("MCAP0\r\n")) << name;
    EXPECT_NE(bytes.find("/cameras/left/video"), std::string::npos) << name;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "poses-0006.mcap"));
}

TEST(PosesWriter, GoesOnInAnotherFileAfterSomeTime) {
  TempFolder temp;
  ViewingOptions parts;
  parts.segment = std::chrono::seconds(1);
  const auto folder = temp.path() / "poses";
  auto writer = make_poses_writer(folder, PoseFiles::kMcap, parts);
  ASSERT_TRUE(writer);
  for (uint64_t i = 1; i <= 40; ++i) ASSERT_TRUE((*writer)->append(key_frame(i)));
  EXPECT_TRUE((*writer)->close());
  EXPECT_TRUE(std::filesystem::exists(folder / "poses-0002.mcap"));
  EXPECT_FALSE(std::filesystem::exists(folder / "poses-0003.mcap"));
}

}  // namespace
}  // namespace sightline
