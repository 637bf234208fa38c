// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/moved_body.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <optional>

#include "calibrate/axes/head_adjust.hpp"
#include "calibrate/axes/head_start.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kExplains = 0.4;  // of what is left unexplained by one place
constexpr size_t kMostTries = 24, kLeastSettings = 3;

/// The settings at rest with one body as two: before, and from setting `from` on.
struct Split {
  HeadSights sights;
  std::deque<HeadSetting> settings;
  HeadProblem problem;
  double unexplained = 1e18;  ///< chi^2 at noises that a good head has
};

std::optional<double> start_and_measure(HeadProblem& problem, bool hold_scales) {
  problem.free = {};
  problem.free.encoder[0] = problem.free.encoder[1] = !hold_scales;
  problem.fixed.clear();
  problem.sigma_px = problem.moving_px = 0.3;
  problem.reading_sigma = 0.02 * kDegree;
  for (HeadView& view : problem.views) {
    view.error.setZero();
    view.weight = 1;
    for (auto& weights : view.weights) std::fill(weights.begin(), weights.end(), 1.0);
  }
  if (!start_from_nothing(problem, hold_scales)) return std::nullopt;
  problem.free.base = false;  // the world is the base's
  set_sigmas(problem);
  if (!adjust(problem, 60)) return std::nullopt;
  const HeadCovariance at = head_covariance(problem);
  return at.chi2 / std::max(1.0, at.freedom);
}

std::vector<HeadView> views_at_rest(const HeadProblem& problem) {
  std::vector<HeadView> out;
  for (const HeadView& view : problem.views) {
    if (view.moving()) continue;
    out.push_back(view);
    out.back().used = true;
    out.back().sides = {0, 0};
  }
  return out;
}

/// `order`: views in which the body is seen, in order of time; from order[from] on it is another.
void make_split(const HeadProblem& base, size_t body, const std::vector<size_t>& order, size_t from,
                bool hold_scales, Split& out) {
  out.sights.cameras = base.sights->cameras;
  out.sights.bodies = base.sights->bodies;
  out.sights.bodies.push_back(out.sights.bodies[body]);
  out.problem = base;
  out.problem.sights = &out.sights;
  for (size_t k = from; k < order.size(); ++k) {
    HeadView& view = out.problem.views[order[k]];
    out.settings.push_back(*view.setting);
    for (BodySight& sight : out.settings.back().sights) {
      if (sight.body == body) sight.body = out.sights.bodies.size() - 1;
    }
    view.setting = &out.settings.back();
  }
  out.unexplained = start_and_measure(out.problem, hold_scales).value_or(1e18);
}

}  // namespace

Status check_moved_bodies(const HeadInputs& inputs, const HeadProblem& problem, bool hold_scales) {
  HeadProblem base = problem;
  base.views = views_at_rest(problem);
  HeadProblem whole = base;
  const double unexplained = start_and_measure(whole, hold_scales).value_or(1e18);
  for (size_t body = 0; body < inputs.sights.bodies.size(); ++body) {
    std::vector<size_t> order;  // settings are in order of time
    for (size_t v = 0; v < base.views.size(); ++v) {
      const auto& sights = base.views[v].setting->sights;
      if (std::ranges::count(sights, body, &BodySight::body) > 0) order.push_back(v);
    }
    if (order.size() < 2 * kLeastSettings) continue;
    const size_t tries = order.size() - 2 * kLeastSettings + 1;
    Split best;
    size_t at = 0;
    for (size_t i = 0; i < tries; i += 1 + tries / kMostTries) {
      Split split;
      make_split(base, body, order, kLeastSettings + i, hold_scales, split);
      if (split.unexplained >= best.unexplained) continue;
      best = std::move(split);
      at = kLeastSettings + i;
    }
    if (best.unexplained > kExplains * unexplained) continue;
    const Rigid3& before = best.problem.model.world_from_body[body];
    const Rigid3& after = best.problem.model.world_from_body.back();
    const HeadSetting& last = *base.views[order[at - 1]].setting;
    return make_error(
        ErrorCode::kInvalidInput, head_place(inputs.sights),
        "the {} was moved between the settings at {:.1f} and {:.1f} s of {}: by {:.1f} mm and "
        "{:.2f} "
        "degrees. Leave it where it is for the whole recording; another place of it is another "
        "recording",
        inputs.sights.bodies[body].name, last.from_s, base.views[order[at]].setting->from_s,
        inputs.sights.recordings[last.recording].name, 1e3 * translation_distance(before, after),
        rotation_angle(before, after) / kDegree);
  }
  return {};
}

}  // namespace sightline::calibrate
