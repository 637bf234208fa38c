// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "system/system.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

TEST(LastPoseKeeper, WritesWhereItWasTrackedAtTheEnd) {
  const auto folder =
      std::filesystem::path(testing::TempDir()) / fmt::format("keeper_{}", ::getpid());
  const auto file = folder / "last.csv";
  std::filesystem::remove_all(folder);
  PoseLogRow other;
  other.object = "cup";
  other.state = TrackState::kTracking;
  other.world_from_object = Rigid3();
  ASSERT_TRUE(write_last_poses(file, {other}));
  HeartbeatBoard beats;
  const auto board = std::make_shared<TrackBoard>(2);
  const auto publish = [&](uint32_t object, TrackState state, double x) {
    PoseEstimate estimate;
    estimate.object = ObjectId(object);
    estimate.time = Time(1s);
    estimate.state = state;
    estimate.world_from_object.translation.x() = x;
    board->publish(estimate.object, std::make_shared<const PoseTrack>(
                                        estimate.object, std::vector{estimate}, MotionNoise{}));
  };
  publish(0, TrackState::kTracking, 0.5);
  publish(1, TrackState::kDegraded, 0.7);
  const auto keeper =
      LastPoseKeeper::start(file, {{ObjectId(0), "carton"}, {ObjectId(1), "truck"}}, board, beats);
  EXPECT_TRUE(keeper->stop_unless_waiting(10s));
  const auto rows = read_last_poses(file);
  ASSERT_EQ(rows.size(), 2u) << "of the truck nothing was certain";
  EXPECT_EQ(rows[0].object, "carton");
  EXPECT_DOUBLE_EQ(rows[0].world_from_object->translation.x(), 0.5);
  EXPECT_EQ(rows[1].object, "cup");
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sightline
