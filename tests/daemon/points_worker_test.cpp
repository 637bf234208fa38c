// SPDX-License-Identifier: Apache-2.0
// The thread of the live stereo points, on rendered images of a printed carton at rest.
#include "workers/points_worker.hpp"

#include <gtest/gtest.h>

#include "sightline/image/convert.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::SceneRig;
using test::SceneRigOptions;

SceneRigOptions resting_carton() {
  SceneRigOptions options;
  options.shape = std::make_shared<const test::RayMesh>(test::make_carton());
  options.paint.kind = test::Paint::Kind::kPrinted;
  options.azimuths_deg = {0, 16};
  options.distance = 0.5;
  options.duration = 40ms;
  options.path =
      test::resting(Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())),
                           Eigen::Vector3d::Zero()));
  return options;
}

class Points {
 public:
  explicit Points(double rate_hz = 20) : scene_(resting_carton()) {
    for (const CalibratedCamera& camera : scene_.cameras()) {
      installation_.cameras.push_back({.name = camera.name,
                                       .recording = {},
                                       .recorded_as = {},
                                       .calibration = camera,
                                       .overlay = {},
                                       .place = {}});
      rig_.cameras.push_back(
          std::make_shared<const CameraGeometry>(camera, nullptr, std::vector<float>()));
    }
    RigObject& object = rig_.objects.emplace_back();
    object.named = {ObjectId(0), "carton"};
    object.triangles = std::make_shared<const TriangleMesh>(test::make_carton());
    object.mesh = std::make_shared<const RenderMesh>(make_render_mesh(*object.triangles));
    for (int camera = 0; camera < 2; ++camera) {
      const FramePtr frame = scene_.shoot(scene_.shots()[static_cast<size_t>(camera)]);
      auto image = std::make_shared<Image>(640, 480);
      copy_i420(frame->i420(), image->mutable_view());
      images_.push_back(std::move(image));
    }
    PointsConfig config;
    config.rate_hz = rate_hz;
    worker = PointsWorker::start(config, std::make_unique<ObjectPoints>(installation_, rig_), 2,
                                 rig_.names(), board_, registry, beats_, 0);
  }

  /// One frame of each camera, taken now, of an object that the track puts `off` beside the truth.
  void show(const Eigen::Vector3d& off, TrackState state = TrackState::kTracking) {
    const Time now = MonotonicClock::now();
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = now;
    estimate.state = state;
    estimate.cameras = 3;
    estimate.world_from_object = scene_.truth(scene_.options().start);
    estimate.world_from_object.translation += off;
    estimate.covariance.diagonal().head<6>().setConstant(1e-7);
    board_->publish(ObjectId(0),
                    std::make_shared<PoseTrack>(ObjectId(0), std::vector<PoseEstimate>{estimate},
                                                MotionNoise{}));
    for (uint32_t camera = 0; camera < 2; ++camera) {
      FrameInfo info;
      info.camera = CameraId(camera);
      info.capture = info.arrival = now;
      info.width = 640;
      info.height = 480;
      worker->push(Frame::decoded(info, images_[camera]));
    }
  }

  /// Shows frames until `done`, at most half a minute.
  template <typename Done>
  bool show_until(const Eigen::Vector3d& off, const Done& done) {
    const Time end = MonotonicClock::now() + 30s;
    while (MonotonicClock::now() < end) {
      show(off);
      if (done()) return true;
      std::this_thread::sleep_for(20ms);
    }
    return false;
  }

  Registry registry;

 private:
  SceneRig scene_;
  Installation installation_;
  Rig rig_;
  std::vector<std::shared_ptr<const Image>> images_;
  std::shared_ptr<TrackBoard> board_ = std::make_shared<TrackBoard>(1);
  HeartbeatBoard beats_;

 public:
  std::unique_ptr<PointsWorker> worker;  // last: its thread uses the others
};

TEST(PointsWorker, PointsLieOnTheMeshWhereThePoseIsRight) {
  Points points;
  ASSERT_TRUE(
      points.show_until({0, 0, 0}, [&] { return points.worker->checks()[0].on_object > 0; }));
  const PointCheck check = points.worker->checks()[0];
  EXPECT_GT(check.on_object, 50u);
  EXPECT_LT(check.median_m, 0.001);
  EXPECT_LT(check.rms_m, 0.003);
  EXPECT_FALSE(check.contradicts);
  points.show({0, 0, 0});
  const Time now = MonotonicClock::now();
  const ScenePointsPtr shown = points.worker->points_at(now);
  ASSERT_NE(shown, nullptr);
  EXPECT_GE(shown->points.size(), check.on_object);
  EXPECT_EQ(shown->cameras, CameraSet{3});
  EXPECT_EQ(points.worker->points_at(now + 60s), nullptr);
}

TEST(PointsWorker, AWrongPoseIsContradicted) {
  Points points;
  EXPECT_TRUE(points.show_until({0.015, 0.012, 0.010},
                                [&] { return points.worker->checks()[0].contradicts; }));
  EXPECT_TRUE(
      points.show_until({0, 0, 0}, [&] { return !points.worker->checks()[0].contradicts; }));
}

TEST(PointsWorker, FramesThatAreNotDueAreDroppedAndNothingIsDoneWithoutATrack) {
  Points points(30);
  Counter& dropped =
      points.registry.counter("sightline_points_frames_dropped_total",
                              "Frames that came before stereo points were due again");
  // Without a pose no frame is held: a held one would be dropped, and counted, by the next.
  for (int i = 0; i < 20; ++i) points.show({0, 0, 0}, TrackState::kSearching);
  EXPECT_EQ(dropped.value(), 0u);
  EXPECT_EQ(points.worker->checks()[0].time, Time{});
  EXPECT_TRUE(points.show_until({0, 0, 0}, [&] {
    points.show({0, 0, 0});
    return dropped.value() > 0 && points.worker->checks()[0].on_object > 0;
  }));
  points.worker->stop();
  points.worker->stop();
}

}  // namespace
}  // namespace sightline
