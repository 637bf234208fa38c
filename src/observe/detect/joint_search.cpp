// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/joint_search.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

constexpr size_t kChunk = 256;  // hits that a thread takes at once

bool better(const JointPose& a, const JointPose& b) { return a.score > b.score; }

}  // namespace

double JointSearch::camera_score(size_t camera, const Rigid3& world_from_object,
                                 Spread spread) const {
  const SearchCamera& seen_by = cameras_[camera];
  const auto flat = bank_.weak_perspective(
      seen_by.camera->model, seen_by.camera_from_world * world_from_object, seen_by.shrink);
  if (!flat) return -1;
  const auto scale = static_cast<double>(flat->scale);
  const ResponseMaps& maps =
      spread == Spread::kFar ? seen_by.far(scale, bank_.model().radius()) : seen_by.near(scale);
  if (flat->x < 0 || flat->y < 0 || flat->x >= static_cast<float>(maps.width()) ||
      flat->y >= static_cast<float>(maps.height()))
    return -1;
  return static_cast<double>(bank_.score(*flat, maps));
}

double JointSearch::score(const Rigid3& world_from_object, Spread spread) const {
  double sum = 0;
  for (size_t i = 0; i < cameras_.size(); ++i) {
    sum += std::max(0.0, camera_score(i, world_from_object, spread) - kClutterResponse);
  }
  return sum;
}

// How one camera sees a pose that moves along a ray of another one: the view and the turn stay, the
// place and the scale change.
struct JointSearch::Sweep {
  const SearchCamera& seen_by;
  WeakPerspectivePose flat;
  PlacedFeatures features;  // turned [m]
};

std::optional<JointSearch::Sweep> JointSearch::sweep(const SearchCamera& seen_by,
                                                     const Rigid3& world_from_object) const {
  const auto flat = bank_.weak_perspective(
      seen_by.camera->model, seen_by.camera_from_world * world_from_object, seen_by.shrink);
  if (!flat) return std::nullopt;
  Sweep out{seen_by, *flat, {}};
  const ViewFeatures& f = bank_.features(flat->view);
  const float c = std::cos(flat->turn), s = std::sin(flat->turn);
  out.features.count = f.count;
  for (size_t i = 0; i < ViewFeatures::kMax; ++i) {
    out.features.bins[i] = angle_bin(f.angle[i] + flat->turn);
    out.features.x[i] = c * f.x[i] - s * f.y[i];
    out.features.y[i] = s * f.x[i] + c * f.y[i];
  }
  return out;
}

double JointSearch::sweep_score(const Sweep& sweep, const Eigen::Vector3d& center_in_world) const {
  const Eigen::Vector3d center = sweep.seen_by.camera_from_world * center_in_world;
  const auto pixel = sweep.seen_by.camera->model.project(center);
  if (!pixel) return -1;
  const auto shrink = static_cast<float>(sweep.seen_by.shrink);
  const auto scale = static_cast<float>(sweep.seen_by.camera->model.parameters().fx /
                                        (center.norm() * sweep.seen_by.shrink));
  // Rounded by the cast below.
  const float x = (static_cast<float>(pixel->x()) + 0.5f) / shrink;
  const float y = (static_cast<float>(pixel->y()) + 0.5f) / shrink;
  const ResponseMaps& maps = sweep.seen_by.far(static_cast<double>(scale), bank_.model().radius());
  if (x < 0 || y < 0 || x >= static_cast<float>(maps.width()) ||
      y >= static_cast<float>(maps.height()))
    return -1;
  const size_t count = sweep.features.count;
  const int sum = sum_responses(maps.planes(), sweep.features, x, y, scale);
  return count == 0
             ? 0.0
             : static_cast<double>(sum) / static_cast<double>(ResponseMaps::kFullResponse * count);
}

std::optional<JointPose> JointSearch::verify(size_t camera, const ScanHit& hit,
                                             const ScanRange& range) const {
  const SearchCamera& seen_by = cameras_[camera];
  const Eigen::Vector3d& center = bank_.model().center();
  const WeakPerspectivePose flat = template_pose(hit, range);
  const auto pose = bank_.full_pose(seen_by.camera->model, flat, seen_by.shrink);
  if (!pose) return std::nullopt;
  const Rigid3 world_from_camera = seen_by.camera_from_world.inverse();
  const Rigid3 world = world_from_camera * *pose;
  const Eigen::Vector3d ray = world * center - world_from_camera.translation;
  std::array<double, kDepthSteps.size()> sums{};
  for (size_t i = 0; i < cameras_.size(); ++i) {
    if (i == camera) continue;
    const auto other = sweep(cameras_[i], world);
    if (!other) continue;
    for (size_t k = 0; k < kDepthSteps.size(); ++k) {
      const Eigen::Vector3d moved = world * center + (kDepthSteps[k] - 1) * ray;
      sums[k] += std::max(0.0, sweep_score(*other, moved) - kClutterResponse);
    }
  }
  size_t best = kDepthSteps.size() / 2;  // where it was found, unless another camera knows better
  for (size_t k = 0; k < sums.size(); ++k) {
    if (sums[k] > sums[best]) best = k;
  }
  bank_.work().checked += kDepthSteps.size() * (cameras_.size() - 1);
  JointPose out{world, sums[best]};
  out.world_from_object.translation += (kDepthSteps[best] - 1) * ray;
  const size_t features = std::max<size_t>(1, bank_.features(hit.view).count);
  const double own = hit.score / static_cast<double>(ResponseMaps::kFullResponse * features);
  out.score += std::max(0.0, own - kClutterResponse);
  return out;
}

std::vector<JointPose> JointSearch::verify(size_t camera, std::span<const ScanHit> hits,
                                           const ScanRange& range) const {
  std::vector<std::optional<JointPose>> poses(hits.size());
  executor_((hits.size() + kChunk - 1) / kChunk, [&](size_t chunk) {
    for (size_t i = kChunk * chunk; i < std::min(hits.size(), kChunk * (chunk + 1)); ++i) {
      poses[i] = verify(camera, hits[i], range);
    }
  });
  std::vector<JointPose> out;
  out.reserve(hits.size());
  for (const auto& pose : poses) {
    if (pose) out.push_back(*pose);
  }
  std::stable_sort(out.begin(), out.end(), better);
  return out;
}

void JointSearch::climb(std::vector<JointPose>& poses, Spread spread, double turn, double shift,
                        int halvings) const {
  executor_(poses.size(),
            [&](size_t i) { poses[i] = climb(poses[i], spread, turn, shift, halvings); });
}

JointPose JointSearch::climb(const JointPose& start, Spread spread, double turn, double shift,
                             int halvings) const {
  uint64_t steps = 0;
  const JointPose best = climb_pose(start.world_from_object, bank_.model().center(), turn, shift,
                                    halvings, [&](const Rigid3& pose) {
                                      ++steps;
                                      return score(pose, spread);
                                    });
  bank_.work().scored += steps * cameras_.size();
  return best;
}

void remove_duplicates(std::vector<JointPose>& poses, double distance, double angle) {
  std::stable_sort(poses.begin(), poses.end(), better);
  std::vector<JointPose> kept;
  for (const JointPose& pose : poses) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const JointPose& other) {
      return translation_distance(pose.world_from_object, other.world_from_object) < distance &&
             rotation_angle(pose.world_from_object, other.world_from_object) < angle;
    });
    if (!known) kept.push_back(pose);
  }
  poses = std::move(kept);
}

}  // namespace sightline::observe
