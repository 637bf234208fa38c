// SPDX-License-Identifier: Apache-2.0
// A search that is told where to look finds the object there at once, and claims nothing that the
// images do not show.
#include <gtest/gtest.h>

#include <thread>

#include "first_frames.hpp"
#include "sightline/pipeline/object_search.hpp"

namespace sightline {
namespace {

const ObjectId kCarton(0);

// The first frames of `bench`, without the markers on the carton.
class SearchHintTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    bench = std::make_unique<test::FirstFrames>(test::first_frames_of_bench());
    center = bench->model().center();
  }
  static void TearDownTestSuite() { bench.reset(); }

  SearchHintTest() : search_(ObjectSearch::create(bench->installation, bench->rig).value()) {
    for (const FramePtr& frame : bench->frames)
      search_->add_frame(frame->info().camera, *frame, {});
  }

  static Time now() { return bench->frames.front()->info().capture; }
  std::vector<Observation> look() { return search_->search(now(), {}); }

  // Every pose that is claimed is where the carton is, up to what its shape cannot tell apart.
  static void expect_right(const std::vector<Observation>& found) {
    for (const Observation& observation : found) {
      for (const PoseHypothesis& pose : observation.hypotheses) {
        EXPECT_LT((pose.world_from_object * center - bench->truth * center).norm(), 0.02);
      }
    }
  }
  static Rigid3 moved(const Eigen::Vector3d& by) {
    Rigid3 pose = bench->truth;
    pose.translation += by;
    return pose;
  }
  static ImageHint in_left(const Eigen::Vector2d& off = Eigen::Vector2d::Zero()) {
    const CalibratedCamera& left = bench->installation.cameras[0].calibration;
    ImageHint hint;
    hint.camera = CameraId(0);
    hint.pixel =
        *left.model.project(left.world_from_camera.inverse() * (bench->truth * center)) + off;
    return hint;
  }

  static inline std::unique_ptr<test::FirstFrames> bench;
  static inline Eigen::Vector3d center = Eigen::Vector3d::Zero();
  std::unique_ptr<ObjectSearch> search_;
};

TEST_F(SearchHintTest, APoseThatIsAboutRightIsEnough) {
  ASSERT_TRUE(search_->hint(kCarton, moved({0.01, -0.01, 0.005})));
  const auto found = look();
  EXPECT_FALSE(found.empty());
  expect_right(found);
  EXPECT_EQ(search_->work().places, 0u) << "nothing else was looked at";
}

TEST_F(SearchHintTest, TheInstallationMaySayWhereItStarts) {
  Installation installation = bench->installation;
  installation.objects.front().start = moved({-0.01, 0.005, 0.01});
  const auto search = ObjectSearch::create(installation, bench->rig).value();
  for (const FramePtr& frame : bench->frames) search->add_frame(frame->info().camera, *frame, {});
  const auto found = search->search(now(), {});
  EXPECT_FALSE(found.empty());
  expect_right(found);
  EXPECT_EQ(search->work().places, 0u);
}

TEST_F(SearchHintTest, APlaceInAnImageIsLookedAtBeforeAllOthers) {
  look();
  const uint64_t everywhere = search_->work().places;
  const auto told = ObjectSearch::create(bench->installation, bench->rig).value();
  for (const FramePtr& frame : bench->frames) told->add_frame(frame->info().camera, *frame, {});
  ASSERT_TRUE(told->hint(kCarton, in_left({12, -8})));
  const auto found = told->search(now(), {});
  EXPECT_FALSE(found.empty());
  expect_right(found);
  EXPECT_GT(told->work().places, everywhere) << "and rivals at other places are known";
}

TEST_F(SearchHintTest, AWrongPoseIsNotBelieved) {
  for (const Eigen::Vector3d& by :
       {Eigen::Vector3d(0.3, 0, 0), Eigen::Vector3d(0, 0.25, 0), Eigen::Vector3d(0, 0, -0.2)}) {
    const auto search = ObjectSearch::create(bench->installation, bench->rig).value();
    for (const FramePtr& frame : bench->frames) search->add_frame(frame->info().camera, *frame, {});
    ASSERT_TRUE(search->hint(kCarton, moved(by)));
    expect_right(search->search(now(), {}));
    EXPECT_GT(search->work().places, 0u) << "it was looked for elsewhere, too";
  }
}

TEST_F(SearchHintTest, AWrongPlaceIsNotBelieved) {
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(40, 40), Eigen::Vector2d(600, 440)}) {
    const auto search = ObjectSearch::create(bench->installation, bench->rig).value();
    for (const FramePtr& frame : bench->frames) search->add_frame(frame->info().camera, *frame, {});
    ImageHint hint;
    hint.camera = CameraId(0);
    hint.pixel = pixel;
    ASSERT_TRUE(search->hint(kCarton, hint));
    expect_right(search->search(now(), {}));
  }
}

TEST_F(SearchHintTest, WhatIsTooOldOrForgottenCountsNoMore) {
  ASSERT_TRUE(search_->hint(kCarton, bench->truth, now() - std::chrono::seconds(1)));
  look();
  EXPECT_GT(search_->work().places, 0u);
  const auto other = ObjectSearch::create(bench->installation, bench->rig).value();
  for (const FramePtr& frame : bench->frames) other->add_frame(frame->info().camera, *frame, {});
  other->hint(kCarton, bench->truth);
  other->forget(kCarton);
  other->search(now(), {});
  EXPECT_GT(other->work().places, 0u);
}

TEST_F(SearchHintTest, ComesFromAnyThread) {
  std::jthread talker([&] {
    for (int i = 0; i < 1000; ++i) {
      search_->hint(kCarton, bench->truth);
      if (i % 3 == 0) search_->forget(kCarton);
      EXPECT_FALSE(search_->hint(ObjectId(7), bench->truth)) << "no such object";
    }
    search_->hint(kCarton, bench->truth);
  });
  expect_right(look());
  talker.join();
  search_->hint(kCarton, bench->truth);
  EXPECT_FALSE(search_->search(now() + std::chrono::seconds(1), {}).empty());
}

}  // namespace
}  // namespace sightline
