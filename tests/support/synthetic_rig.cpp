// SPDX-License-Identifier: Apache-2.0
#include "support/synthetic_rig.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <tuple>

#include "sightline/geometry/rotation_between.hpp"
#include "support/random.hpp"
#include "support/reprojection_term.hpp"

namespace sightline::test {
namespace {

Rigid3 looking_at_origin(const Eigen::Vector3d& from) {
  Eigen::Matrix3d axes;
  axes.col(2) = -from.normalized();
  axes.col(0) = axes.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return Rigid3(Eigen::Quaterniond(axes), from);
}

// A start near the other pose that a planar marker could have: its normal mirrored at the line of
// sight.
Rigid3 flipped(const Rigid3& camera_from_object, const Fiducial& fiducial) {
  const Rigid3 camera_from_fiducial = camera_from_object * fiducial.object_from_fiducial;
  const Eigen::Vector3d sight = camera_from_fiducial.translation.normalized();
  const Eigen::Vector3d normal = camera_from_fiducial.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d mirrored = 2 * sight.dot(normal) * sight - normal;
  const Rigid3 other(rotation_between(normal, mirrored) * camera_from_fiducial.rotation,
                     camera_from_fiducial.translation);
  return other * fiducial.object_from_fiducial.inverse();
}

}  // namespace

std::vector<Fiducial> cube_of_tags(double size, double tag_size) {
  std::vector<Fiducial> tags;
  const Eigen::Vector3d normals[] = {{0, 0, 1},  {1, 0, 0},  {0, 1, 0},
                                     {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  for (int i = 0; i < 6; ++i) {
    Fiducial tag;
    tag.family = "tag36h11";
    tag.id = i;
    tag.size = tag_size;
    const Eigen::Quaterniond turn = rotation_between(Eigen::Vector3d::UnitZ(), normals[i]);
    tag.object_from_fiducial = Rigid3(turn, 0.5 * size * normals[i]);
    tags.push_back(tag);
  }
  return tags;
}

std::vector<Eigen::Vector3d> corners_in_object(const Fiducial& fiducial) {
  std::vector<Eigen::Vector3d> corners;
  const double half = 0.5 * fiducial.size;
  for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    corners.push_back(fiducial.object_from_fiducial * Eigen::Vector3d(half * x, half * y, 0));
  }
  return corners;
}

SyntheticRig::SyntheticRig(const RigOptions& options)
    : options_(options),
      motion_(options.motion, options.duration + std::chrono::seconds(1), options.seed),
      fiducials_(options.fiducials.empty() ? cube_of_tags(options.cube_size, options.tag_size)
                                           : options.fiducials) {
  place_cameras();
  make_frames();
}

void SyntheticRig::place_cameras() {
  for (int i = 0; i < options_.cameras; ++i) {
    const double share = options_.cameras > 1 ? i / (options_.cameras - 1.0) : 0.0;
    const double angle = options_.arc * share;
    const Eigen::Vector3d position =
        options_.distance * Eigen::Vector3d(std::cos(angle) * std::cos(options_.elevation),
                                            std::sin(angle) * std::cos(options_.elevation),
                                            std::sin(options_.elevation));
    cameras_.push_back({"cam" + std::to_string(i),
                        CameraModel::create(options_.lens, "synthetic rig").value(),
                        looking_at_origin(position), options_.pixel_sigma});
    if (static_cast<size_t>(i) < options_.recalibrated.size()) {
      Rigid3& calibrated = cameras_.back().world_from_camera;
      calibrated = calibrated * Rigid3::exp(options_.recalibrated[static_cast<size_t>(i)]);
    }
    Random random(options_.seed * 7368787u + static_cast<uint64_t>(i));
    Vector6 error;
    error << options_.direction_error * random.normal<3>().normalized(),
        options_.place_error * random.normal<3>().normalized();
    true_cameras_.push_back(cameras_.back());
    true_cameras_.back().world_from_camera = cameras_.back().world_from_camera * Rigid3::exp(error);
    if (static_cast<size_t>(i) >= options_.moved.size()) continue;
    Rigid3& pose = true_cameras_.back().world_from_camera;
    pose = pose * Rigid3::exp(options_.moved[static_cast<size_t>(i)]);
  }
}

void SyntheticRig::make_frames() {
  const double period = 1.0 / options_.rate_hz;
  for (int camera = 0; camera < options_.cameras; ++camera) {
    const auto index = static_cast<size_t>(camera);
    const double phase = options_.phases.empty() ? camera / static_cast<double>(options_.cameras)
                                                 : options_.phases.at(index);
    Random random(options_.seed * 1000003u + index * 7919u + 17u);
    const Duration skew = options_.skews.empty() ? Duration(0) : options_.skews.at(index);
    for (uint64_t i = 0;; ++i) {
      const double ideal = (static_cast<double>(i) + phase) * period + 0.002;
      if (ideal >= to_seconds(options_.duration)) break;
      const Time capture = Time(from_seconds(std::max(
          0.0,
          ideal + (options_.period_jitter > 0 ? options_.period_jitter * random.normal() : 0.0))));
      double stamp_error = to_seconds(options_.capture_error) * random.uniform(-1, 1);
      if (options_.stamp_jitter > 0) stamp_error += options_.stamp_jitter * random.normal();
      RigFrame frame;
      frame.camera = camera;
      frame.true_capture = capture;
      frame.observation.camera = CameraId(static_cast<uint32_t>(camera));
      frame.observation.sequence = i;
      frame.observation.capture = capture + skew + from_seconds(stamp_error);
      frame.observation.capture_error = options_.capture_error;
      const bool late = random.uniform() < options_.late_share;
      frame.arrival = capture + options_.delay + (late ? options_.late_by : Duration(0));
      frame.visible = random.uniform() >= options_.dropout && !hidden(camera, capture);
      const uint64_t seed = random.bits();
      if (frame.visible) observe(frame, seed);
      frames_.push_back(std::move(frame));
    }
  }
  std::stable_sort(frames_.begin(), frames_.end(), [](const RigFrame& a, const RigFrame& b) {
    return std::tuple(a.arrival, a.observation.capture, a.camera) <
           std::tuple(b.arrival, b.observation.capture, b.camera);
  });
}

bool SyntheticRig::hidden(int camera, Time time) const {
  return std::any_of(
      options_.occlusions.begin(), options_.occlusions.end(), [&](const Occlusion& o) {
        return (o.camera < 0 || o.camera == camera) && time >= Time(o.from) && time < Time(o.to);
      });
}

void SyntheticRig::observe(RigFrame& frame, uint64_t seed) const {
  Random random(seed);
  const CalibratedCamera& camera = cameras_[static_cast<size_t>(frame.camera)];
  Rigid3 pose = truth(frame.true_capture);
  for (const WrongPose& wrong : options_.wrong_poses) {
    if (wrong.camera == frame.camera && frame.true_capture >= Time(wrong.from) &&
        frame.true_capture < Time(wrong.to)) {
      pose = pose * wrong.error;
    }
  }
  const Rigid3 camera_from_object =
      true_cameras_[static_cast<size_t>(frame.camera)].world_from_camera.inverse() * pose;
  std::vector<PointMatch> matches;
  const Fiducial* seen = nullptr;
  int tags = 0;
  for (const Fiducial& tag : fiducials_) {
    const Rigid3 camera_from_tag = camera_from_object * tag.object_from_fiducial;
    const Eigen::Vector3d normal = camera_from_tag.rotation * Eigen::Vector3d::UnitZ();
    if (-normal.dot(camera_from_tag.translation.normalized()) < options_.min_cosine) continue;
    std::vector<PointMatch> corners;
    for (const Eigen::Vector3d& corner : corners_in_object(tag)) {
      const auto pixel = camera.model.project(camera_from_object * corner);
      if (!pixel || !camera.model.contains(*pixel)) break;
      corners.push_back({corner, *pixel + options_.pixel_sigma * random.normal<2>()});
    }
    if (corners.size() < 4) continue;
    matches.insert(matches.end(), corners.begin(), corners.end());
    seen = &tag;
    ++tags;
  }
  frame.visible = tags > 0;
  if (!frame.visible) return;
  const double sigma =
      options_.claimed_pixel_sigma > 0 ? options_.claimed_pixel_sigma : options_.pixel_sigma;
  const auto term = std::make_shared<ReprojectionTerm>(camera, std::move(matches), sigma);
  PoseHypothesis own;
  own.world_from_object = minimize(*term, pose, &own.cost);
  frame.observation.hypotheses.push_back(own);
  if (tags == 1) {
    PoseHypothesis other;
    other.world_from_object =
        minimize(*term, camera.world_from_camera * flipped(camera_from_object, *seen), &other.cost);
    if (rotation_angle(other.world_from_object, own.world_from_object) > 0.05) {
      frame.observation.hypotheses.push_back(other);
      if (other.cost < own.cost) {
        std::swap(frame.observation.hypotheses[0], frame.observation.hypotheses[1]);
      }
    }
  }
  frame.observation.terms.push_back(term);
}

std::vector<std::vector<Observation>> SyntheticRig::sets() const {
  std::vector<std::vector<Observation>> sets;
  Time arrival = Time::min();
  for (const RigFrame& frame : frames_) {
    const bool joins = !sets.empty() && arrival == frame.arrival &&
                       sets.back().front().capture == frame.observation.capture;
    if (!joins) sets.emplace_back();
    sets.back().push_back(frame.observation);
    arrival = frame.arrival;
  }
  return sets;
}

}  // namespace sightline::test
