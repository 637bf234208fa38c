// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/solved_axes.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibrate/axes/head_fit.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr const char* kLensNames[] = {"fx", "fy", "cx", "cy"};

Vector6 sigmas(const AxesSolution& s, int first) {
  return s.covariance.diagonal().segment<6>(first).cwiseMax(0).cwiseSqrt();
}

CameraAxes axes_of(const HeadInputs& inputs, const HeadProblem& problem,
                   const CalibratedCamera& prior, const AxesSolution& out) {
  const HeadModel& model = problem.model;
  CameraAxes axes = prior.axes.value_or(CameraAxes());
  axes.world_from_base = model.world_from_base;
  axes.pan_from_tilt = model.pan_from_tilt();
  axes.tilt_from_camera = model.tilt_from_camera;
  axes.pan_scale = model.encoder[0];
  axes.tilt_scale = model.encoder[1];
  axes.latency_s = model.encoder[kEncoderLatency];
  const double sigma = std::sqrt(std::max(0.0, out.covariance(kLatency, kLatency)));
  if (problem.free.encoder[kEncoderLatency]) {
    axes.latency_sigma_s = std::min(0.2, std::hypot(sigma, problem.jitter_s));
  }
  // One reading is as good as the mean over a rest, and its own scatter.
  Eigen::Vector2d scatter = Eigen::Vector2d::Zero();
  double count = 0;
  for (const HeadView& view : problem.views) {
    if (view.moving() || !view.used) continue;
    scatter += view.scatter.cwiseAbs2();
    ++count;
  }
  const double scale = std::max(std::abs(axes.pan_scale), std::abs(axes.tilt_scale));
  const double own = scatter.maxCoeff() / std::max(1.0, count);
  axes.sigma = std::clamp(std::hypot(problem.reading_sigma / scale, std::sqrt(own)), 1e-5 * kDegree,
                          10 * kDegree);
  if (problem.free.encoder[2] || problem.free.encoder[3]) {
    axes.backlash = std::max(std::abs(out.pan_play), std::abs(out.tilt_play));
  }
  axes.zoom.clear();
  for (size_t z = 0; inputs.zooms.size() > 1 && z < inputs.zooms.size(); ++z) {
    const LensVector& lens = model.lenses[z];
    ZoomLens row{inputs.zooms[z], lens[0], lens[1], lens[2], lens[3], {}, 0};
    std::copy_n(lens.begin() + 4, 8, row.distortion.begin());
    row.sigma = std::hypot(out.lens_sigmas[z].fx, out.lens_sigmas[z].fy) / std::sqrt(2.0) / lens[0];
    axes.zoom.push_back(row);
  }
  return axes;
}

/// The lens in use: that of the zoom setting nearest to the one of before.
size_t lens_in_use(const HeadProblem& problem, const CalibratedCamera& prior) {
  const double fx = prior.model.parameters().fx;
  size_t best = 0;
  for (size_t l = 1; l < problem.model.lenses.size(); ++l) {
    const auto off = [&](size_t i) {
      return std::abs(std::log(std::max(1e-9, problem.model.lenses[i][0] / fx)));
    };
    if (off(l) < off(best)) best = l;
  }
  return best;
}

/// A play that is not there is not written.
void take_play(const HeadProblem& problem, AxesSolution& out) {
  const auto play = [&](int row) {
    const double value = problem.model.encoder[static_cast<size_t>(row - kPanScale)];
    const double sigma = std::sqrt(std::max(0.0, out.covariance(row, row)));
    return std::abs(value) > 3 * sigma ? value : 0.0;
  };
  if (problem.free.encoder[2]) out.pan_play = play(kPanPlay);
  if (problem.free.encoder[3]) out.tilt_play = play(kTiltPlay);
}

void add_lens_sigmas(const HeadProblem& problem, const HeadCovariance& at, AxesSolution& out) {
  for (size_t l = 0; l < at.layout.lens.size() && problem.free.lens; ++l) {
    const auto sigma = [&](size_t i) {
      const int column = at.layout.lens[l][i];
      return column < 0 ? 0 : std::sqrt(at.matrix(column, column));
    };
    ZoomLens row{0, sigma(0), sigma(1), sigma(2), sigma(3), {}, 0};
    for (size_t i = 0; i < 8; ++i) row.distortion[i] = sigma(4 + i);
    out.lens_sigmas.push_back(row);
  }
}

void add_estimates(const HeadInputs& inputs, const HeadProblem& problem, const HeldWords& held,
                   AxesSolution& out) {
  const HeadModel& m = problem.model;
  const auto sigma = [&](int row) { return std::sqrt(std::max(0.0, out.covariance(row, row))); };
  auto& list = out.estimates;
  // Directions and places have no one value: the file has them.
  const Vector6 base = sigmas(out, kBase), mount = sigmas(out, kMount);
  list.push_back({"direction of the pan axis", "deg", 0, base.head<2>().norm() / kDegree});
  list.push_back({"pan at a reading of zero", "deg", 0, base[2] / kDegree});
  list.push_back({"place of the base", "mm", 0, 1e3 * base.tail<3>().norm()});
  list.push_back(
      {"tilt axis from perpendicular", "deg", m.link[0] / kDegree, sigma(kTwist) / kDegree});
  list.push_back({"distance of the axes", "mm", 1e3 * m.link[1], 1e3 * sigma(kOffset)});
  list.push_back(
      {"turn of the camera on the tilt axis", "deg", 0, mount.head<3>().norm() / kDegree});
  list.push_back({"place of the camera on the tilt axis", "mm", 0, 1e3 * mount.tail<3>().norm()});
  list.push_back({"pan_scale", "", m.encoder[0], sigma(kPanScale), held.scales});
  list.push_back({"tilt_scale", "", m.encoder[1], sigma(kTiltScale), held.scales});
  list.push_back(
      {"play of pan", "deg", m.encoder[2] / kDegree, sigma(kPanPlay) / kDegree, held.pan_play});
  list.push_back(
      {"play of tilt", "deg", m.encoder[3] / kDegree, sigma(kTiltPlay) / kDegree, held.tilt_play});
  list.push_back({"latency", "ms", 1e3 * m.encoder[4], 1e3 * sigma(kLatency), held.latency});
  for (size_t l = 0; l < m.lenses.size(); ++l) {
    const std::string at =
        m.lenses.size() > 1 ? fmt::format(" at zoom {:g}", inputs.zooms[l]) : std::string();
    for (size_t i = 0; i < 4; ++i) {
      const double s[] = {out.lens_sigmas.empty() ? 0 : out.lens_sigmas[l].fx,
                          out.lens_sigmas.empty() ? 0 : out.lens_sigmas[l].fy,
                          out.lens_sigmas.empty() ? 0 : out.lens_sigmas[l].cx,
                          out.lens_sigmas.empty() ? 0 : out.lens_sigmas[l].cy};
      list.push_back({kLensNames[i] + at, "px", m.lenses[l][i], s[i], held.lens});
    }
  }
}

SolvedSetting solved_setting(const HeadInputs& inputs, const HeadProblem& problem,
                             const HeadView& view, AxesSolution& out) {
  SolvedSetting s;
  s.recording = inputs.sights.recordings[view.setting->recording].name;
  s.time_s = view.setting->from_s;
  s.moving = view.moving();
  s.used = view.used;
  s.zoom = view.zoom;
  s.images = view.setting->images;
  Eigen::Vector2d read = view.rest, rates = Eigen::Vector2d::Zero();
  if (view.moving()) {
    const auto at =
        view.times->readings.at(view.setting->from_s + problem.model.encoder[kEncoderLatency]);
    read = at ? at->angles : read;
    rates = at ? at->rates : rates;
  }
  s.pan_deg = read[0] / kDegree;
  s.tilt_deg = read[1] / kDegree;
  s.pan_rate_deg_s = rates[0] / kDegree;
  s.tilt_rate_deg_s = rates[1] / kDegree;
  for (int axis = 0; axis < 2; ++axis) s.angle_error_deg[axis] = view.error[axis] / kDegree;
  double squares = 0;
  for (size_t k = 0; k < view.weights.size(); ++k) {
    const auto errors = corner_errors(problem, view, k, view.error);
    for (size_t i = 0; i < errors.size(); ++i) {
      if (view.weights[k][i] == 0) {
        out.rejected += !view.moving();
        continue;
      }
      ++s.corners;
      squares += errors[i].squaredNorm();
      if (view.moving() || !view.used) continue;
      out.pixels.push_back(view.setting->sights[k].corners[i].pixel);
      out.errors.push_back(errors[i]);
    }
  }
  s.rms_px = std::sqrt(squares / std::max<double>(1, static_cast<double>(s.corners)));
  if (!view.moving() && view.used) out.corners += s.corners;
  if (!view.moving() && !view.used) ++out.settings_left_out;
  return s;
}

}  // namespace

namespace calibrate {

Result<AxesSolution> solution_of(const HeadInputs& inputs, const HeadProblem& problem,
                                 const CalibratedCamera& prior, const HeldWords& held) {
  const HeadCovariance at = head_covariance(problem);
  if (at.matrix.size() == 0) {
    return make_error(ErrorCode::kInvalidInput, head_place(inputs.sights),
                      "these settings do not determine its axes: more of them, both axes turned "
                      "farther, the target nearer");
  }
  AxesSolution out{.camera = prior, .covariance = {}};
  out.covariance.setZero();
  for (int row = 0; row < kAxesParameters; ++row) {
    for (int column = 0; column < kAxesParameters; ++column) {
      const int r = at.layout.axes[static_cast<size_t>(row)];
      const int c = at.layout.axes[static_cast<size_t>(column)];
      if (r >= 0 && c >= 0) out.covariance(row, column) = at.matrix(r, c);
    }
  }
  add_lens_sigmas(problem, at, out);
  take_play(problem, out);
  for (const HeadView& view : problem.views) {
    out.settings.push_back(solved_setting(inputs, problem, view, out));
  }
  out.camera.axes = axes_of(inputs, problem, prior, out);
  out.camera.rms_px = out.rms_px = rest_rms_px(problem);
  const size_t lens = lens_in_use(problem, prior);
  const CameraModel::Parameters& p = prior.model.parameters();
  SL_ASSIGN(
      out.camera.model,
      CameraModel::create(lens_parameters(p.lens, problem.model.lenses[lens], p.width, p.height),
                          head_place(inputs.sights)));
  out.camera.world_from_camera = out.camera.axes->world_from_camera(0, 0);
  out.world_from_body = problem.model.world_from_body;
  out.jitter_s = problem.jitter_s;
  out.reading_sigma = problem.reading_sigma;
  out.sigma_px = problem.sigma_px;
  out.lens_refined = problem.free.lens;
  add_estimates(inputs, problem, held, out);
  return out;
}

}  // namespace calibrate

Eigen::Vector2d AxesSolution::place_sigma(double pan, double tilt) const {
  const CameraAxes& axes = *camera.axes;
  const Eigen::Vector2d angles(axes.pan_scale * pan, axes.tilt_scale * tilt);
  const double twist = std::atan2(axes.pan_from_tilt.rotation_matrix()(0, 2),
                                  axes.pan_from_tilt.rotation_matrix()(0, 0));
  const HeadChain chain =
      chain_of(axes.world_from_base, {twist, axes.pan_from_tilt.translation.y()},
               axes.tilt_from_camera, angles);
  Eigen::Matrix<double, 6, kAxesParameters> j;
  j.setZero();
  j.middleCols<6>(kBase) = chain.by_base;
  j.middleCols<2>(kTwist) = chain.by_link;
  j.middleCols<6>(kMount).setIdentity();
  j.col(kPanScale) = chain.by_angles.col(0) * pan;
  j.col(kTiltScale) = chain.by_angles.col(1) * tilt;
  const Matrix6 place = j * covariance * j.transpose();
  const auto largest = [](const Eigen::Matrix3d& m) {
    return std::sqrt(
        std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues()[2]));
  };
  return {largest(place.topLeftCorner<3, 3>()), largest(place.bottomRightCorner<3, 3>())};
}

}  // namespace sightline
