// SPDX-License-Identifier: Apache-2.0
// What a tracker makes of an image whose rows were exposed one after the other.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "support/scene_rig.hpp"
#include "tracked_creature.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::SceneRig;
using test::SceneRigOptions;
using test::SceneShot;

constexpr double kReadout = 0.05;  // [s]
constexpr int kBand = 12;          // rows that are exposed together here

// Moves evenly, mostly across the image.
Vector6 twist() {
  Vector6 out;
  out << 0.5, -0.3, 1.0, 0.4, -0.5, 0.2;
  return out;
}

class RollingTracker : public testing::Test {
 protected:
  static SceneRigOptions options() {
    SceneRigOptions options;
    options.shape = std::make_shared<const test::RayMesh>(test::creature());
    options.azimuths_deg = {0};
    options.duration = 200ms;
    options.path = [](Time time) {
      return Rigid3::exp(twist() * to_seconds(time.time_since_epoch() - 1100ms));
    };
    return options;
  }
  double center_row() const {
    const CalibratedCamera& camera = rig_.cameras()[0];
    const Eigen::Vector3d center = test::tracked_creature({}).views->center();
    return camera.model.project(camera.world_from_camera.inverse() * (truth() * center))->y();
  }
  const SceneShot& shot() const { return rig_.shots()[3]; }
  Rigid3 truth() const { return rig_.truth(shot().true_capture); }

  // The row of the object's center at the time of the shot, others sooner or later.
  FramePtr rolled(double readout_s) const {
    const CameraModel& lens = rig_.cameras()[0].model;
    const double center = center_row();
    auto image = std::make_shared<Image>(lens.width(), lens.height());
    for (int top = 0; top < lens.height(); top += kBand) {
      SceneShot band = shot();
      band.true_capture +=
          from_seconds(readout_s * (top + 0.5 * (kBand - 1) - center) / lens.height());
      const FramePtr frame = rig_.shoot(band);
      const I420View from = frame->i420();
      const MutableI420View to = image->mutable_view();
      const auto width = static_cast<size_t>(lens.width());
      for (int y = top; y < std::min(top + kBand, lens.height()); ++y) {
        std::memcpy(to.y.row(y), from.y.row(y), width);
        if (y % 2 != 0) continue;
        std::memcpy(to.u.row(y / 2), from.u.row(y / 2), width / 2);
        std::memcpy(to.v.row(y / 2), from.v.row(y / 2), width / 2);
      }
    }
    return Frame::decoded(rig_.info_of(shot()), std::move(image));
  }

  // By how much it is turned about the camera's axis where all that was measured fits best [rad];
  // what one image says least of is held by a prior.
  double lean(const FramePtr& frame, double readout_s, const Modalities& modalities) const {
    CalibratedCamera camera = rig_.cameras()[0];
    camera.readout_s = readout_s;
    const auto tracker =
        ObjectTracker::create(camera, CameraId(0), {test::tracked_creature(modalities)}).value();
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = frame->info().capture;
    estimate.state = TrackState::kTracking;
    estimate.cameras = 1;
    estimate.world_from_object = truth();
    estimate.twist = twist();
    estimate.covariance.diagonal().head<3>().setConstant(1e-4);
    estimate.covariance.diagonal().segment<3>(3).setConstant(1e-5);
    const PoseTrackPtr track =
        std::make_shared<const PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{});
    std::vector<Observation> observations;
    tracker->step(*frame, {&track, 1}, observations);
    Rigid3 pose = truth();
    EXPECT_FALSE(observations.front().terms.empty());
    for (int round = 0; round < 10; ++round) {
      LinearizedTerm sum;
      const Vector6 off = difference(truth(), pose);
      sum.information.diagonal() << 1e3, 1e3, 1e3, 1e4, 1e4, 1e4;
      sum.gradient = sum.information * off;
      for (const PoseTermPtr& term : observations.front().terms) {
        const LinearizedTerm part = term->linearize(pose);
        sum.information += part.information;
        sum.gradient += part.gradient;
      }
      pose = pose * Rigid3::exp(-sum.information.ldlt().solve(sum.gradient));
    }
    const Eigen::Vector3d turned = (camera.world_from_camera.inverse() * truth()).rotation *
                                   difference(truth(), pose).head<3>();
    return turned.z();
  }

  const SceneRig rig_{options()};
};

TEST_F(RollingTracker, RowsAreComparedWithWhereTheyWereExposed) {
  for (const Modalities& modalities :
       {Modalities{false, true, false, false}, Modalities{false, true, true, false}}) {
    const double least = lean(rig_.shoot(shot()), 0, modalities);
    for (const double readout_s : {kReadout, -kReadout}) {
      const FramePtr frame = rolled(readout_s);
      const double untold = lean(frame, 0, modalities) - least;
      const double told = lean(frame, readout_s, modalities) - least;
      EXPECT_GT(std::abs(untold), 0.006) << readout_s;
      EXPECT_LT(std::abs(told), 0.5 * std::abs(untold)) << readout_s;
    }
  }
}

}  // namespace
}  // namespace sightline
