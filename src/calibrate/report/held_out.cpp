// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "calibrate/report/rig_bundle.hpp"
#include "sightline/calibrate/assess.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr size_t kMaxPredictions = 2000;
constexpr size_t kLeastCorners = 6;
constexpr size_t kLeastShared = 4;  // corners from which a plane's pose follows

struct Sum {
  double squares = 0;
  size_t count = 0;
  std::optional<double> rms() const {
    if (count == 0) return std::nullopt;
    return std::sqrt(squares / static_cast<double>(count));
  }
};

/// Predicts view `v` of the bundle from the views `from` of the same set, or from its own even
/// corners if there are none; adds the errors.
void predict(const Bundle& rig, size_t v, const std::vector<size_t>& from, const Rigid3& start,
             Sum& sum) {
  Bundle one;
  one.target = rig.target;
  one.bend = rig.bend;
  one.cameras = rig.cameras;
  one.world_from_target = {start};
  BundleView predicted = rig.views[v];
  predicted.set = 0;
  if (from.empty()) {
    BundleView half = predicted;
    for (size_t i = 0; i < half.used.size(); i += 2) half.used[i] = 0;
    one.views.push_back(half);
    for (size_t i = 1; i < predicted.used.size(); i += 2) predicted.used[i] = 0;
  }
  for (const size_t other : from) {
    one.views.push_back(rig.views[other]);
    one.views.back().set = 0;
  }
  if (one.corner_count() < kLeastShared) return;
  BundleOptions options;
  options.max_iterations = 30;
  adjust(one, options);
  for (size_t i = 0; i < predicted.used.size(); ++i) {
    if (!predicted.used[i]) continue;
    const auto error = corner_error(one, predicted, i);
    if (!error) continue;
    sum.squares += error->squaredNorm();
    ++sum.count;
  }
}

}  // namespace

HeldOut held_out_error(const CalibrationViews& views, const RigSolution& solution,
                       const std::vector<char>& which) {
  Bundle rig = rig_bundle(views, solution);
  for (BundleCamera& camera : rig.cameras) {
    camera.free.fill(false);
    camera.place_free = false;
  }
  std::vector<std::vector<size_t>> by_set(views.sets);
  size_t total = 0;
  for (size_t v = 0; v < rig.views.size(); ++v) {
    const auto used = std::count(rig.views[v].used.begin(), rig.views[v].used.end(), 1);
    if (static_cast<size_t>(used) < kLeastCorners || !which[rig.views[v].set]) continue;
    by_set[rig.views[v].set].push_back(v);
    ++total;
  }
  const size_t stride = 1 + total / kMaxPredictions;
  std::vector<Sum> sums(views.cameras.size());
  size_t turn = 0;
  for (const std::vector<size_t>& set : by_set) {
    for (const size_t v : set) {
      if (turn++ % stride != 0) continue;
      if (set.size() == 1 && views.cameras.size() > 1) continue;
      std::vector<size_t> others;
      for (const size_t other : set) {
        if (other != v) others.push_back(other);
      }
      const auto& start = solution.world_from_target[rig.views[v].set];
      if (start) predict(rig, v, others, *start, sums[rig.views[v].camera]);
    }
  }
  HeldOut out;
  Sum all;
  for (const Sum& sum : sums) {
    out.by_camera.push_back(sum.rms());
    all.squares += sum.squares;
    all.count += sum.count;
  }
  out.all = all.rms();
  return out;
}

}  // namespace sightline
