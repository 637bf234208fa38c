// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calibrate/calibration_reader.hpp"
#include "calibrate/report/rig_bundle.hpp"
#include "calibrate/solve/bundle.hpp"
#include "calibrate/solve/chain.hpp"
#include "calibrate/solve/covariance.hpp"
#include "calibrate/solve/refusals.hpp"
#include "calibrate/solve/stamps.hpp"
#include "calibrate/solve/target_pose.hpp"
#include "sightline/calibrate/solve.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr std::array kPinholeNames = {
    "fx",       "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "time_offset_s",
    "readout_s"};
constexpr std::array kFisheyeNames = {
    "fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4", "", "", "", "", "time_offset_s", "readout_s"};

CameraPrior prior_of(const SolveOptions& options, size_t camera) {
  return options.cameras.empty() ? CameraPrior{} : options.cameras[camera];
}

void free_lens(BundleCamera& camera) {
  for (int i = 0; i < 4 + coefficient_count(camera.lens); ++i) {
    camera.free[static_cast<size_t>(i)] = true;
  }
}

Bundle empty_bundle(const CalibrationViews& views, const SolveOptions& options) {
  Bundle bundle;
  bundle.target = &views.target;
  bundle.world_from_target.resize(views.sets);
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    const CameraPrior prior = prior_of(options, c);
    BundleCamera camera;
    camera.lens = prior.known ? prior.known->parameters().lens : prior.lens;
    camera.height = views.cameras[c].height;
    if (prior.known) camera.values = lens_vector(*prior.known);
    if (!prior.known) free_lens(camera);
    camera.values[kReadout] = prior.readout_s;
    camera.place_free = c != options.reference;
    bundle.cameras.push_back(camera);
  }
  for (const TargetView& view : views.views) {
    const bool enough = view.corners.size() >= options.min_corners;
    bundle.views.push_back({&view, view.camera, view.set,
                            std::vector<char>(view.corners.size(), enough ? char{1} : char{0})});
  }
  return bundle;
}

/// One camera's lens from its own views, the camera at the origin.
Status solve_alone(const CalibrationViews& views, const SolveOptions& options, size_t camera,
                   BundleCamera& out) {
  const ViewedCamera& seen = views.cameras[camera];
  std::vector<const TargetView*> own;
  for (const TargetView& view : views.views) {
    if (view.camera == camera && view.corners.size() >= options.min_corners) own.push_back(&view);
  }
  const auto start = initial_lens(views.target, out.lens, seen.width, seen.height, own);
  if (!start) {
    return make_error(ErrorCode::kInvalidInput, camera_place(views, camera),
                      "the corners do not fit a flat {}: is the size in squares right?",
                      views.target.describe());
  }
  Bundle alone;
  alone.target = &views.target;
  alone.cameras.push_back(out);
  BundleCamera& solved = alone.cameras.front();
  solved.values = *start;
  solved.values[kReadout] = out.values[kReadout];
  solved.place_free = false;
  for (const TargetView* view : own) {
    const auto pose =
        target_pose(views.target, Eigen::Vector2d::Zero(), solved.lens, *start, *view);
    if (!pose) continue;
    alone.views.push_back(
        {view, 0, alone.world_from_target.size(), std::vector<char>(view->corners.size(), 1)});
    alone.world_from_target.push_back(pose->camera_from_target);
  }
  BundleOptions bundle_options;
  bundle_options.huber_px = 2;  // a start must survive a few corners that are wrong
  bundle_options.max_iterations = 60;
  const BundleSummary summary = adjust(alone, bundle_options);
  out.values = solved.values;
  return check_camera(views, camera, alone, summary.rms_px);
}

/// Leaves out what is farther off than so many robust standard deviations of its camera.
size_t reject(Bundle& bundle, double sigmas) {
  std::vector<std::vector<double>> norms(bundle.cameras.size());
  std::vector<std::vector<double>> by_view(bundle.views.size());
  for (size_t v = 0; v < bundle.views.size(); ++v) {
    const BundleView& view = bundle.views[v];
    for (size_t i = 0; i < view.used.size(); ++i) {
      const auto error = corner_error(bundle, view, i);
      by_view[v].push_back(error ? error->norm() : std::numeric_limits<double>::infinity());
      if (view.used[i]) norms[view.camera].push_back(by_view[v].back());
    }
  }
  size_t rejected = 0;
  for (size_t v = 0; v < bundle.views.size(); ++v) {
    BundleView& view = bundle.views[v];
    std::vector<double>& all = norms[view.camera];
    if (all.empty()) continue;
    const auto middle = all.begin() + static_cast<ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    // The median of the length of a two-dimensional normal error is 1.1774 sigma.
    const double limit = std::max(0.05, sigmas * *middle / 1.1774);
    for (size_t i = 0; i < view.used.size(); ++i) {
      if (view.used[i] && by_view[v][i] > limit) {
        view.used[i] = 0;
        ++rejected;
      }
    }
    if (static_cast<size_t>(std::count(view.used.begin(), view.used.end(), 1)) < 4) {
      std::fill(view.used.begin(), view.used.end(), char{0});
    }
  }
  return rejected;
}

void fill_camera(const CalibrationViews& views, const Bundle& bundle,
                 const RigCovariance& covariance, size_t c, SolvedCamera& out) {
  const BundleCamera& camera = bundle.cameras[c];
  const CovarianceLayout::Camera& layout = covariance.layout.cameras[c];
  out.lens_known = !camera.free[0];
  out.time_offset_s = camera.values[kTimeOffset];
  out.lens_columns = layout.parameters;
  out.has_place = layout.place >= 0;
  const auto lenses = static_cast<Eigen::Index>(layout.parameters.size());
  std::vector<int> rows;
  for (Eigen::Index i = 0; i < lenses; ++i) rows.push_back(layout.lens + static_cast<int>(i));
  for (int i = 0; out.has_place && i < 6; ++i) rows.push_back(layout.place + i);
  const auto size = static_cast<Eigen::Index>(rows.size());
  out.covariance.resize(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < size; ++j) {
      out.covariance(i, j) =
          covariance.matrix(rows[static_cast<size_t>(i)], rows[static_cast<size_t>(j)]);
    }
  }
  const auto& names = camera.lens == LensModel::kFisheye ? kFisheyeNames : kPinholeNames;
  for (Eigen::Index i = 0; i < lenses; ++i) {
    const auto parameter = static_cast<size_t>(layout.parameters[static_cast<size_t>(i)]);
    out.estimates.push_back(
        {names[parameter], camera.values[parameter], std::sqrt(out.covariance(i, i))});
  }
  double sum = 0;
  for (const BundleView& view : bundle.views) {
    if (view.camera != c) continue;
    const auto used = static_cast<size_t>(std::count(view.used.begin(), view.used.end(), 1));
    out.views += used > 0;
    out.corners += used;
    for (size_t i = 0; i < view.used.size(); ++i) {
      if (!view.used[i]) continue;
      sum += corner_error(bundle, view, i).value_or(Eigen::Vector2d(1e3, 1e3)).squaredNorm();
    }
  }
  out.camera.name = views.cameras[c].name;
  out.camera.world_from_camera = camera.world_from_camera;
  out.camera.time_offset_s = camera.values[kTimeOffset];
  out.camera.readout_s = camera.values[kReadout];
  out.camera.rms_px = std::sqrt(sum / static_cast<double>(std::max<size_t>(1, out.corners)));
}

/// No sensor takes so long: nothing in the views tells.
Status check_readout(const CalibrationViews& views, size_t camera, double readout_s) {
  if (std::abs(readout_s) <= kLargestReadout) return {};
  return make_error(
      ErrorCode::kInvalidInput, camera_place(views, camera),
      "its read-out comes out at {:.0f} ms, which no sensor has: the target moves too "
      "little before it, or its images are too far apart in time (--readouts)",
      1e3 * readout_s);
}

Result<RigSolution> to_solution(const CalibrationViews& views, const SolveOptions& options,
                                const Bundle& bundle, const BundleSummary& summary) {
  const RigCovariance covariance = rig_covariance(bundle);
  if (covariance.singular) {
    return make_error(
        ErrorCode::kInvalidInput, "",
        "the views do not determine all that is solved for (lenses, places{}{}{}): more "
        "poses of the target are needed, near and far, tilted, all over the images, "
        "seen by cameras together",
        options.bend ? ", bend" : "", options.time_offsets ? ", time offsets" : "",
        options.readouts ? ", read-outs: for these in motion" : "");
  }
  RigSolution out;
  out.rms_px = summary.rms_px;
  out.sigma_px = covariance.sigma_px;
  out.iterations = summary.iterations;
  out.bend = bundle.bend;
  if (bundle.bend_free) {
    const auto b = static_cast<Eigen::Index>(covariance.layout.bend);
    out.bend_sigma = covariance.matrix.diagonal().segment<2>(b).cwiseSqrt();
  }
  out.corners = bundle.corner_count();
  out.world_from_target.resize(views.sets);
  for (const BundleView& view : bundle.views) {
    out.used.push_back(view.used);
    if (std::count(view.used.begin(), view.used.end(), 1) > 0) {
      out.world_from_target[view.set] = bundle.world_from_target[view.set];
    }
  }
  for (size_t c = 0; c < bundle.cameras.size(); ++c) {
    const BundleCamera& camera = bundle.cameras[c];
    SL_RETURN_IF_ERROR(check_readout(views, c, camera.values[kReadout]));
    const ViewedCamera& seen = views.cameras[c];
    SL_ASSIGN(CameraModel model, CameraModel::create(lens_parameters(camera.lens, camera.values,
                                                                     seen.width, seen.height),
                                                     camera_place(views, c)));
    SolvedCamera solved{.camera = {"", model, Rigid3(), 0}};
    fill_camera(views, bundle, covariance, c, solved);
    for (const TargetView& view : views.views) {
      if (view.camera == c && view.corners.size() >= options.min_corners) {
        solved.rejected += view.corners.size();
      }
    }
    solved.rejected -= solved.corners;
    out.rejected += solved.rejected;
    out.cameras.push_back(std::move(solved));
  }
  return out;
}

Result<RigSolution> finish(const CalibrationViews& views, const SolveOptions& options,
                           Bundle& bundle) {
  BundleOptions bundle_options;
  bundle_options.huber_px = options.huber_px;
  bundle_options.threads = options.threads;
  bundle.bend_free = options.bend;
  for (size_t c = 0; options.time_offsets && c < bundle.cameras.size(); ++c) {
    bundle.cameras[c].free[kTimeOffset] = c != options.reference;
  }
  for (BundleCamera& camera : bundle.cameras) camera.free[kReadout] = options.readouts;
  BundleSummary summary = adjust(bundle, bundle_options);
  for (int round = 0; round < 3 && options.reject_sigmas > 0; ++round) {
    if (reject(bundle, options.reject_sigmas) == 0) break;
    const int before = summary.iterations;
    summary = adjust(bundle, bundle_options);
    summary.iterations += before;
  }
  return to_solution(views, options, bundle, summary);
}

}  // namespace

Matrix6 SolvedCamera::place_covariance() const {
  if (!has_place) return Matrix6::Zero();
  return covariance.bottomRightCorner<6, 6>();
}

Result<RigSolution> solve_rig(const CalibrationViews& views, const SolveOptions& options) {
  SL_RETURN_IF_ERROR(check_inputs(views, options));
  if (!options.cameras.empty()) SL_RETURN_IF_ERROR(check_exchanged(views, options));
  Bundle bundle = empty_bundle(views, options);
  for (size_t c = 0; c < bundle.cameras.size(); ++c) {
    if (prior_of(options, c).known) continue;
    SL_RETURN_IF_ERROR(solve_alone(views, options, c, bundle.cameras[c]));
  }
  std::vector<std::optional<TargetPose>> poses;
  for (BundleView& view : bundle.views) {
    const BundleCamera& camera = bundle.cameras[view.camera];
    poses.emplace_back();
    if (view.view->corners.size() >= options.min_corners) {
      poses.back() = target_pose(views.target, bundle.bend, camera.lens, camera.values, *view.view);
    }
    if (!poses.back()) std::fill(view.used.begin(), view.used.end(), char{0});
  }
  place_cameras(bundle, poses, options.reference);
  // First with a robust loss, so that single wrong views cannot pull the chain out of shape.
  BundleOptions rough;
  rough.huber_px = 2;
  rough.max_iterations = 30;
  rough.threads = options.threads;
  const int first = adjust(bundle, rough).iterations;
  auto solution = finish(views, options, bundle);
  if (!solution) return solution;
  SL_RETURN_IF_ERROR(check_stamps(views, options, *solution));
  solution->iterations += first;
  return solution;
}

Result<RigSolution> resolve_rig(const CalibrationViews& views, const SolveOptions& options,
                                const RigSolution& start) {
  SL_RETURN_IF_ERROR(check_views(views));
  Bundle bundle = empty_bundle(views, options);
  SL_CHECK(start.cameras.size() == bundle.cameras.size(), "a solution of the same cameras");
  for (size_t c = 0; c < bundle.cameras.size(); ++c) {
    BundleCamera& camera = bundle.cameras[c];
    if (camera.free[0]) camera.values = lens_vector(start.cameras[c].camera.model);
    camera.values[kTimeOffset] = start.cameras[c].time_offset_s;
    camera.values[kReadout] = start.cameras[c].camera.readout_s;
    camera.world_from_camera = start.cameras[c].camera.world_from_camera;
  }
  bundle.bend = start.bend;
  for (BundleView& view : bundle.views) {
    if (!start.world_from_target[view.set]) {
      std::fill(view.used.begin(), view.used.end(), char{0});
    } else {
      bundle.world_from_target[view.set] = *start.world_from_target[view.set];
    }
  }
  return finish(views, options, bundle);
}

std::vector<std::vector<Eigen::Vector2d>> corner_errors(const CalibrationViews& views,
                                                        const RigSolution& solution) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Bundle bundle = rig_bundle(views, solution);
  std::vector<std::vector<Eigen::Vector2d>> errors;
  for (const TargetView& view : views.views) {
    const BundleView as_bundle{&view, view.camera, view.set, {}};
    std::vector<Eigen::Vector2d> row;
    for (size_t i = 0; i < view.corners.size(); ++i) {
      const auto error = solution.world_from_target[view.set] ? corner_error(bundle, as_bundle, i)
                                                              : std::optional<Eigen::Vector2d>();
      row.push_back(error.value_or(Eigen::Vector2d(kNan, kNan)));
    }
    errors.push_back(std::move(row));
  }
  return errors;
}

}  // namespace sightline
