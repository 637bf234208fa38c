// SPDX-License-Identifier: Apache-2.0
#include "synthetic_views.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sightline/geometry/rolling_shutter.hpp"

namespace sightline::test {
namespace {

constexpr int kWidth = 1280, kHeight = 720;
constexpr double kDegrees = std::numbers::pi / 180;

CameraModel lens(const SyntheticRigOptions& options, Random& random) {
  CameraModel::Parameters p;
  p.lens = options.lens;
  p.width = kWidth;
  p.height = kHeight;
  p.fx = options.focal * random.uniform(0.97, 1.03);
  p.fy = p.fx * random.uniform(0.998, 1.002);
  p.cx = 639.5 + random.uniform(-15, 15);
  p.cy = 359.5 + random.uniform(-15, 15);
  if (options.lens == LensModel::kFisheye) {
    p.distortion = {-0.02, 0.004, -0.002, 0.0003};
  } else {
    p.distortion = {-0.12, 0.06, 0.0006, -0.0004, -0.01};
    if (options.lens == LensModel::kRational) {
      p.distortion = {0.21, -0.05, 0.0006, -0.0004, 0.002, 0.33, -0.03, 0.004};
    }
  }
  return *CameraModel::create(p, "test");
}

/// world_from_camera of a camera at `from` that looks at `to`, its y axis down.
Rigid3 look(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d z = (to - from).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d r;
  r << x, z.cross(x), z;
  return {Eigen::Quaterniond(r), from};
}

/// A face of the pillar, a quarter of the ring's radius high.
CalibrationTarget face_target(size_t face, double radius) {
  CalibrationTarget target;
  target.name = "face" + std::to_string(face);
  target.kind = TargetKind::kTagGrid;
  target.columns = target.rows = 2;
  target.marker = 0.1 * radius;
  target.gap = 0.02 * radius;
  target.dictionary = "tag36h11";
  target.first_id = static_cast<int>(4 * face);
  target.fixed = true;
  return target;
}

/// world_from_target of a face whose front looks into this direction.
Rigid3 face_pose(const CalibrationTarget& target, double turn, double radius) {
  const Eigen::Vector3d out(std::cos(turn), std::sin(turn), 0);
  Eigen::Matrix3d r;
  r << (-Eigen::Vector3d::UnitZ()).cross(-out), -Eigen::Vector3d::UnitZ(), -out;
  const Eigen::Vector3d middle = 0.15 * radius * out + 0.3 * Eigen::Vector3d::UnitZ();
  const Eigen::Vector2d half = target.size() / 2;
  return {Eigen::Quaterniond(r), middle - r * Eigen::Vector3d(half.x(), half.y(), 0)};
}

void add_pillar(const SyntheticRigOptions& options, double radius, Random& random,
                SyntheticRig& rig) {
  for (size_t face = 0; face < options.pillar; ++face) {
    const CalibrationTarget target = face_target(face, radius);
    const double turn =
        2 * std::numbers::pi * static_cast<double>(face) / static_cast<double>(options.pillar);
    const Rigid3 pose = face_pose(target, turn, radius);
    const int offset = rig.views.target.corner_count();
    rig.views.target.others.push_back(target);
    for (size_t c = 0; c < rig.truth.size(); ++c) {
      const Rigid3 camera_from_target = rig.truth[c].world_from_camera.inverse() * pose;
      const Eigen::Vector3d normal = camera_from_target.rotation * Eigen::Vector3d::UnitZ();
      if (normal.dot(camera_from_target.translation.normalized()) < 0.5) continue;
      TargetView view{c, rig.views.sets, 0, {}, target.name};
      for (int id = 0; id < target.corner_count(); ++id) {
        const Eigen::Vector2d p = target.corner(id);
        const auto pixel =
            rig.truth[c].model.project(camera_from_target * Eigen::Vector3d(p.x(), p.y(), 0));
        if (!pixel) continue;
        const Eigen::Vector2d noisy = *pixel + options.noise_px * random.normal<2>();
        if (!rig.truth[c].model.contains(noisy)) continue;
        view.corners.push_back({offset + id, noisy, Eigen::Vector2d::Zero()});
      }
      if (view.corners.size() >= 12) rig.views.views.push_back(std::move(view));
    }
    ++rig.views.sets;
  }
}

}  // namespace

CalibrationTarget test_target() {
  CalibrationTarget target;
  target.name = "board";
  target.kind = TargetKind::kChessboard;
  target.columns = 10;
  target.rows = 7;
  target.square = 0.04;
  return target;
}

SyntheticRig make_rig(const SyntheticRigOptions& options) {
  Random random(options.seed);
  SyntheticRig rig;
  rig.views.target = test_target();
  rig.views.target.square = options.square;
  rig.views.sets = options.sets;
  const auto n = static_cast<double>(options.cameras);
  const double radius = std::max(1.4, n * 0.5 / (2 * std::numbers::pi));
  const double step = options.cameras > 3 ? 2 * std::numbers::pi / n : 0.45;
  const auto place = [&](double turn) {
    return Eigen::Vector3d(radius * std::cos(turn * step), radius * std::sin(turn * step), 0.3);
  };
  for (size_t c = 0; c < options.cameras; ++c) {
    const std::string name = fmt::format("cam{}", c);
    const Eigen::Vector3d at = place(static_cast<double>(c));
    const Rigid3 pose = look(at + 0.05 * random.normal<3>(), 0.05 * random.normal<3>());
    rig.truth.push_back({name, lens(options, random), pose, 0});
    rig.truth.back().readout_s = (c % 2 == 1 ? 1.0 : -0.5) * options.readout_s;
    rig.views.cameras.push_back({name, kWidth, kHeight, options.sets});
  }
  const Eigen::Vector2d half = rig.views.target.size() / 2;
  for (size_t set = 0; set < options.sets; ++set) {
    const double turn =
        static_cast<double>(set % options.cameras) + (options.cameras > 1 ? 0.5 : 0.0);
    const double between = options.cameras == 2 ? 0.5 : turn;
    const Rigid3 eye = look(place(between), Eigen::Vector3d::Zero());
    const double distance = random.uniform(options.nearest, options.farthest);
    const Eigen::Vector3d at(random.uniform(-0.3, 0.3) * distance,
                             random.uniform(-0.2, 0.2) * distance, distance);
    const double heading = random.uniform(0, 2 * std::numbers::pi);
    const Eigen::AngleAxisd tilt(options.tilt_deg * kDegrees * random.uniform(0.3, 1),
                                 Eigen::Vector3d(std::cos(heading), std::sin(heading), 0));
    const Eigen::AngleAxisd spin(random.uniform(-0.5, 0.5), Eigen::Vector3d::UnitZ());
    const Eigen::Quaterniond turned(tilt * spin);
    const Rigid3 eye_from_target(turned, at - turned * Eigen::Vector3d(half.x(), half.y(), 0));
    const Rigid3 world_from_target = eye * eye_from_target;
    const Eigen::Vector3d velocity = options.speed * random.normal<3>().normalized();
    const Eigen::Vector3d spinning =
        options.turn == 0 ? Eigen::Vector3d::Zero()
                          : Eigen::Vector3d(options.turn * random.normal<3>().normalized());
    for (size_t c = 0; c < options.cameras; ++c) {
      const bool shown = c == set % options.cameras || c == (set + 1) % options.cameras;
      if (options.two_at_a_time && !shown) continue;
      const CalibratedCamera& camera = rig.truth[c];
      const double late = c == 0 ? 0 : options.offset_s;
      const Rigid3 camera_from_world = camera.world_from_camera.inverse();
      const Eigen::Vector3d normal_in_camera =
          camera_from_world.rotation * (world_from_target.rotation * Eigen::Vector3d::UnitZ());
      const Eigen::Vector3d middle_in_camera =
          camera_from_world * (world_from_target * Eigen::Vector3d(half.x(), half.y(), 0));
      if (normal_in_camera.dot(middle_in_camera.normalized()) < 0.35) continue;
      TargetView view{c, set, 0, {}, fmt::format("set {}", set)};
      for (int id = 0; id < rig.views.target.corner_count(); ++id) {
        const Eigen::Vector2d p = rig.views.target.corner(id);
        const double u = p.x() / half.x() - 1, v = p.y() / half.y() - 1;
        const double z = options.bend.x() * (1 - u * u) + options.bend.y() * (1 - v * v);
        const Eigen::Vector3d middle(half.x(), half.y(), 0),
            from_middle(p.x() - half.x(), p.y() - half.y(), z);
        const auto project = [&](double time) {
          const Rigid3 spun = Rigid3::exp((Vector6() << spinning * time, 0, 0, 0).finished());
          return camera.model.project(
              camera_from_world *
              (world_from_target * (middle + spun * from_middle) + velocity * time));
        };
        // A row is exposed when it is read; which row that is depends on when.
        const auto exposed = [&](double time) {
          auto pixel = project(time);
          for (int i = 0; pixel && camera.readout_s != 0 && i < 5; ++i) {
            pixel = project(time + row_delay_s(camera, pixel->y()));
          }
          return pixel;
        };
        const auto pixel = exposed(late), before = exposed(late - 0.01),
                   after = exposed(late + 0.01);
        if (!pixel || !before || !after || !camera.model.contains(*pixel)) continue;
        const Eigen::Vector2d noisy = *pixel + options.noise_px * random.normal<2>();
        if (!camera.model.contains(noisy)) continue;
        view.corners.push_back({id, noisy, (*after - *before) / 0.02});
      }
      if (view.corners.size() >= 12) rig.views.views.push_back(std::move(view));
    }
  }
  add_pillar(options, radius, random, rig);
  const Rigid3 first_from_world = rig.truth[0].world_from_camera.inverse();
  for (CalibratedCamera& c : rig.truth)
    c.world_from_camera = first_from_world * c.world_from_camera;
  return rig;
}

}  // namespace sightline::test
