// SPDX-License-Identifier: Apache-2.0
#include "joint_search.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr double kClutterResponse = 0.4;  // what a cluttered place gives to anything
constexpr double kSpreadShare = 0.16;     // of the radius, [half-size px per px of the maps]
constexpr double kUsualSpeed = 0.4;       // [m/s] of what is looked for
constexpr std::array<double, 5> kDepthSteps = {0.9, 0.95, 1.0, 1.05, 1.1};

bool better(const JointPose& a, const JointPose& b) { return a.score > b.score; }

}  // namespace

int SearchCamera::motion_px(double scale) const {
  return static_cast<int>(std::lround(2 * kUsualSpeed * std::abs(seconds) * scale));
}

const ResponseMaps& SearchCamera::far(double scale, double radius) const {
  const int steps = static_cast<int>(std::lround(kSpreadShare * scale * radius));
  const int spread = std::max(2, steps) + motion_px(scale);
  return maps[static_cast<size_t>(std::min(spread, kSpreads) - 1)];
}

const ResponseMaps& SearchCamera::near(double scale) const {
  return maps[static_cast<size_t>(std::min(motion_px(scale), kSpreads - 1))];
}

std::vector<ScanHit> JointSearch::scan_camera(size_t camera, ScanRange range) const {
  const std::vector<float> scales = range.scales;
  range.most /= std::max<size_t>(1, scales.size());
  std::vector<ScanHit> out;
  for (size_t i = 0; i < scales.size(); ++i) {
    range.scales = {scales[i]};
    const auto scale = static_cast<double>(scales[i]);
    for (ScanHit hit : scan(bank_, cameras_[camera].far(scale, bank_.model().radius()), range)) {
      hit.scale = static_cast<uint16_t>(i);
      out.push_back(hit);
    }
  }
  return out;
}

double JointSearch::camera_score(size_t camera, const Rigid3& world_from_object,
                                 Spread spread) const {
  const SearchCamera& seen_by = cameras_[camera];
  const auto flat = bank_.flatten(seen_by.camera->model,
                                  seen_by.camera_from_world * world_from_object, seen_by.shrink);
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
  FlatPose flat;
  std::array<int, ViewFeatures::kMost> bins;
  std::array<float, ViewFeatures::kMost> x, y;  // of the features, turned [m]
};

std::optional<JointSearch::Sweep> JointSearch::sweep(const SearchCamera& seen_by,
                                                     const Rigid3& world_from_object) const {
  const auto flat = bank_.flatten(seen_by.camera->model,
                                  seen_by.camera_from_world * world_from_object, seen_by.shrink);
  if (!flat) return std::nullopt;
  Sweep out{seen_by, *flat, {}, {}, {}};
  const ViewFeatures& f = bank_.features(flat->view);
  const float c = std::cos(flat->turn), s = std::sin(flat->turn);
  for (size_t i = 0; i < f.count; ++i) {
    out.bins[i] = angle_bin(f.angle[i] + flat->turn);
    out.x[i] = c * f.x[i] - s * f.y[i];
    out.y[i] = s * f.x[i] + c * f.y[i];
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
  const size_t count = bank_.features(sweep.flat.view).count;
  int sum = 0;
  for (size_t i = 0; i < count; ++i) {
    const float u = x + scale * sweep.x[i], v = y + scale * sweep.y[i];
    if (u < 0 || v < 0) continue;
    sum += maps.at(sweep.bins[i], static_cast<int>(u), static_cast<int>(v));
  }
  return count == 0
             ? 0.0
             : static_cast<double>(sum) / static_cast<double>(ResponseMaps::kFullResponse * count);
}

std::vector<JointPose> JointSearch::verify(size_t camera, std::span<const ScanHit> hits,
                                           const ScanRange& range, size_t most) const {
  const SearchCamera& seen_by = cameras_[camera];
  const Rigid3 world_from_camera = seen_by.camera_from_world.inverse();
  const Eigen::Vector3d& center = bank_.model().center();
  std::vector<JointPose> out;
  out.reserve(hits.size());
  std::vector<Sweep> sweeps;
  for (const ScanHit& hit : hits) {
    const FlatPose flat = flat_pose(hit, range);
    const auto pose = bank_.unflatten(seen_by.camera->model, flat, seen_by.shrink);
    if (!pose) continue;
    const Rigid3 world = world_from_camera * *pose;
    const Eigen::Vector3d ray = world * center - world_from_camera.translation;
    sweeps.clear();
    for (size_t i = 0; i < cameras_.size(); ++i) {
      if (i == camera) continue;
      if (auto made = sweep(cameras_[i], world)) sweeps.push_back(*made);
    }
    JointPose best{world, -1};
    for (const double depth : kDepthSteps) {
      const Eigen::Vector3d shift = (depth - 1) * ray;
      double sum = 0;
      for (const Sweep& other : sweeps) {
        sum += std::max(0.0, sweep_score(other, world * center + shift) - kClutterResponse);
      }
      if (sum > best.score) {
        best = {world, sum};
        best.world_from_object.translation += shift;
      }
    }
    const size_t features = std::max<size_t>(1, bank_.features(hit.view).count);
    const double own = hit.score / static_cast<double>(ResponseMaps::kFullResponse * features);
    best.score += std::max(0.0, own - kClutterResponse);
    out.push_back(best);
  }
  std::stable_sort(out.begin(), out.end(), better);
  if (out.size() > most) out.resize(most);
  return out;
}

JointPose JointSearch::climb(const JointPose& start, Spread spread, double turn, double shift,
                             int halvings) const {
  return climb_pose(start.world_from_object, bank_.model().center(), turn, shift, halvings,
                    [&](const Rigid3& pose) { return score(pose, spread); });
}

void drop_alike(std::vector<JointPose>& poses, double distance, double angle) {
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

}  // namespace sightline
