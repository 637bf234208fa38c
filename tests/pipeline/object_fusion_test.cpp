// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/object_fusion.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;

const std::vector<NamedObject> kObjects{{ObjectId(0), "first"}, {ObjectId(1), "second"}};

Observation unseen(uint32_t object, uint32_t camera, Time capture) {
  Observation observation;
  observation.object = ObjectId(object);
  observation.camera = CameraId(camera);
  observation.capture = capture;
  return observation;
}

TEST(ObjectFusion, OneReportForEachObjectOfASet) {
  const auto board = std::make_shared<TrackBoard>(2);
  const auto fusion = ObjectFusion::create({}, kObjects, {}, board).value();
  ASSERT_EQ(fusion->tracks().size(), 2u);
  EXPECT_NE(fusion->tracks()[1], nullptr);
  const Time time{1s};
  const std::vector<Observation> set{unseen(1, 0, time), unseen(0, 0, time), unseen(1, 1, time)};
  const auto reports = fusion->process(set);
  ASSERT_EQ(reports.size(), 2u);
  EXPECT_EQ(reports[0].estimate.object, ObjectId(0));
  EXPECT_EQ(reports[1].estimate.object, ObjectId(1));
  EXPECT_EQ(reports[1].estimate.time, time);
}

TEST(ObjectFusion, OnlyTheObjectOfAnObservationIsPublished) {
  const auto board = std::make_shared<TrackBoard>(2);
  const auto fusion = ObjectFusion::create({}, kObjects, {}, board).value();
  const Observation seen = unseen(1, 0, Time(1s));
  ASSERT_EQ(fusion->process({&seen, 1}).size(), 1u);
  std::vector<PoseTrackPtr> tracks;
  board->read(tracks);
  EXPECT_EQ(tracks[0], nullptr);
  ASSERT_NE(tracks[1], nullptr);
  EXPECT_EQ(tracks[1]->object(), ObjectId(1));
  EXPECT_TRUE(fusion->advance(Time(2s)).empty());  // both were searching before
}

}  // namespace
}  // namespace sightline
