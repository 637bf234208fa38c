// SPDX-License-Identifier: Apache-2.0
#include "simulated_user.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sightline/geometry/rotation_between.hpp"

namespace sightline::test {
namespace {

constexpr double kDegrees = std::numbers::pi / 180;
constexpr double kUsualShare = 0.4;  // of the image's width that the target takes

}  // namespace

std::vector<TargetCorner> SimulatedUser::corners(size_t camera, const Rigid3& world_from_target,
                                                 double noise_px) {
  const CalibratedCamera& truth = rig_.truth[camera];
  const Rigid3 camera_from_target = truth.world_from_camera.inverse() * world_from_target;
  const Eigen::Vector2d half = rig_.views.target.size() / 2;
  const Eigen::Vector3d middle = camera_from_target * Eigen::Vector3d(half.x(), half.y(), 0);
  const Eigen::Vector3d normal = camera_from_target.rotation * Eigen::Vector3d::UnitZ();
  std::vector<TargetCorner> out;
  if (normal.dot(middle.normalized()) < 0.35) return out;
  for (int id = 0; id < rig_.views.target.corner_count(); ++id) {
    const Eigen::Vector2d p = rig_.views.target.corner(id);
    const auto pixel = truth.model.project(camera_from_target * Eigen::Vector3d(p.x(), p.y(), 0));
    if (!pixel) continue;
    const Eigen::Vector2d noisy = *pixel + noise_px * random_.normal<2>();
    if (truth.model.contains(noisy)) out.push_back({id, noisy, Eigen::Vector2d::Zero()});
  }
  return out;
}

Rigid3 SimulatedUser::try_pose(const CaptureAdvice& advice) {
  const size_t c = advice.camera;
  const CameraModel& lens = rig_.truth[c].model;
  const Eigen::Vector2d size = rig_.views.target.size();
  if (advice.distance == CaptureAdvice::Distance::kNearer) nearness_[c] = 0.7;
  if (advice.distance == CaptureAdvice::Distance::kFarther) nearness_[c] = 1.7;
  if (advice.distance == CaptureAdvice::Distance::kAny) nearness_[c] = 1;
  const double usual = lens.parameters().fx * size.x() / (kUsualShare * lens.width());
  const double distance = usual * nearness_[c] * random_.uniform(0.95, 1.05);
  const ImageRegion region = advice.region.value_or(ImageRegion{1, 1});
  const double spread = advice.region ? 0.07 : 0.2;
  const Eigen::Vector2d pixel(
      ((2 * region.column + 1) / 6.0 + random_.uniform(-spread, spread)) * lens.width(),
      ((2 * region.row + 1) / 6.0 + random_.uniform(-spread, spread)) * lens.height());
  const auto ray = lens.unproject(pixel);
  Eigen::Vector3d sight = ray ? *ray : Eigen::Vector3d::UnitZ();
  Rigid3 camera_from_eye(rotation_between(Eigen::Vector3d::UnitZ(), sight),
                         Eigen::Vector3d::Zero());
  if (advice.kind == CaptureAdvice::Kind::kTogether) {
    // Between the two, facing both.
    const Rigid3 camera_from_other =
        rig_.truth[c].world_from_camera.inverse() * rig_.truth[advice.other].world_from_camera;
    const Eigen::Vector3d aim = camera_from_other.translation / 2;
    camera_from_eye.rotation =
        rotation_between(Eigen::Vector3d::UnitZ(), (distance * sight - aim).normalized());
  }
  Eigen::Quaterniond tilt = Eigen::Quaterniond::Identity();
  if (habits_.tilts) {
    const double small = advice.tilt ? 0 : 1;
    double about_x = small * random_.uniform(-12, 12), about_y = small * random_.uniform(-12, 12);
    if (advice.tilt == TiltSide::kLeft) about_y = -26;
    if (advice.tilt == TiltSide::kRight) about_y = 26;
    if (advice.tilt == TiltSide::kTop) about_x = 26;
    if (advice.tilt == TiltSide::kBottom) about_x = -26;
    tilt = Eigen::AngleAxisd(about_x * kDegrees, Eigen::Vector3d::UnitX()) *
           Eigen::AngleAxisd(about_y * kDegrees, Eigen::Vector3d::UnitY());
  }
  const Eigen::AngleAxisd roll(random_.uniform(-0.2, 0.2), Eigen::Vector3d::UnitZ());
  const Eigen::Quaterniond turned = camera_from_eye.rotation * tilt * Eigen::Quaterniond(roll);
  const Rigid3 camera_from_target(
      turned, distance * sight - turned * Eigen::Vector3d(size.x() / 2, size.y() / 2, 0));
  return rig_.truth[c].world_from_camera * camera_from_target;
}

void SimulatedUser::show(const Rigid3& pose, double tremble_px, double seconds,
                         const std::function<void(const TargetSight&)>& see) {
  const Duration period = from_seconds(1 / habits_.rate_hz);
  const Time end = now_ + from_seconds(seconds);
  const auto cameras = static_cast<int64_t>(rig_.truth.size());
  for (; now_ < end; now_ += period) {
    const Eigen::Vector2d shaken = tremble_px * random_.normal<2>();
    for (int64_t c = 0; c < cameras; ++c) {
      TargetSight sight{static_cast<size_t>(c), now_ + period * c / cameras, {}, 2};
      sight.corners = corners(sight.camera, pose, habits_.noise_px);
      for (TargetCorner& corner : sight.corners) corner.pixel += shaken;
      std::erase_if(sight.corners, [&](const TargetCorner& corner) {
        return !rig_.truth[sight.camera].model.contains(corner.pixel);
      });
      see(sight);
    }
  }
}

Rigid3 SimulatedUser::pose_for(const CaptureAdvice& advice) {
  Rigid3 pose = try_pose(advice);
  if (advice.kind != CaptureAdvice::Kind::kTogether) return pose;
  // Looks at both cameras while walking about.
  const auto least = static_cast<size_t>(rig_.views.target.corner_count()) / 2;
  for (int i = 0; i < 200; ++i) {
    if (corners(advice.camera, pose, 0).size() > least &&
        corners(advice.other, pose, 0).size() > least) {
      break;
    }
    pose = try_pose(advice);
  }
  return pose;
}

void SimulatedUser::hold(const Rigid3& world_from_target,
                         const std::function<void(const TargetSight&)>& see) {
  show(world_from_target, 12, 0.4, see);  // on the way
  show(world_from_target, habits_.tremble_px, habits_.held_s, see);
}

void SimulatedUser::follow(const CaptureAdvice& advice,
                           const std::function<void(const TargetSight&)>& see) {
  hold(pose_for(advice), see);
}

}  // namespace sightline::test
