// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve/chain.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

namespace sightline::calibrate {
namespace {

constexpr size_t kMaxCandidates = 60;

/// The pose that the others agree with most: least median of distances, in which one radian counts
/// as much as one meter at the targets' own distance.
Rigid3 medoid(std::vector<Rigid3> poses) {
  if (poses.size() > kMaxCandidates) {
    std::vector<Rigid3> some;
    for (size_t i = 0; i < kMaxCandidates; ++i) {
      some.push_back(poses[i * poses.size() / kMaxCandidates]);
    }
    poses = std::move(some);
  }
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> distances(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    for (size_t j = 0; j < poses.size(); ++j) {
      distances[j] = rotation_angle(poses[i], poses[j]) + translation_distance(poses[i], poses[j]);
    }
    const auto middle = distances.begin() + static_cast<ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    if (*middle < least) {
      least = *middle;
      best = i;
    }
  }
  return poses[best];
}

using Links = std::map<std::pair<size_t, size_t>, std::vector<Rigid3>>;

/// camera_from_other of all pairs that saw the target in one set, both ways.
Links find_links(const Bundle& bundle, const std::vector<std::optional<TargetPose>>& poses) {
  std::vector<std::vector<size_t>> by_set(bundle.world_from_target.size());
  for (size_t v = 0; v < bundle.views.size(); ++v) {
    if (poses[v]) by_set[bundle.views[v].set].push_back(v);
  }
  Links links;
  for (const auto& views : by_set) {
    for (const size_t a : views) {
      for (const size_t b : views) {
        if (a == b) continue;
        links[{bundle.views[a].camera, bundle.views[b].camera}].push_back(
            poses[a]->camera_from_target * poses[b]->camera_from_target.inverse());
      }
    }
  }
  return links;
}

}  // namespace

void place_cameras(Bundle& bundle, const std::vector<std::optional<TargetPose>>& poses,
                   size_t reference) {
  const Links links = find_links(bundle, poses);
  std::vector<char> placed(bundle.cameras.size(), 0);
  bundle.cameras[reference].world_from_camera = Rigid3();
  placed[reference] = 1;
  for (size_t round = 1; round < bundle.cameras.size(); ++round) {
    const Links::value_type* strongest = nullptr;
    for (const auto& link : links) {
      if (!placed[link.first.first] || placed[link.first.second]) continue;
      if (strongest == nullptr || link.second.size() > strongest->second.size()) {
        strongest = &link;
      }
    }
    if (strongest == nullptr) break;
    const auto [from, to] = strongest->first;
    bundle.cameras[to].world_from_camera =
        bundle.cameras[from].world_from_camera * medoid(strongest->second);
    placed[to] = 1;
  }
  std::vector<double> best(bundle.world_from_target.size(), -1);
  for (size_t v = 0; v < bundle.views.size(); ++v) {
    const BundleView& view = bundle.views[v];
    if (!poses[v] || !placed[view.camera]) continue;
    const double weight = static_cast<double>(view.view->corners.size()) / (0.1 + poses[v]->rms_px);
    if (weight <= best[view.set]) continue;
    best[view.set] = weight;
    bundle.world_from_target[view.set] =
        bundle.cameras[view.camera].world_from_camera * poses[v]->camera_from_target;
  }
}

}  // namespace sightline::calibrate
