// SPDX-License-Identifier: Apache-2.0
// What a search finds reaches the trackers of the cameras that show it, with the frame.
#include "sightline/pipeline/search/found_views.hpp"

#include <gtest/gtest.h>

#include "first_frames.hpp"
#include "pipeline/search/found_frames.hpp"
#include "sightline/pipeline/object_search.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

TEST(FoundViews, TheNewestOfAnObjectCounts) {
  FoundViews views;
  EXPECT_TRUE(views.take(CameraId(3)).empty());
  Rigid3 later;
  later.translation.x() = 1;
  views.put(CameraId(1), {ObjectId(0), nullptr, Rigid3()});
  views.put(CameraId(1), {ObjectId(2), nullptr, Rigid3()});
  views.put(CameraId(1), {ObjectId(0), nullptr, later});
  EXPECT_TRUE(views.take(CameraId(0)).empty());
  const std::vector<FoundView> taken = views.take(CameraId(1));
  ASSERT_EQ(taken.size(), 2u);
  EXPECT_EQ(taken[0].object, ObjectId(0));
  EXPECT_EQ(taken[0].camera_from_object.translation.x(), 1);
  EXPECT_EQ(taken[1].object, ObjectId(2));
  EXPECT_TRUE(views.take(CameraId(1)).empty()) << "each is taken once";
}

class FoundFramesTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    bench = std::make_unique<test::FirstFrames>(test::first_frames_of_bench());
  }
  static void TearDownTestSuite() { bench.reset(); }

  static const CalibratedCamera& calibration(CameraId camera) {
    return bench->installation.cameras.at(camera.index()).calibration;
  }
  static const ViewpointModel& model() { return bench->model(); }

  static Detection at(const Rigid3& pose, const Frame& frame) {
    Detection found;
    found.time = frame.info().capture;
    found.poses = {{pose}};
    Observation& observation = found.observations.emplace_back();
    observation.camera = frame.info().camera;
    observation.object = ObjectId(0);
    observation.capture = frame.info().capture;
    observation.hypotheses = {{pose, 0}};
    return found;
  }

  static inline std::unique_ptr<test::FirstFrames> bench;
  std::shared_ptr<FoundViews> views_ = std::make_shared<FoundViews>();
};

TEST_F(FoundFramesTest, ASearchOffersWhatItFindsInTheCamerasThatShowIt) {
  const auto search = ObjectSearch::create(bench->installation, bench->rig).value();
  search->offer_to(views_);
  for (const FramePtr& frame : bench->frames) search->add_frame(frame->info().camera, *frame, {});
  ASSERT_TRUE(search->hint(ObjectId(0), bench->truth));
  const auto found = search->search(bench->frames.front()->info().capture, {});
  ASSERT_FALSE(found.empty());
  size_t taken = 0;
  for (const FramePtr& frame : bench->frames) {
    const CameraId camera = frame->info().camera;
    for (const FoundView& view : views_->take(camera)) {
      ++taken;
      EXPECT_EQ(view.frame->info().capture, frame->info().capture);
      EXPECT_EQ(view.frame->info().camera, camera);
      EXPECT_NE(view.frame->i420().y.data, frame->i420().y.data) << "a copy";
      EXPECT_FALSE(view.refutes);
      const Eigen::Vector3d center =
          calibration(camera).world_from_camera * (view.camera_from_object * model().center());
      EXPECT_LT((center - bench->truth * model().center()).norm(), 0.01);
    }
  }
  EXPECT_EQ(taken, found.size());
}

TEST_F(FoundFramesTest, NothingIsOfferedWhereTheImagesShowSeveralPoses) {
  const Frame& frame = *bench->frames.front();
  pipeline::FoundFrames kept(
      std::vector<DetectorCamera>{{frame.info().camera, calibration(frame.info().camera)}}, views_);
  kept.keep(frame.info().camera, frame);
  Detection found = at(bench->truth, frame);
  Rigid3 aside = bench->truth;
  aside.translation.x() += model().radius();
  found.poses.push_back({aside});
  kept.offer(found, model(), false);
  EXPECT_TRUE(views_->take(frame.info().camera).empty());
  found.poses.back().world_from_object = bench->truth * Rigid3::exp(Vector6::Constant(0.01));
  kept.offer(found, model(), true);
  const auto taken = views_->take(frame.info().camera);
  ASSERT_EQ(taken.size(), 1u) << "all but the same";
  EXPECT_TRUE(taken.front().refutes);
}

TEST_F(FoundFramesTest, OnlyInTheFrameItWasFoundIn) {
  const Frame& frame = *bench->frames.front();
  const CameraId camera = frame.info().camera;
  pipeline::FoundFrames kept(std::vector<DetectorCamera>{{camera, calibration(camera)}}, views_);
  Detection found = at(bench->truth, frame);
  kept.offer(found, model(), false);
  EXPECT_TRUE(views_->take(camera).empty()) << "no frame yet";
  kept.keep(camera, frame);
  found.observations.front().capture += 1ms;
  kept.offer(found, model(), false);
  EXPECT_TRUE(views_->take(camera).empty()) << "of another frame";
}

TEST_F(FoundFramesTest, ACameraThatTurnsSeesItFromWhereItStood) {
  const FrameInfo& shown = bench->frames.front()->info();
  auto place = std::make_shared<CameraPlace>();
  place->world_from_camera =
      Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())), {1, 2, 3});
  FrameInfo info = shown;
  info.place = place;
  auto image = std::make_shared<Image>(info.width, info.height);
  bench->frames.front()->copy_i420_to(image->mutable_view());
  const FramePtr frame = Frame::decoded(info, image);
  pipeline::FoundFrames kept(std::vector<DetectorCamera>{{shown.camera, calibration(shown.camera)}},
                             views_);
  kept.keep(shown.camera, *frame);
  kept.offer(at(bench->truth, *frame), model(), false);
  const auto taken = views_->take(shown.camera);
  ASSERT_EQ(taken.size(), 1u);
  EXPECT_LT(translation_distance(place->world_from_camera * taken.front().camera_from_object,
                                 bench->truth),
            1e-9);
}

}  // namespace
}  // namespace sightline
