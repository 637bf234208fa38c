// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibrate/axes/head_fit.hpp"
#include "calibrate/axes/solved_axes.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr size_t kParts = 4;

/// What a setting is off by where nothing but its readings is known of it.
void predict(const HeadProblem& fitted, const HeadView& view, SolvedSetting& setting) {
  double squares = 0, count = 0, millimeters = 0;
  const LensVector& lens = fitted.model.lenses[view.lens];
  Eigen::Vector2d angles;
  if (!angles_of(view, fitted.model.encoder, angles, nullptr)) return;
  const Rigid3 camera_from_world = fitted.model.world_from_camera(angles).inverse();
  for (size_t s = 0; s < view.weights.size(); ++s) {
    const auto errors = corner_errors(fitted, view, s, Eigen::Vector2d::Zero());
    const BodySight& sight = view.setting->sights[s];
    for (size_t i = 0; i < errors.size(); ++i) {
      if (view.weights[s][i] == 0) continue;
      const Eigen::Vector3d point =
          camera_from_world * (fitted.model.world_from_body[sight.body] *
                               fitted.sights->bodies[sight.body].point(sight.corners[i].id));
      const double mm = 1e3 * errors[i].norm() / lens[0] * point.norm();
      squares += errors[i].squaredNorm();
      millimeters += mm * mm;
      ++count;
    }
  }
  if (count == 0) return;
  setting.held_out_px = std::sqrt(squares / count);
  setting.held_out_deg = *setting.held_out_px / lens[0] / kDegree;
  setting.held_out_mm = std::sqrt(millimeters / count);
}

}  // namespace

void add_held_out(const HeadProblem& problem, AxesSolution& solution) {
  std::vector<size_t> rest;
  for (size_t v = 0; v < problem.views.size(); ++v) {
    if (!problem.views[v].moving() && problem.views[v].used) rest.push_back(v);
  }
  for (size_t part = 0; part < kParts; ++part) {
    HeadProblem fewer = problem;
    std::vector<char> seen(problem.sights->bodies.size(), 0);
    for (size_t k = 0; k < rest.size(); ++k) fewer.views[rest[k]].used = k % kParts != part;
    for (const HeadView& view : fewer.views) {
      for (const BodySight& sight : view.setting->sights) {
        if (view.used) seen[sight.body] = 1;
      }
    }
    // A body that nothing else shows stays where it is, and its settings predict nothing.
    for (size_t b = 0; b < seen.size(); ++b) {
      if (!seen[b]) fewer.free.bodies[b] = 0;
    }
    if (!adjust(fewer, 40)) continue;
    for (size_t k = part; k < rest.size(); k += kParts) {
      const HeadView& view = problem.views[rest[k]];
      const bool fair = std::ranges::all_of(
          view.setting->sights, [&](const BodySight& sight) { return seen[sight.body] != 0; });
      if (fair) predict(fewer, view, solution.settings[rest[k]]);
    }
  }
}

}  // namespace sightline::calibrate
