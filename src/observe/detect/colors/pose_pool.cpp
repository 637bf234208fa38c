// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/colors/pose_pool.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

constexpr size_t kChunk = 256;  // poses that a thread takes at once

double with_colors(const JointPose& pose) { return pose.score * std::max(0.0, pose.colors); }

bool better_with_colors(const JointPose& a, const JointPose& b) {
  return with_colors(a) > with_colors(b);
}

bool any_agrees(std::span<const JointPose> poses) {
  return std::any_of(poses.begin(), poses.end(),
                     [](const JointPose& pose) { return pose.colors > 0; });
}

}  // namespace

void add_agreement(const MeshColors* colors, std::span<JointPose> poses, const Executor& executor) {
  if (colors == nullptr) return;
  executor((poses.size() + kChunk - 1) / kChunk, [&](size_t chunk) {
    for (size_t i = kChunk * chunk; i < std::min(poses.size(), kChunk * (chunk + 1)); ++i) {
      poses[i].colors = colors->agreement(poses[i].world_from_object);
    }
  });
}

void sort_by_score(std::vector<JointPose>& poses) {
  std::stable_sort(poses.begin(), poses.end(),
                   [](const JointPose& a, const JointPose& b) { return a.score > b.score; });
}

std::vector<JointPose> thinned(std::span<const JointPose> poses, const Eigen::Vector3d& center,
                               double place_step, double angle_step, size_t max) {
  std::set<std::array<int, 7>> taken;
  std::vector<JointPose> out;
  for (const JointPose& pose : poses) {
    if (out.size() == max) break;
    const Eigen::Vector3d place = pose.world_from_object * center / place_step;
    Eigen::Vector4d q = pose.world_from_object.rotation.coeffs() * (2 / angle_step);
    if (q.w() < 0) q = -q;
    std::array<int, 7> cell;
    for (int i = 0; i < 3; ++i)
      cell[static_cast<size_t>(i)] = static_cast<int>(std::floor(place[i]));
    for (int i = 0; i < 4; ++i)
      cell[static_cast<size_t>(3 + i)] = static_cast<int>(std::lround(q[i]));
    if (taken.insert(cell).second) out.push_back(pose);
  }
  return out;
}

std::vector<JointPose> keep_of_each_distance(std::span<const JointPose> poses,
                                             const Eigen::Vector3d& eye,
                                             const Eigen::Vector3d& center, size_t max,
                                             const KeepPoses& keep) {
  std::map<int, std::vector<JointPose>> by_step;
  for (const JointPose& pose : poses) {
    const double distance = (pose.world_from_object * center - eye).norm();
    by_step[static_cast<int>(std::floor(std::log(distance) / std::log(kDistanceStep)))].push_back(
        pose);
  }
  std::vector<std::vector<JointPose>> some;
  for (auto& [step, there] : by_step) some.push_back(std::move(there));
  std::stable_sort(some.begin(), some.end(),
                   [](const auto& a, const auto& b) { return a.size() < b.size(); });
  std::vector<JointPose> out;
  for (size_t i = 0; i < some.size(); ++i) {
    const size_t share = (max - out.size()) / (some.size() - i);
    for (JointPose& pose : keep(std::move(some[i]), share)) out.push_back(std::move(pose));
  }
  return out;
}

std::vector<size_t> best_halves(std::span<const float> colored, size_t max) {
  std::vector<size_t> kept(colored.size());
  std::iota(kept.begin(), kept.end(), size_t{0});
  if (colored.size() <= max) return kept;
  const auto rest = kept.begin() + static_cast<ptrdiff_t>(max / 2);
  const auto end = kept.begin() + static_cast<ptrdiff_t>(max);
  std::partial_sort(rest, end, kept.end(), [&](size_t a, size_t b) {
    return colored[a] > colored[b] || (colored[a] == colored[b] && a < b);
  });
  kept.erase(end, kept.end());
  std::sort(rest, kept.end());
  return kept;
}

std::vector<JointPose> keep_best(std::vector<JointPose> poses, size_t max) {
  sort_by_score(poses);
  if (poses.size() <= max) return poses;
  std::vector<float> colored;
  for (const JointPose& pose : poses) colored.push_back(static_cast<float>(with_colors(pose)));
  std::vector<JointPose> kept;
  for (const size_t i : best_halves(colored, max)) kept.push_back(poses[i]);
  return kept;
}

std::vector<JointPose> best_of_cells(std::vector<JointPose> poses, const Eigen::Vector3d& center,
                                     double place_step, double angle_step, size_t max) {
  sort_by_score(poses);
  const bool colored = any_agrees(poses);
  std::vector<JointPose> out =
      thinned(poses, center, place_step, angle_step, colored ? max / 2 : max);
  if (!colored) return out;
  std::stable_sort(poses.begin(), poses.end(), better_with_colors);
  for (const JointPose& pose : thinned(poses, center, place_step, angle_step, max / 2)) {
    out.push_back(pose);
  }
  return out;
}

}  // namespace sightline::observe
