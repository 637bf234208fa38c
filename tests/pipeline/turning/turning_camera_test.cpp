// SPDX-License-Identifier: Apache-2.0
//
// A camera that stands still, declared as one that turns and has turned to where it stands, must
// say and show the same.
#include <gmock/gmock.h>

#include "sightline/pipeline/camera_observer.hpp"
#include "sightline/pipeline/object_fusion.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/rig_parts.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

constexpr double kPan = 0.4, kTilt = -0.25;

/// Axes of a head that looks elsewhere at rest and stands at `pose` at those angles.
CameraAxes axes_through(const Rigid3& pose) {
  Vector6 offset, camera;
  offset << 0.01, 0.02, -0.03, 0.004, 0.012, 0.06;
  camera << -1.5, 0.05, 0.02, 0.003, 0.035, 0.008;
  CameraAxes axes;
  axes.pan_from_tilt = Rigid3::exp(offset);
  axes.tilt_from_camera = Rigid3::exp(camera);
  axes.world_from_base = pose * axes.world_from_camera(kPan, kTilt).inverse();
  return axes;
}

class TurningCamera : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    still_ =
        new Installation(recording_installation(SIGHTLINE_SOURCE_DIR "/recordings/bench").value());
    turning_ = new Installation(*still_);
    for (CameraConfig& camera : turning_->cameras) {
      CalibratedCamera& calibration = camera.calibration;
      calibration.axes = axes_through(calibration.world_from_camera);
      calibration.world_from_camera = calibration.axes->world_from_camera(0, 0);
    }
    rig_ = new Rig(load_rig(*still_).value());
    turning_rig_ = new Rig(load_rig(*turning_).value());
    const auto recording = std::make_shared<const Recording>(
        open_recording(SIGHTLINE_SOURCE_DIR "/recordings/bench").value());
    const auto replay = VirtualReplay::open(recording).value();
    for (int i = 0; i < 3; ++i) sets_.push_back(*replay->next().value());
  }
  static void TearDownTestSuite() {
    sets_.clear();
    for (Rig** rig : {&rig_, &turning_rig_}) delete std::exchange(*rig, nullptr);
    for (Installation** one : {&still_, &turning_}) delete std::exchange(*one, nullptr);
  }

  static FramePtr turned(const FramePtr& frame, AxesState state = AxesState::kKnown) {
    const CalibratedCamera& camera = turning_->cameras[frame->info().camera.index()].calibration;
    CameraPlace place;
    place.world_from_camera = camera.axes->world_from_camera(kPan, kTilt);
    place.covariance = std::make_shared<const Matrix6>(1e-12 * Matrix6::Identity());
    place.state = state;
    return Frame::with_place(frame, std::make_shared<const CameraPlace>(std::move(place)));
  }

  inline static Installation *still_ = nullptr, *turning_ = nullptr;
  inline static Rig *rig_ = nullptr, *turning_rig_ = nullptr;
  inline static std::vector<std::vector<FramePtr>> sets_;
};

TEST_F(TurningCamera, MeasuresAsOneThatStandsThere) {
  const CameraId id(0);
  auto still = CameraObserver::create(*still_, *rig_, id).value();
  auto turning = CameraObserver::create(*turning_, *turning_rig_, id).value();
  std::vector<PoseTrackPtr> tracks;
  size_t terms = 0, hypotheses = 0;
  for (const auto& set : sets_) {
    const FramePtr& frame = set[0];
    std::vector<Observation> a, b;
    still->step(*frame, tracks, a);
    turning->step(*turned(frame), tracks, b);
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].calibration_covariance, nullptr);
      EXPECT_NE(b[i].calibration_covariance, nullptr);
      ASSERT_EQ(a[i].terms.size(), b[i].terms.size());
      ASSERT_EQ(a[i].hypotheses.size(), b[i].hypotheses.size());
      for (size_t k = 0; k < a[i].hypotheses.size(); ++k) {
        const Rigid3& pose = a[i].hypotheses[k].world_from_object;
        EXPECT_LT(difference(pose, b[i].hypotheses[k].world_from_object).norm(), 1e-6);
        ++hypotheses;
        Vector6 off;
        off << 0.01, -0.02, 0.01, 0.002, 0.001, -0.002;
        for (size_t t = 0; t < a[i].terms.size(); ++t) {
          EXPECT_EQ(a[i].terms[t]->kind(), b[i].terms[t]->kind());
          const LinearizedTerm here = a[i].terms[t]->linearize(pose * Rigid3::exp(off));
          const LinearizedTerm there = b[i].terms[t]->linearize(pose * Rigid3::exp(off));
          EXPECT_LT((here.information - there.information).norm(), 1e-5 * here.information.norm());
          EXPECT_LT((here.gradient - there.gradient).norm(), 1e-5 * here.gradient.norm());
          EXPECT_NEAR(here.cost, there.cost, 1e-5 * here.cost + 1e-9);
          ++terms;
        }
      }
    }
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = frame->info().capture;
    estimate.state = TrackState::kTracking;
    estimate.cameras = camera_bit(id);
    estimate.covariance.diagonal().setConstant(1e-6);
    if (!a.empty() && !a[0].hypotheses.empty()) {
      estimate.world_from_object = a[0].hypotheses[0].world_from_object;
      tracks = {
          std::make_shared<const PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{})};
    }
  }
  EXPECT_GT(terms, 2u);
  EXPECT_GT(hypotheses, 2u);
}

TEST_F(TurningCamera, SaysNothingWhereNobodyKnowsWhereItLooks) {
  auto observer = CameraObserver::create(*turning_, *turning_rig_, CameraId(0)).value();
  std::vector<Observation> out;
  for (const AxesState state : {AxesState::kSilent, AxesState::kFrozen, AxesState::kUnsettled}) {
    observer->step(*turned(sets_[0][0], state), {}, out);
    EXPECT_TRUE(out.empty());
  }
  observer->step(*sets_[0][0], {}, out);  // nor where the frame does not say
  EXPECT_TRUE(out.empty());
  observer->step(*turned(sets_[0][0]), {}, out);
  EXPECT_FALSE(out.empty());
}

TEST_F(TurningCamera, IsDrawnIntoAsOneThatStandsThere) {
  const CameraId id(1);
  auto still = make_renderer(*still_, *rig_, id).value();
  auto turning = make_renderer(*turning_, *turning_rig_, id).value();
  const FramePtr& frame = sets_[0][1];
  PoseEstimate estimate;
  estimate.object = ObjectId(0);
  estimate.time = estimate.last_measured = frame->info().capture;
  estimate.state = TrackState::kTracking;
  estimate.covariance.diagonal().setConstant(1e-6);
  const Rigid3& camera = still_->cameras[1].calibration.world_from_camera;
  estimate.world_from_object =
      Rigid3(Eigen::Quaterniond::Identity(), camera * Eigen::Vector3d(0, 0, 1.1));
  const std::vector<PoseTrackPtr> tracks = {
      std::make_shared<const PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{})};
  const auto draw = [&](CameraRenderer& renderer, const CameraPlace* place,
                        std::vector<PoseAt>& poses) {
    auto image = std::make_unique<Image>(640, 480);
    frame->copy_i420_to(image->mutable_view());
    renderer.draw(image->mutable_view(), frame->info().capture, tracks, poses,
                  {nullptr, {}, place});
    return image;
  };
  const auto differing = [](const Image& a, const Image& b) {
    int count = 0;
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) {
        count += std::abs(a.view().y.row(y)[x] - b.view().y.row(y)[x]) > 2 ? 1 : 0;
      }
    }
    return count;
  };
  std::vector<PoseAt> poses;
  const auto reference = draw(*still, nullptr, poses);
  const auto there = draw(*turning, turned(frame)->info().place.get(), poses);
  EXPECT_EQ(poses[0].source, PoseSource::kEstimated);
  EXPECT_LT(differing(*reference, *there), 10);
  const auto blind = draw(*turning, turned(frame, AxesState::kFrozen)->info().place.get(), poses);
  EXPECT_EQ(poses[0].source, PoseSource::kNone);
  EXPECT_EQ(poses[0].estimate.state, TrackState::kTracking);
  EXPECT_GT(differing(*reference, *blind), 200);
}

TEST_F(TurningCamera, NothingIsLearnedOfABackgroundThatMoves) {
  Installation learning = *turning_;
  learning.scene.learn = true;
  EXPECT_EQ(make_learner(learning, *turning_rig_, CameraId(0)).value(), nullptr);
  learning.cameras[0].calibration.axes.reset();
  EXPECT_NE(make_learner(learning, *turning_rig_, CameraId(0)).value(), nullptr);
}

}  // namespace
}  // namespace sightline
