// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/assess.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

#include "calibrate/report/projection_sigma.hpp"
#include "calibrate/report/rig_bundle.hpp"
#include "calibrate/report/split_half.hpp"
#include "calibrate/solve/stamps.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

/// Coverage, distances and tilts of what a camera saw.
void describe_views(const CalibrationViews& views, const RigSolution& solution, size_t c,
                    CameraReport& out) {
  constexpr int kColumns = 10, kRows = 8;
  std::set<int> cells;
  std::vector<double> distances;
  std::vector<Eigen::Vector3d> normals;
  double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
  const CalibratedCamera& camera = solution.cameras[c].camera;
  const Rigid3 camera_from_world = camera.world_from_camera.inverse();
  for (size_t v = 0; v < views.views.size(); ++v) {
    const TargetView& view = views.views[v];
    if (view.camera != c || !solution.world_from_target[view.set]) continue;
    const Rigid3 pose = camera_from_world * *solution.world_from_target[view.set];
    normals.push_back(pose.rotation * Eigen::Vector3d::UnitZ());
    for (size_t i = 0; i < view.corners.size(); ++i) {
      if (!solution.used[v][i]) continue;
      const Eigen::Vector2d& p = view.corners[i].pixel;
      cells.insert(std::clamp(static_cast<int>((p.y() + 0.5) / camera.model.height() * kRows), 0,
                              kRows - 1) *
                       kColumns +
                   std::clamp(static_cast<int>((p.x() + 0.5) / camera.model.width() * kColumns), 0,
                              kColumns - 1));
      const Eigen::Vector2d at = views.target.corner(view.corners[i].id);
      const double distance = (pose * Eigen::Vector3d(at.x(), at.y(), 0)).norm();
      distances.push_back(distance);
      nearest = std::min(nearest, distance);
      farthest = std::max(farthest, distance);
    }
  }
  if (distances.empty()) return;
  std::nth_element(distances.begin(),
                   distances.begin() + static_cast<ptrdiff_t>(distances.size() / 2),
                   distances.end());
  out.working_distance = distances[distances.size() / 2];
  out.coverage = static_cast<double>(cells.size()) / (kColumns * kRows);
  out.depth_ratio = farthest / nearest;
  out.nearest = nearest;
  out.farthest = farthest;
  double least = 1;
  for (const auto& a : normals) {
    for (const auto& b : normals) least = std::min(least, a.dot(b));
  }
  out.tilt_deg = std::acos(std::clamp(least, -1.0, 1.0)) * kDegrees;
}

std::vector<LinkReport> find_links(const CalibrationViews& views, const RigSolution& solution) {
  std::map<std::pair<size_t, size_t>, size_t> shared;
  std::vector<std::vector<size_t>> by_set(views.sets);
  for (size_t v = 0; v < views.views.size(); ++v) {
    if (std::count(solution.used[v].begin(), solution.used[v].end(), 1) == 0) continue;
    by_set[views.views[v].set].push_back(views.views[v].camera);
  }
  for (const auto& cameras : by_set) {
    for (const size_t a : cameras) {
      for (const size_t b : cameras) {
        if (a < b) ++shared[{a, b}];
      }
    }
  }
  std::vector<LinkReport> links;
  for (const auto& [pair, sets] : shared) links.push_back({pair.first, pair.second, sets});
  return links;
}

/// The strongest tree of links (Kruskal, 1956), its weakest first.
std::vector<size_t> find_weakest(const std::vector<LinkReport>& links, size_t cameras) {
  std::vector<size_t> order(links.size()), group(cameras), tree;
  std::iota(order.begin(), order.end(), size_t{0});
  std::iota(group.begin(), group.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t x, size_t y) { return links[x].sets > links[y].sets; });
  for (const size_t i : order) {
    const size_t a = group[links[i].a], b = group[links[i].b];
    if (a == b) continue;
    std::replace(group.begin(), group.end(), b, a);
    tree.push_back(i);
  }
  std::reverse(tree.begin(), tree.end());
  return tree;
}

/// What one camera's figures mean, and what to do about them.
void judge(const SolvedCamera& solved, CameraReport& r) {
  const double f = solved.camera.model.parameters().fx;
  const double mm_per_px = 1e3 * r.working_distance / f;
  const auto lower = [&](CalibrationGrade grade, std::string remark) {
    r.grade = std::max(r.grade, grade);
    r.remarks.push_back(std::move(remark));
  };
  const double reached_px =
      std::max({r.held_out_px.value_or(0), r.split_half ? r.split_half->median_px : 0.0,
                r.sigma ? r.sigma->center : 0.0});
  if (r.held_out_px && *r.held_out_px > 3 * solved.camera.rms_px && *r.held_out_px > 0.5) {
    lower(CalibrationGrade::kUsable,
          fmt::format("predicts views it was not fitted to {:.1f} times worse than those it was: "
                      "more poses, or fewer free parameters (a known lens)",
                      *r.held_out_px / solved.camera.rms_px));
  }
  if (r.split_half && r.split_half->center_mm > 1e3 * 0.01 * r.working_distance) {
    lower(
        CalibrationGrade::kNotGood,
        fmt::format("its place depends on which half of the views is used: {:.1f} mm, {:.2f} deg; "
                    "more poses shared with its neighbors",
                    r.split_half->center_mm, r.split_half->rotation_deg));
  }
  if (r.sigma && r.sigma->worst > 2) {
    lower(CalibrationGrade::kUsable,
          fmt::format("the lens is not determined at the edge of the image (one sigma {:.1f} px "
                      "there): bring the target into the corners",
                      r.sigma->worst));
  }
  if (!solved.lens_known && r.coverage < 0.5) {
    lower(CalibrationGrade::kUsable,
          fmt::format("corners cover {:.0f} % of the image: show the target where it has not been",
                      100 * r.coverage));
  }
  if (!solved.lens_known && r.depth_ratio < 1.5) {
    lower(CalibrationGrade::kUsable,
          fmt::format("distances differ by a factor of {:.2f} only: nearer and farther views (2)",
                      r.depth_ratio));
  }
  if (reached_px > 3) {
    lower(CalibrationGrade::kNotGood,
          fmt::format("errors of several pixels ({:.1f}): is the target flat, do the cameras take "
                      "their images at the same time (--time-offsets)?",
                      reached_px));
  }
  const char* const word = r.grade == CalibrationGrade::kGood ? "good" : "usable";
  r.remarks.insert(r.remarks.begin(),
                   r.grade == CalibrationGrade::kNotGood
                       ? fmt::format("not good: {:.2f} px, {:.1f} mm at {:.2f} m", reached_px,
                                     reached_px * mm_per_px, r.working_distance)
                       : fmt::format("{} for {:.2f} mm at {:.2f} m ({:.2f} px)", word,
                                     reached_px * mm_per_px, r.working_distance, reached_px));
}

/// Both halves solved, compared and each predicted from the other. What fails is left out.
void add_halves(const CalibrationViews& views, const SolveOptions& options,
                const RigSolution& solution, RigReport& out) {
  std::vector<char> even_sets, odd_sets;
  const CalibrationViews even = half_of(views, solution, false, even_sets);
  const CalibrationViews odd = half_of(views, solution, true, odd_sets);
  const auto a = resolve_rig(even, options, solution);
  const auto b = resolve_rig(odd, options, solution);
  if (!a || !b) return;
  const std::vector<SplitHalf> halves = compare(views, solution, *a, *b);
  // Each half on the sets of the other. What is wrong in the whole solution is left out here, too.
  RigSolution from_a = *a, from_b = *b;
  from_a.used = from_b.used = solution.used;
  from_a.world_from_target = from_b.world_from_target = solution.world_from_target;
  const HeldOut on_odd = held_out_error(views, from_a, odd_sets);
  const HeldOut on_even = held_out_error(views, from_b, even_sets);
  const auto both = [](const std::optional<double>& x, const std::optional<double>& y) {
    if (!x || !y) return x ? x : y;
    return std::optional<double>(std::sqrt((*x * *x + *y * *y) / 2));
  };
  for (size_t c = 0; c < out.cameras.size(); ++c) {
    out.cameras[c].split_half = halves[c];
    out.cameras[c].held_out_px = both(on_odd.by_camera[c], on_even.by_camera[c]);
  }
  out.held_out_px = both(on_odd.all, on_even.all);
}

}  // namespace

std::string to_string(CalibrationGrade grade) {
  switch (grade) {
    case CalibrationGrade::kGood:
      return "good";
    case CalibrationGrade::kUsable:
      return "usable";
    case CalibrationGrade::kNotGood:
      return "not good";
  }
  return "?";
}

Result<RigReport> assess_rig(const CalibrationViews& views, const SolveOptions& options,
                             const RigSolution& solution) {
  RigReport out;
  const Bundle rig = rig_bundle(views, solution);
  std::vector<CalibratedCamera> cameras;
  for (size_t c = 0; c < views.cameras.size(); ++c) {
    const SolvedCamera& solved = solution.cameras[c];
    CameraReport camera;
    camera.name = views.cameras[c].name;
    describe_views(views, solution, c, camera);
    camera.sigma = projection_sigma(views, rig, solution, c, camera.working_distance);
    camera.sigma_near = projection_sigma(views, rig, solution, c, camera.nearest);
    camera.sigma_far = projection_sigma(views, rig, solution, c, camera.farthest);
    const Matrix6 place = solved.place_covariance();
    camera.place_sigma_deg = std::sqrt(place.diagonal().head<3>().maxCoeff()) * kDegrees;
    camera.place_sigma_mm = 1e3 * std::sqrt(place.diagonal().tail<3>().maxCoeff());
    cameras.push_back(solved.camera);
    out.cameras.push_back(std::move(camera));
  }
  out.links = find_links(views, solution);
  out.weakest = find_weakest(out.links, views.cameras.size());
  CalibrationViews used = views;
  for (size_t v = 0; v < used.views.size(); ++v) {
    std::vector<TargetCorner> corners;
    for (size_t i = 0; i < solution.used[v].size(); ++i) {
      if (solution.used[v][i]) corners.push_back(views.views[v].corners[i]);
    }
    used.views[v].corners = std::move(corners);
  }
  out.rigidity = rigidity(used, cameras);
  add_halves(views, options, solution, out);
  const std::vector<std::string> rolling = readout_remarks(views, options, solution);
  for (size_t c = 0; c < out.cameras.size(); ++c) {
    judge(solution.cameras[c], out.cameras[c]);
    if (!rolling[c].empty()) out.cameras[c].remarks.push_back(rolling[c]);
    out.grade = std::max(out.grade, out.cameras[c].grade);
  }
  return out;
}

Result<SolvedRig> solve_and_assess(const CalibrationViews& views, const SolveOptions& options) {
  SL_ASSIGN(RigSolution solution, solve_rig(views, options));
  SL_ASSIGN(RigReport report, assess_rig(views, options, solution));
  return SolvedRig{std::move(solution), std::move(report)};
}

}  // namespace sightline
