// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/evaluate.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace sightline {
namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

using Truth = std::vector<const TruthRow*>;  ///< of one object, by time

/// Truth at `time` on the geodesic of SE(3) between its neighbours; nothing outside.
std::optional<Rigid3> truth_at(const Truth& truth, Time time, Duration max_gap) {
  const auto after = std::lower_bound(truth.begin(), truth.end(), time,
                                      [](const TruthRow* row, Time t) { return row->time < t; });
  if (after == truth.end()) return std::nullopt;
  if ((*after)->time == time) return (*after)->world_from_object;
  if (after == truth.begin()) return std::nullopt;
  const TruthRow& a = **std::prev(after);
  const TruthRow& b = **after;
  if (b.time - a.time > max_gap) return std::nullopt;
  const double share = to_seconds(time - a.time) / to_seconds(b.time - a.time);
  const Vector6 step = difference(a.world_from_object, b.world_from_object);
  return a.world_from_object * Rigid3::exp(share * step);
}

/// Nearest rank: the smallest value that at least `share` of all are not above.
double percentile(const std::vector<double>& sorted, double share) {
  const double rank = std::ceil(share * static_cast<double>(sorted.size()));
  return sorted[static_cast<size_t>(std::max(rank, 1.0)) - 1];
}

double median(const std::vector<double>& sorted) {
  const size_t half = sorted.size() / 2;
  return sorted.size() % 2 ? sorted[half] : 0.5 * (sorted[half - 1] + sorted[half]);
}

struct Errors {
  std::vector<double> mm, deg;

  void add(const PoseError& error) {
    mm.push_back(error.mm);
    deg.push_back(error.deg);
  }
  ErrorSummary summary() {
    ErrorSummary out;
    out.count = mm.size();
    if (mm.empty()) return out;
    std::sort(mm.begin(), mm.end());
    std::sort(deg.begin(), deg.end());
    out.median_mm = median(mm);
    out.p95_mm = percentile(mm, 0.95);
    out.max_mm = mm.back();
    out.median_deg = median(deg);
    out.p95_deg = percentile(deg, 0.95);
    out.max_deg = deg.back();
    return out;
  }
};

struct Normalized {
  static constexpr double kBound = 2.8;  // 95 % of the length of three unit normals
  size_t count = 0, beyond = 0;
  double translation = 0, rotation = 0;

  void add(const PoseError& error, const PoseLogRow& row) {
    if (!(row.sigma_t_mm > 0 && row.sigma_r_deg > 0)) return;
    const double t = error.mm / row.sigma_t_mm, r = error.deg / row.sigma_r_deg;
    ++count;
    translation += t * t;
    rotation += r * r;
    if (t > kBound || r > kBound) ++beyond;
  }
  NormalizedError summary() const {
    const auto n = static_cast<double>(std::max<size_t>(count, 1));
    return {count, translation / n, rotation / n, static_cast<double>(beyond) / n};
  }
};

size_t count_covered(const Truth& truth, const std::vector<Time>& claimed, Duration tolerance) {
  return static_cast<size_t>(std::count_if(truth.begin(), truth.end(), [&](const TruthRow* row) {
    const auto near = std::lower_bound(claimed.begin(), claimed.end(), row->time - tolerance);
    return near != claimed.end() && *near <= row->time + tolerance;
  }));
}

ObjectEvaluation evaluate_object(const std::string& name, const Truth& truth,
                                 std::span<const PoseLogRow> poses,
                                 const EvaluateOptions& options) {
  const auto known = options.symmetry.find(name);
  const SymmetryOption symmetry =
      known == options.symmetry.end() ? SymmetryOption{} : known->second;
  ObjectEvaluation out;
  out.object = name;
  Errors all;
  std::map<TrackState, Errors> by_state;
  std::map<TrackState, Normalized> normalized;
  std::vector<Time> claimed;
  for (const PoseLogRow& row : poses) {
    if (row.object != name) continue;
    ++out.rows;
    ++out.state_rows[static_cast<size_t>(row.state)];
    const auto there = truth_at(truth, row.time, options.max_truth_gap);
    if (there) ++out.judged;
    if (!row.world_from_object) continue;
    claimed.push_back(row.time);
    if (!there) {
      ++out.outside_truth;
      continue;
    }
    const PoseError error = pose_error(*there, *row.world_from_object, symmetry);
    all.add(error);
    by_state[row.state].add(error);
    normalized[row.state].add(error, row);
    if (error.mm <= options.success_translation_mm && error.deg <= options.success_rotation_deg) {
      ++out.within;
    }
    const bool off =
        error.mm > options.wrong_translation_mm || error.deg > options.wrong_rotation_deg;
    if (off && row.state == TrackState::kTracking) out.wrong_claims.push_back(row.time);
  }
  std::sort(claimed.begin(), claimed.end());
  out.truth_times = truth.size();
  out.covered = count_covered(truth, claimed, options.coverage_tolerance);
  out.all = all.summary();
  for (auto& [state, errors] : by_state) out.by_state[state] = errors.summary();
  for (const auto& [state, errors] : normalized) out.normalized[state] = errors.summary();
  return out;
}

}  // namespace

double ObjectEvaluation::coverage() const {
  return truth_times == 0 ? 0.0 : static_cast<double>(covered) / static_cast<double>(truth_times);
}

double ObjectEvaluation::success() const {
  return judged == 0 ? 0.0 : static_cast<double>(within) / static_cast<double>(judged);
}

Rigid3 nearest_alike(const Rigid3& truth, const Rigid3& pose, const SymmetryOption& symmetry) {
  const Eigen::Vector3d axis = symmetry.axis.normalized();
  const auto turned = [&](double angle) {
    return Rigid3(truth.rotation * Eigen::AngleAxisd(angle, axis), truth.translation);
  };
  if (symmetry.kind == Symmetry::kAxis) {
    // The part of the difference that turns about the axis (swing-twist decomposition).
    const Eigen::Quaterniond between = truth.rotation.conjugate() * pose.rotation;
    return turned(2 * std::atan2(between.vec().dot(axis), between.w()));
  }
  Rigid3 nearest = truth;
  if (symmetry.kind != Symmetry::kDiscrete) return nearest;
  for (int turn = 1; turn < symmetry.order; ++turn) {
    const Rigid3 other = turned(2.0 * std::numbers::pi * turn / symmetry.order);
    if (rotation_angle(other, pose) < rotation_angle(nearest, pose)) nearest = other;
  }
  return nearest;
}

PoseError pose_error(const Rigid3& truth, const Rigid3& pose, const SymmetryOption& symmetry) {
  return {1e3 * translation_distance(truth, pose),
          kDegreesPerRadian * rotation_angle(nearest_alike(truth, pose, symmetry), pose)};
}

Evaluation evaluate(std::span<const TruthRow> truth, std::span<const PoseLogRow> poses,
                    const EvaluateOptions& options) {
  std::map<std::string, Truth> by_object;
  for (const auto& row : truth) by_object[row.object].push_back(&row);
  Evaluation out;
  for (auto& [name, rows] : by_object) {
    std::stable_sort(rows.begin(), rows.end(),
                     [](const TruthRow* a, const TruthRow* b) { return a->time < b->time; });
    out.objects.push_back(evaluate_object(name, rows, poses, options));
  }
  std::set<std::string> unknown;
  for (const auto& row : poses) {
    if (!by_object.contains(row.object)) unknown.insert(row.object);
  }
  out.without_truth.assign(unknown.begin(), unknown.end());
  return out;
}

}  // namespace sightline
