// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/solve_axes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibrate/axes/head_fit.hpp"
#include "calibrate/axes/head_start.hpp"
#include "calibrate/axes/moved_body.hpp"
#include "calibrate/axes/solved_axes.hpp"
#include "sightline/calibrate/calibration_file.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kGuessedLatency = 0.15;  // in the middle of what is usual
constexpr double kLatencyKnown = 0.01;    // [s], one sigma
constexpr double kSlack = 0.04;           // [s] at either end of a rest
constexpr size_t kLeastFromEachSide = 3;  // settings, for play
constexpr int kRounds = 8;

bool hold(const AxesOptions& options) { return options.scales == AxesScales::kHold; }

/// Of a step's uniform distribution.
double rounding_sigma(const HeadInputs& inputs) {
  return inputs.step < 0.5 * kDegree ? inputs.step / std::sqrt(12.0) : 0;
}

HeadProblem make_problem(const HeadInputs& inputs, const std::vector<CalibratedCamera>& calibration,
                         const CalibratedCamera& camera, const AxesOptions& options) {
  HeadProblem problem;
  problem.sights = &inputs.sights;
  problem.model.lens = camera.model.parameters().lens;
  problem.views = make_views(inputs, kGuessedLatency, 0);
  std::erase_if(problem.views, [](const HeadView& view) { return view.moving(); });
  for (size_t z = 0; z < inputs.zooms.size(); ++z) {
    LensVector lens = lens_vector(camera.model);
    if (options.zoom) {
      std::vector<const HeadSetting*> settings;
      for (const HeadView& view : problem.views) {
        if (view.lens == z) settings.push_back(view.setting);
      }
      lens = start_lens(inputs.sights, settings, problem.model.lens, lens);
    }
    problem.model.lenses.push_back(lens);
  }
  problem.lens_start = problem.model.lenses;
  for (LensVector& lens : problem.lens_start) lens = lens_vector(camera.model);
  problem.free.lens = options.zoom || options.refine_lens;
  problem.free.encoder[0] = problem.free.encoder[1] = !hold(options);
  for (const FixedSight& sight : inputs.fixed) {
    const CalibratedCamera* fixed =
        find_camera(calibration, inputs.sights.cameras[sight.camera].name);
    problem.fixed.push_back({sight, fixed->model.parameters().lens, lens_vector(fixed->model),
                             fixed->world_from_camera,
                             std::vector<double>(sight.sight.corners.size(), 1)});
  }
  return problem;
}

/// The same problem with the readings taken at another latency: settings whose readings rest anew,
/// those in motion beside them.
void take_views(const HeadInputs& inputs, HeadProblem& problem, bool moving) {
  std::vector<HeadView> before = std::move(problem.views);
  problem.views = make_views(inputs, problem.model.encoder[kEncoderLatency], kSlack);
  if (!moving) std::erase_if(problem.views, [](const HeadView& view) { return view.moving(); });
  for (HeadView& view : problem.views) {
    const auto old = std::ranges::find(before, view.setting, &HeadView::setting);
    if (old != before.end()) view.error = old->error;
  }
}

/// Play shows where places are reached from both sides.
void free_play(HeadProblem& problem, HeldWords& held) {
  for (int axis = 0; axis < 2; ++axis) {
    const auto a = static_cast<size_t>(axis);
    size_t from_below = 0, from_above = 0;
    for (const HeadView& view : problem.views) {
      if (view.moving() || !view.used) continue;
      from_below += view.sides[a] > 0;
      from_above += view.sides[a] < 0;
    }
    const bool known = std::min(from_below, from_above) >= kLeastFromEachSide;
    problem.free.encoder[2 + a] = known;
    if (known) continue;
    (axis == 0 ? held.pan_play : held.tilt_play) =
        fmt::format("{} settings were reached from below and {} from above: {} of each are needed",
                    from_below, from_above, kLeastFromEachSide);
  }
}

double latency_sigma(const HeadProblem& problem) {
  const HeadCovariance at = head_covariance(problem);
  const int column = at.layout.axes[kLatency];
  return at.matrix.size() > 0 && column >= 0 ? std::sqrt(at.matrix(column, column)) : 1e9;
}

/// Latency by the images in motion; held where these do not say it.
Status find_latency(const HeadInputs& inputs, double rounding, double held_value,
                    HeadProblem& problem, LatencyCurve& curve, HeldWords& held) {
  problem.model.encoder[kEncoderLatency] = kGuessedLatency;
  take_views(inputs, problem, true);
  const auto moving =
      std::ranges::count_if(problem.views, [](const HeadView& view) { return view.moving(); });
  const auto start = start_latency(problem, curve);
  double sigma = 1e9;
  if (start) {
    for (int pass = 0; pass < 2; ++pass) {
      if (pass == 0) problem.model.encoder[kEncoderLatency] = *start;
      take_views(inputs, problem, true);
      problem.free.encoder[kEncoderLatency] = true;
      free_play(problem, held);
      fit(problem, Outliers::kSoft, kRounds, rounding);
    }
    sigma = latency_sigma(problem);
  }
  const double found = problem.model.encoder[kEncoderLatency];
  if (sigma < kLatencyKnown && found < -0.002 - 3 * sigma) {
    return make_error(
        ErrorCode::kInvalidInput, head_place(inputs.sights),
        "its readings come {:.1f} ms before the pictures that they belong to: give the "
        "camera time_offset_s = {:.4f} in the calibration, and calibrate again",
        -1e3 * found, found);
  }
  if (sigma < kLatencyKnown && found >= 0 && found <= kMostLatency) return {};
  problem.free.encoder[kEncoderLatency] = false;
  problem.model.encoder[kEncoderLatency] =
      sigma < kLatencyKnown ? std::clamp(found, 0.0, kMostLatency) : held_value;
  if (sigma >= kLatencyKnown) {
    held.latency = fmt::format(
        "{} images of the head in motion do not say it: turn to and fro for ten seconds while the "
        "target is in view",
        moving);
  } else {
    held.latency = fmt::format("found {:.1f} ms, as good as none", 1e3 * found);
  }
  take_views(inputs, problem, sigma < kLatencyKnown);
  free_play(problem, held);
  fit(problem, Outliers::kSoft, kRounds, rounding);
  return {};
}

/// Scales that may be 1 are, where the lens is solved for as well.
void settle_scales(double rounding, HeadProblem& problem, HeldWords& held) {
  constexpr double kSigmas = 3, kKnown = 0.03;
  if (!problem.free.lens) return;
  const HeadCovariance at = head_covariance(problem);
  if (at.matrix.size() == 0) return;
  for (const int axis : {0, 1}) {
    const int column = at.layout.axes[static_cast<size_t>(kPanScale + axis)];
    const double sigma = std::sqrt(at.matrix(column, column));
    const double off = std::abs(std::abs(problem.model.encoder[static_cast<size_t>(axis)]) - 1);
    if (off > kSigmas * sigma || sigma > kKnown) return;
  }
  for (const size_t axis : {size_t{0}, size_t{1}}) {
    problem.free.encoder[axis] = false;
    problem.model.encoder[axis] = std::copysign(1.0, problem.model.encoder[axis]);
  }
  held.scales = "may be 1, and is held there: the lens is solved for (--scales free)";
  fit(problem, Outliers::kSoft, kRounds, rounding);
}

/// What no noise explains.
Status check_fit(const HeadInputs& inputs, const HeadProblem& problem, const AxesOptions& options,
                 double rounding) {
  const double rms = rest_rms_px(problem), reading = problem.reading_sigma / kDegree;
  const auto out = std::ranges::count_if(problem.views,
                                         [](const HeadView& v) { return !v.moving() && !v.used; });
  const bool poor =
      rms > 0.7 || out > 0 || problem.reading_sigma > std::max(0.03 * kDegree, 3 * rounding);
  if (poor) SL_RETURN_IF_ERROR(check_moved_bodies(inputs, problem, hold(options)));
  if (rms < 5 && reading < 1) return {};
  return make_error(
      ErrorCode::kInvalidInput, head_place(inputs.sights),
      "two axes do not explain what it sees: corners are {:.1f} px off, angles {:.2f} "
      "degrees. Are the sizes in the target file those of the print, is the lens "
      "right (--lens refine), are the readings those of this head?",
      rms, reading);
}

}  // namespace

Result<AxesSolution> solve_axes(const HeadSights& sights,
                                const std::vector<CalibratedCamera>& calibration,
                                const AxesOptions& options) {
  SL_RETURN_IF_ERROR(check_sights(sights, calibration));
  const CalibratedCamera& camera = *find_camera(calibration, sights.cameras[0].name);
  SL_ASSIGN(const HeadInputs inputs, gather_inputs(sights, options));
  const double rounding = rounding_sigma(inputs);
  HeadProblem problem = make_problem(inputs, calibration, camera, options);
  problem.reading_sigma = std::max(problem.reading_sigma, rounding);
  SL_RETURN_IF_ERROR(start_from_nothing(problem, hold(options)));
  SL_ASSIGN(const std::string world, tie_to_world(problem, calibration, options.world_of_target));
  fit(problem, Outliers::kSoft, kRounds, rounding);
  HeldWords held;
  if (hold(options)) held.scales = "held as asked for: readings are degrees";
  if (!problem.free.lens) held.lens = "held as in the calibration";
  LatencyCurve curve;
  SL_RETURN_IF_ERROR(find_latency(inputs, rounding, camera.axes ? camera.axes->latency_s : 0,
                                  problem, curve, held));
  if (options.scales == AxesScales::kAuto) settle_scales(rounding, problem, held);
  fit(problem, Outliers::kLeftOut, kRounds, rounding);
  SL_RETURN_IF_ERROR(check_fit(inputs, problem, options, rounding));
  start_latency(problem, curve);  // the curve of the final model
  SL_ASSIGN(AxesSolution out, solution_of(inputs, problem, camera, held));
  out.world = world;
  out.latency = curve;
  add_held_out(problem, out);
  return out;
}

}  // namespace sightline
