// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/check_rig.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "calibrate/report/rig_bundle.hpp"
#include "calibrate/solve/chain.hpp"
#include "calibrate/solve/target_pose.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kChiSquare = 22.46;  // 6 degrees of freedom, p = 0.001
constexpr double kLeastTurn = 2e-4;   // [rad]; less is not called a move
constexpr double kLeastShift = 2e-4;  // of the distance to the target
constexpr double kExchanged = 3;      // error as it is over error with two cameras exchanged

Result<std::vector<CalibratedCamera>> in_force(const CalibrationViews& views,
                                               const std::vector<CalibratedCamera>& calibration) {
  std::vector<CalibratedCamera> cameras;
  for (const ViewedCamera& seen : views.cameras) {
    const auto found = std::find_if(calibration.begin(), calibration.end(),
                                    [&](const CalibratedCamera& c) { return c.name == seen.name; });
    if (found == calibration.end()) {
      return make_error(ErrorCode::kInvalidInput, "camera " + seen.name,
                        "is not in the calibration in force");
    }
    cameras.push_back(*found);
  }
  return cameras;
}

/// The calibration in force as a solution: the target in each set where one camera sees it best.
RigSolution as_solution(const CalibrationViews& views, const std::vector<CalibratedCamera>& cameras,
                        size_t min_corners) {
  RigSolution out;
  for (const CalibratedCamera& camera : cameras) {
    SolvedCamera solved{.camera = camera};
    solved.lens_known = true;
    out.cameras.push_back(std::move(solved));
  }
  out.world_from_target.resize(views.sets);
  std::vector<size_t> best(views.sets, 0);
  for (const TargetView& view : views.views) {
    const bool enough = view.corners.size() >= min_corners;
    out.used.emplace_back(view.corners.size(), enough ? char{1} : char{0});
    if (!enough || view.corners.size() <= best[view.set]) continue;
    const CalibratedCamera& camera = cameras[view.camera];
    const auto pose = target_pose(views.target, Eigen::Vector2d::Zero(),
                                  camera.model.parameters().lens, lens_vector(camera.model), view);
    if (!pose) continue;
    best[view.set] = view.corners.size();
    out.world_from_target[view.set] = camera.world_from_camera * pose->camera_from_target;
  }
  return out;
}

/// Two cameras whose exchange explains the views far better than the calibration as it is.
Status check_exchanged(const CalibrationViews& views, const std::vector<CalibratedCamera>& cameras,
                       size_t min_corners, double error_px) {
  const std::vector<char> all(views.sets, 1);
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      if (cameras[a].model.width() != cameras[b].model.width() ||
          cameras[a].model.height() != cameras[b].model.height()) {
        continue;
      }
      std::vector<CalibratedCamera> exchanged = cameras;
      std::swap(exchanged[a].model, exchanged[b].model);
      std::swap(exchanged[a].world_from_camera, exchanged[b].world_from_camera);
      const HeldOut held = held_out_error(views, as_solution(views, exchanged, min_corners), all);
      if (!held.all || kExchanged * *held.all > error_px) continue;
      return make_error(ErrorCode::kInvalidInput, "camera " + cameras[a].name,
                        "{} and {} are exchanged: with the calibrations of the two exchanged the "
                        "error is {:.2f} px instead of {:.2f} px; check names and plugs",
                        cameras[a].name, cameras[b].name, *held.all, error_px);
    }
  }
  return {};
}

/// Where camera `c` is now in the frame it was calibrated in, if camera `anchor` has not moved.
Rigid3 drift_of(const std::vector<CalibratedCamera>& old, const RigSolution& now, size_t anchor,
                size_t c) {
  const Rigid3 before = old[anchor].world_from_camera.inverse() * old[c].world_from_camera;
  const Rigid3 after = now.cameras[anchor].camera.world_from_camera.inverse() *
                       now.cameras[c].camera.world_from_camera;
  return before.inverse() * after;
}

/// The camera with which most others agree.
size_t find_anchor(const std::vector<CalibratedCamera>& old, const RigSolution& now,
                   double distance) {
  size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t a = 0; a < old.size(); ++a) {
    std::vector<double> sizes;
    for (size_t c = 0; c < old.size(); ++c) {
      if (c == a) continue;
      const Vector6 d = drift_of(old, now, a, c).log();
      sizes.push_back(d.head<3>().norm() + d.tail<3>().norm() / distance);
    }
    if (sizes.empty()) return 0;
    std::nth_element(sizes.begin(), sizes.begin() + static_cast<ptrdiff_t>(sizes.size() / 2),
                     sizes.end());
    if (sizes[sizes.size() / 2] < least) {
      least = sizes[sizes.size() / 2];
      best = a;
    }
  }
  return best;
}

void describe(CameraDrift& out, double distance) {
  const auto along = [](const Eigen::Vector3d& v, const Eigen::Matrix3d& covariance) {
    const Eigen::Vector3d unit = v.norm() > 0 ? v.normalized() : Eigen::Vector3d::UnitX();
    return std::sqrt(unit.dot(covariance * unit));
  };
  const Eigen::Vector3d turn = out.drift.head<3>(), shift = out.drift.tail<3>();
  out.rotation_deg = turn.norm() * kDegrees;
  out.rotation_sigma_deg = along(turn, out.covariance.topLeftCorner<3, 3>()) * kDegrees;
  out.shift_mm = 1e3 * shift.norm();
  out.shift_sigma_mm = 1e3 * along(shift, out.covariance.bottomRightCorner<3, 3>());
  const double chi_square = out.drift.dot(out.covariance.ldlt().solve(out.drift));
  out.moved = chi_square > kChiSquare &&
              (turn.norm() > kLeastTurn || shift.norm() > kLeastShift * distance);
  out.words = fmt::format("{}turned {:.3f} deg +- {:.3f}, shifted {:.2f} mm +- {:.2f}",
                          out.moved ? "" : "in place: ", out.rotation_deg, out.rotation_sigma_deg,
                          out.shift_mm, out.shift_sigma_mm);
}

double median_distance(const CalibrationViews& views, const RigSolution& solution) {
  std::vector<double> distances;
  for (const TargetView& view : views.views) {
    if (!solution.world_from_target[view.set]) continue;
    distances.push_back(
        translation_distance(*solution.world_from_target[view.set],
                             solution.cameras[view.camera].camera.world_from_camera));
  }
  if (distances.empty()) return 1;
  const auto middle = distances.begin() + static_cast<ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace

Result<RigCheck> check_rig(const CalibrationViews& views,
                           const std::vector<CalibratedCamera>& calibration,
                           const SolveOptions& wanted) {
  SL_RETURN_IF_ERROR(check_views(views));
  SL_ASSIGN(const std::vector<CalibratedCamera> old, in_force(views, calibration));
  SolveOptions options = wanted;
  options.cameras.clear();
  for (const CalibratedCamera& camera : old) {
    options.cameras.push_back({camera.model.parameters().lens, camera.model, camera.readout_s});
  }
  RigCheck out;
  const RigSolution before = as_solution(views, old, options.min_corners);
  const HeldOut held = held_out_error(views, before, std::vector<char>(views.sets, 1));
  out.held_out_px = held.all;
  // Nothing to suspect below: as good as webcams with a hand-held board are.
  if (held.all && *held.all > 3) {
    SL_RETURN_IF_ERROR(check_exchanged(views, old, options.min_corners, *held.all));
  }
  SL_ASSIGN(RigSolution now, solve_rig(views, options));
  const double distance = median_distance(views, now);
  options.reference = find_anchor(old, now, distance);
  SL_ASSIGN(now, solve_rig(views, options));
  std::vector<CalibratedCamera> timed = old;  // by its stamps of today
  out.in_order = true;
  for (size_t c = 0; c < old.size(); ++c) {
    CameraDrift camera;
    camera.name = old[c].name;
    camera.held_out_px = held.by_camera[c];
    camera.anchor = c == options.reference;
    const Rigid3 drift = drift_of(old, now, options.reference, c);
    camera.drift = drift.log();
    camera.covariance = now.cameras[c].place_covariance();
    if (camera.anchor) {
      camera.words = "the others are measured against it";
    } else {
      describe(camera, distance);
    }
    out.in_order = out.in_order && !camera.moved;
    CalibratedCamera today = old[c];
    today.world_from_camera = old[c].world_from_camera * drift;
    out.now.push_back(std::move(today));
    timed[c].time_offset_s = now.cameras[c].time_offset_s;
    out.cameras.push_back(std::move(camera));
  }
  out.rigidity = rigidity(views, timed);
  return out;
}

}  // namespace sightline
