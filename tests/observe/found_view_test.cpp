// SPDX-License-Identifier: Apache-2.0
// What a tracker makes of where a search has found its object.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <numbers>
#include <random>

#include "support/scene_rig.hpp"
#include "tracked_creature.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::SceneRig;
using test::SceneRigOptions;

constexpr double kDeg = std::numbers::pi / 180;

TrackedObject tracked() { return test::tracked_creature({false, true, true, false}); }

// One camera, its tracker, and a track that is off by so much.
class FoundViewTest : public testing::Test {
 protected:
  static SceneRigOptions options() {
    SceneRigOptions options;
    options.shape = std::make_shared<const test::RayMesh>(test::creature());
    options.duration = 200ms;
    test::SceneSteps steps;
    options.path = test::smooth_path(steps, options.duration);
    options.azimuths_deg = {0};
    options.sensor.read_noise = 4;
    return options;
  }

  FoundViewTest()
      : tracker_(ObjectTracker::create(rig_.cameras()[0], CameraId(0), {tracked()}).value()) {}

  Rigid3 truth(size_t shot) const { return rig_.truth(rig_.shots()[shot].true_capture); }
  FramePtr frame(size_t shot) const { return rig_.shoot(rig_.shots()[shot]); }

  FoundView found(size_t shot, const FramePtr& in) const {
    return {ObjectId(0), in, rig_.cameras()[0].world_from_camera.inverse() * truth(shot)};
  }

  // A track of few frames: degraded, `off` from the truth.
  PoseTrackPtr track(size_t shot, const Vector6& off, Time time) const {
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = time;
    estimate.state = TrackState::kDegraded;
    estimate.degraded_reasons = kUnconfirmed;
    estimate.world_from_object = truth(shot) * Rigid3::exp(off);
    estimate.covariance.topLeftCorner<3, 3>().diagonal().setConstant(std::pow(7 * kDeg, 2));
    estimate.covariance.block<3, 3>(3, 3).diagonal().setConstant(0.022 * 0.022);
    estimate.cameras = camera_bit(CameraId(0));
    return std::make_shared<const PoseTrack>(ObjectId(0), std::vector<PoseEstimate>{estimate},
                                             MotionNoise());
  }

  // What the camera makes of a frame; the pose that its terms say, with the track's own prior.
  std::optional<Rigid3> step(size_t shot, const Vector6& off) {
    const FramePtr now = frame(shot);
    const PoseTrackPtr track = this->track(shot, off, now->info().capture);
    std::vector<Observation> out;
    tracker_->step(*now, {&track, 1}, out);
    if (out.size() != 1 || out[0].terms.empty()) return std::nullopt;
    Rigid3 pose = track->newest().world_from_object;
    for (int round = 0; round < 3; ++round) {
      Matrix6 system = track->newest().own_covariance().inverse();
      Vector6 slope = Vector6::Zero();
      for (const PoseTermPtr& term : out[0].terms) {
        const LinearizedTerm at = term->linearize(pose);
        system += at.information;
        slope += at.gradient;
      }
      pose = pose * Rigid3::exp(-system.ldlt().solve(slope));
    }
    return pose;
  }

  // A frame of a wall: inside and outside look the same.
  static FramePtr wall(const FramePtr& like) {
    auto image = std::make_shared<Image>(like->info().width, like->info().height);
    const MutableI420View view = image->mutable_view();
    for (const MutablePlaneView& plane : {view.y, view.u, view.v}) {
      for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, uint8_t{128});
    }
    return Frame::decoded(like->info(), image);
  }

  const SceneRig rig_{options()};
  std::unique_ptr<ObjectTracker> tracker_;
};

Vector6 off_by(double turn_deg, double x, double y, double z) {
  Vector6 off = Vector6::Zero();
  off[1] = turn_deg * kDeg;
  off.tail<3>() = Eigen::Vector3d(x, y, z);
  return off;
}

double aside_mm(const Rigid3& truth, const Rigid3& pose, const CalibratedCamera& camera) {
  const Eigen::Vector3d ray =
      (truth.translation - camera.world_from_camera.translation).normalized();
  const Eigen::Vector3d off = pose.translation - truth.translation;
  return 1e3 * (off - ray * ray.dot(off)).norm();
}

TEST_F(FoundViewTest, ColorsOfWhereItWasFoundHoldWhatIsPredictedBadly) {
  std::vector<Vector6> offs;
  for (const double sign : {-1.0, 1.0}) {
    offs.push_back(off_by(sign * 15, 0.04 * sign, 0, 0));
    offs.push_back(off_by(-sign * 15, 0, 0.04 * sign, 0));
    offs.push_back(off_by(sign * 15, 0, 0, 0.04 * sign));
  }
  int held = 0, held_fresh = 0;
  for (const bool told : {false, true}) {
    for (const Vector6& off : offs) {
      tracker_ = ObjectTracker::create(rig_.cameras()[0], CameraId(0), {tracked()}).value();
      if (told) tracker_->note_found(found(0, frame(0)));
      const auto pose = step(2, off);
      const bool good = pose && aside_mm(truth(2), *pose, rig_.cameras()[0]) < 4;
      (told ? held : held_fresh) += good ? 1 : 0;
    }
  }
  RecordProperty("held", held);
  RecordProperty("held_without", held_fresh);
  EXPECT_GE(held, 5) << "of 6";
  EXPECT_GT(held, held_fresh);
}

// In any direction, at once: a quarter of its diameter and 15 degrees. One camera, so that the
// distance is left out.
TEST_F(FoundViewTest, FindsTheWayBackFromAnyDirection) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  constexpr int kStarts = 30;
  int back = 0;
  for (int i = 0; i < kStarts; ++i) {
    tracker_ = ObjectTracker::create(rig_.cameras()[0], CameraId(0), {tracked()}).value();
    tracker_->note_found(found(0, frame(0)));
    Vector6 off;
    off << 15 * kDeg * direction(), 0.031 * direction();
    const auto pose = step(2, off);
    back += pose && aside_mm(truth(2), *pose, rig_.cameras()[0]) < 4 &&
                    rotation_angle(truth(2), *pose) < 5 * kDeg
                ? 1
                : 0;
  }
  RecordProperty("back", back);
  EXPECT_GE(back, 24) << "of " << kStarts;
}

TEST_F(FoundViewTest, WhatIsKnownStaysUnlessItIsRefuted) {
  tracker_->note_found(found(0, frame(0)));
  ASSERT_TRUE(step(0, Vector6::Zero()));
  tracker_->note_found(found(0, wall(frame(0))));
  EXPECT_TRUE(step(1, Vector6::Zero())) << "its colors were known";
  FoundView elsewhere = found(1, wall(frame(1)));
  elsewhere.refutes = true;
  elsewhere.camera_from_object = elsewhere.camera_from_object * Rigid3::exp(off_by(90, 0, 0, 0));
  tracker_->note_found(elsewhere);
  step(2, Vector6::Zero());
  EXPECT_FALSE(tracker_->last_result(0).local_colors) << "the pose in force is another still";
  FoundView refutes = found(1, wall(frame(1)));
  refutes.refutes = true;
  tracker_->note_found(refutes);
  step(2, Vector6::Zero());
  EXPECT_TRUE(tracker_->last_result(0).local_colors) << "those of a wall tell nothing";
}

TEST_F(FoundViewTest, WhatWasFoundLongAgoIsOfNoUse) {
  const FramePtr now = frame(0);
  FrameInfo info = now->info();
  info.capture -= 1001ms;
  auto image = std::make_shared<Image>(info.width, info.height);
  now->copy_i420_to(image->mutable_view());
  tracker_->note_found(found(0, wall(Frame::decoded(info, image))));
  step(0, Vector6::Zero());
  EXPECT_GT(tracker_->last_result(0).separation, 0.3) << "fresh colors, not those of a wall";
}

TEST_F(FoundViewTest, WhatIsNotTrackedHereIsLeftOut) {
  FoundView other = found(0, wall(frame(0)));
  other.object = ObjectId(7);
  tracker_->note_found(other);
  tracker_->note_found({ObjectId(0), nullptr, Rigid3()});
  EXPECT_TRUE(step(0, Vector6::Zero()));
}

}  // namespace
}  // namespace sightline
