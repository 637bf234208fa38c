// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/head_fit.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibrate/axes/head_start.hpp"
#include "sightline/calibrate/calibration_file.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kSoftFrom = 2.5, kCornerOut = 6, kSettingOut = 5;  // sigmas
constexpr double kLeastPx = 0.01, kMostReading = 0.05, kLeastJitter = 2e-5;

double weight_of(double sigmas, Outliers outliers, double out) {
  if (outliers == Outliers::kKept) return 1;
  if (outliers == Outliers::kLeftOut) return sigmas > out ? 0 : 1;
  return sigmas > kSoftFrom ? kSoftFrom / sigmas : 1;
}

void set_weights(HeadProblem& problem, Outliers outliers) {
  for (HeadView& view : problem.views) {
    const double off = view.error.cwiseQuotient(view.sigma).norm();
    const double weight = weight_of(off, outliers, kSettingOut);
    view.used = view.used && weight > 0;
    view.weight = weight > 0 ? weight : 1;
    for (size_t s = 0; s < view.weights.size(); ++s) {
      const auto errors = corner_errors(problem, view, s, view.error);
      for (size_t i = 0; i < errors.size(); ++i) {
        view.weights[s][i] =
            weight_of(errors[i].norm() / corner_sigma(problem, view), outliers, kCornerOut);
      }
    }
  }
}

void add_squares(const std::vector<Eigen::Vector2d>& errors, const std::vector<double>& weights,
                 double& squares, double& count) {
  for (size_t i = 0; i < errors.size(); ++i) {
    if (weights[i] == 0) continue;
    squares += errors[i].squaredNorm();
    ++count;
  }
}

std::string names_of(const HeadProblem& problem, const std::vector<size_t>& bodies) {
  std::string text;
  for (const size_t body : bodies) {
    text += (text.empty() ? "" : ", ") + problem.sights->bodies[body].name;
  }
  return text;
}

/// world_from_body by what the fixed cameras see; those that the head sees, too.
std::vector<size_t> place_by_cameras(HeadProblem& problem, std::vector<Rigid3>& world_from_body) {
  std::vector<size_t> placed;
  for (const FixedView& view : problem.fixed) {
    const size_t body = view.sight.sight.body;
    if (problem.free.bodies[body] == 0 || std::ranges::count(placed, body) > 0) continue;
    const auto pose =
        body_pose(problem.sights->bodies[body], view.sight.sight, view.lens, view.values);
    if (!pose) continue;
    world_from_body[body] = view.world_from_camera * pose->camera_from_body;
    placed.push_back(body);
  }
  return placed;
}

}  // namespace

std::vector<Eigen::Vector2d> corner_errors(const HeadProblem& problem, const HeadView& view,
                                           size_t sight, const Eigen::Vector2d& error) {
  Eigen::Vector2d angles;
  if (!angles_of(view, problem.model.encoder, angles, nullptr)) return {};
  const BodySight& seen = view.setting->sights[sight];
  const std::vector<double> ones(seen.corners.size(), 1);
  SightLinearization at;
  if (!linearize(problem.sights->bodies[seen.body], seen, ones, problem.model.lens,
                 problem.model.lenses[view.lens].data(),
                 problem.model.world_from_camera(angles + error),
                 problem.model.world_from_body[seen.body], false, at)) {
    return {};
  }
  std::vector<Eigen::Vector2d> out;
  for (Eigen::Index i = 0; i < at.error.size(); i += 2) out.emplace_back(at.error.segment<2>(i));
  return out;
}

void fit(HeadProblem& problem, Outliers outliers, int rounds, double least_reading_sigma) {
  constexpr int kIterations = 12;  // a round more goes on from there
  for (int round = 0; round < rounds; ++round) {
    set_sigmas(problem);
    if (round > 0 || outliers != Outliers::kSoft) set_weights(problem, outliers);
    if (!adjust(problem, kIterations)) return;
    const HeadCovariance now = head_covariance(problem);
    if (now.matrix.size() == 0) return;
    // Steps of the noises are bounded: a first round may be far off.
    const auto step = [](double factor) { return std::sqrt(std::clamp(factor, 0.02, 50.0)); };
    const double corners = step(now.corners);
    const double moving = step(now.moving);
    const double readings = now.redundancy_readings > 1 ? step(now.readings) : 1;
    const double jitter = now.redundancy_jitter > 1 ? step(now.jitter) : 1;
    problem.sigma_px = std::max(kLeastPx, problem.sigma_px * corners);
    problem.moving_px = std::max(kLeastPx, problem.moving_px * moving);
    problem.reading_sigma = std::clamp(problem.reading_sigma * readings,
                                       std::max(1e-6, least_reading_sigma), kMostReading);
    problem.jitter_s = std::clamp(problem.jitter_s * jitter, kLeastJitter, 0.1);
    const double change = std::max({std::abs(corners - 1), std::abs(moving - 1) / 4,
                                    std::abs(readings - 1), std::abs(jitter - 1) / 4});
    if (round > 1 && change < 0.01) break;
  }
  set_sigmas(problem);
}

double rest_rms_px(const HeadProblem& problem) {
  double squares = 0, count = 0;
  for (const HeadView& view : problem.views) {
    if (view.moving() || !view.used) continue;
    for (size_t s = 0; s < view.weights.size(); ++s) {
      add_squares(corner_errors(problem, view, s, view.error), view.weights[s], squares, count);
    }
  }
  return std::sqrt(squares / std::max(1.0, count));
}

Result<std::string> tie_to_world(HeadProblem& problem,
                                 const std::vector<CalibratedCamera>& calibration,
                                 bool world_of_target) {
  const HeadSights& sights = *problem.sights;
  HeadModel& model = problem.model;
  std::vector<Rigid3> world_from_body(sights.bodies.size());
  std::vector<size_t> tied;
  std::string words;
  for (size_t b = 0; b < sights.bodies.size() && !world_of_target; ++b) {
    if (!sights.bodies[b].world_from_body || problem.free.bodies[b] == 0) continue;
    world_from_body[b] = *sights.bodies[b].world_from_body;
    problem.free.bodies[b] = 0;
    tied.push_back(b);
  }
  if (!tied.empty()) {
    words = fmt::format("the known place of {}", names_of(problem, tied));
  } else if (!world_of_target) {
    tied = place_by_cameras(problem, world_from_body);
    words = fmt::format("cameras that stand still and see {}", names_of(problem, tied));
  }
  if (tied.empty()) {
    if (!world_of_target && calibration.size() > 1) {
      return make_error(
          ErrorCode::kInvalidInput, head_place(sights),
          "nothing ties the head to the world of the other cameras: let one of them see the board "
          "while the head looks at it, or take the board's place as the world (--world target)");
    }
    const auto seen = std::ranges::find(problem.free.bodies, 1);
    tied.push_back(static_cast<size_t>(seen - problem.free.bodies.begin()));
    // Origin at the top-left corner, x along the print, z up out of it; as `calibrate world`.
    world_from_body[tied[0]] = Rigid3(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()) *
                               sights.bodies[tied[0]].parts[0].body_from_target.inverse();
    problem.free.bodies[tied[0]] = 0;
    problem.fixed.clear();
    words = fmt::format("the world is that of {}, its print up", names_of(problem, tied));
  }
  const Rigid3 world_from_base =
      world_from_body[tied[0]] * model.world_from_body[tied[0]].inverse();
  model.world_from_base = world_from_base;
  for (size_t b = 0; b < sights.bodies.size(); ++b) {
    model.world_from_body[b] = std::ranges::count(tied, b) > 0
                                   ? world_from_body[b]
                                   : Rigid3(world_from_base * model.world_from_body[b]);
  }
  return words;
}

}  // namespace sightline::calibrate
