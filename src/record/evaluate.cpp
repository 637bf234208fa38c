// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/evaluate.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <numbers>
#include <set>

namespace sightline {
namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

using Truth = std::vector<TruthRow>;  ///< of one object, by time

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
  return static_cast<size_t>(std::count_if(truth.begin(), truth.end(), [&](const TruthRow& row) {
    const auto near = std::lower_bound(claimed.begin(), claimed.end(), row.time - tolerance);
    return near != claimed.end() && *near <= row.time + tolerance;
  }));
}

// Compares the rows of one object with its truth.
class ObjectJudge {
 public:
  ObjectJudge(const std::string& name, const Truth& truth, const EvaluateOptions& options)
      : truth_(truth), options_(options) {
    const auto symmetry = options.symmetry.find(name);
    if (symmetry != options.symmetry.end()) symmetry_ = symmetry->second;
    const auto shape = options.shape.find(name);
    if (shape != options.shape.end()) shape_ = shape->second;
    out_.object = name;
    if (!shape_.symmetries.empty()) out_.up_to_symmetry.emplace();
  }

  void add(const PoseLogRow& row) {
    ++out_.rows;
    ++out_.state_rows[static_cast<size_t>(row.state)];
    const Duration gap = options_.keyframes ? Duration(0) : options_.max_truth_gap;
    const auto there = truth_at(truth_, row.time, gap);
    if (there) ++out_.judged;
    if (!row.world_from_object) return;
    claimed_.push_back(row.time);
    if (!there) {
      ++out_.outside_truth;
      return;
    }
    const PoseError error = pose_error(*there, *row.world_from_object, symmetry_, shape_);
    all_.add(error);
    by_state_[row.state].add(error);
    normalized_[row.state].add(error, row);
    count_within(row.time, within(error), out_.within, key_frames_within_);
    if (is_wrong_claim(error, row)) out_.wrong_claims.push_back(row.time);
    if (out_.up_to_symmetry) add_up_to_symmetry(*there, row);
  }

  ObjectEvaluation finish() {
    std::sort(claimed_.begin(), claimed_.end());
    out_.truth_times = truth_.size();
    const Duration tolerance = options_.keyframes ? Duration(0) : options_.coverage_tolerance;
    out_.covered = count_covered(truth_, claimed_, tolerance);
    if (options_.keyframes) {
      out_.judged = truth_.size();
      out_.within = key_frames_within_.size();
      if (out_.up_to_symmetry) out_.up_to_symmetry->within = key_frames_within_symmetric_.size();
    }
    out_.all = all_.summary();
    if (out_.up_to_symmetry) out_.up_to_symmetry->all = up_to_symmetry_.summary();
    for (auto& [state, errors] : by_state_) out_.by_state[state] = errors.summary();
    for (const auto& [state, errors] : normalized_) out_.normalized[state] = errors.summary();
    return std::move(out_);
  }

 private:
  bool within(const PoseError& error) const {
    return error.mm <= options_.success_translation_mm &&
           error.deg <= options_.success_rotation_deg;
  }

  // Several rows may be of one key frame (a row for each camera): that is judged by the last one.
  void count_within(Time time, bool is_within, size_t& rows, std::set<Time>& key_frames) const {
    if (is_within) {
      ++rows;
      key_frames.insert(time);
    } else {
      key_frames.erase(time);
    }
  }

  bool is_wrong_claim(const PoseError& error, const PoseLogRow& row) const {
    return row.state == TrackState::kTracking &&
           (error.mm > options_.wrong_translation_mm || error.deg > options_.wrong_rotation_deg);
  }

  void add_up_to_symmetry(const Rigid3& truth, const PoseLogRow& row) {
    PoseError best = pose_error(truth, *row.world_from_object, symmetry_, shape_);
    for (const Rigid3& rotation : shape_.symmetries) {
      const PoseError other =
          pose_error(truth * rotation, *row.world_from_object, symmetry_, shape_);
      if (other.deg < best.deg) best = other;
    }
    up_to_symmetry_.add(best);
    count_within(row.time, within(best), out_.up_to_symmetry->within, key_frames_within_symmetric_);
    if (is_wrong_claim(best, row)) ++out_.up_to_symmetry->wrong_claims;
  }

  const Truth& truth_;
  const EvaluateOptions& options_;
  SymmetryOption symmetry_;
  EvaluatedShape shape_;
  ObjectEvaluation out_;
  Errors all_, up_to_symmetry_;
  std::map<TrackState, Errors> by_state_;
  std::map<TrackState, Normalized> normalized_;
  std::vector<Time> claimed_;
  std::set<Time> key_frames_within_, key_frames_within_symmetric_;
};

using TruthByObject = std::map<std::string, Truth>;

ObjectEvaluation evaluate_object(const TruthByObject::value_type& object,
                                 const std::string& logged_as, std::span<const PoseLogRow> poses,
                                 const EvaluateOptions& options) {
  ObjectJudge judge(object.first, object.second, options);
  for (const PoseLogRow& row : poses) {
    if (row.object == logged_as) judge.add(row);
  }
  ObjectEvaluation out = judge.finish();
  out.logged_as = logged_as;
  return out;
}

// Of one group of objects that look the same: the order of the logged names with which most rows
// are within the limits; their own where that is as good. By dynamic programming over the sets of
// names that are given away (Held and Karp 1962), so that eight cost no more than a moment.
std::vector<size_t> best_order(const std::vector<std::vector<size_t>>& within) {
  const size_t count = within.size(), sets = size_t{1} << count;
  std::vector<size_t> most(sets, 0), last(sets, 0);
  for (size_t set = 1; set < sets; ++set) {
    const auto object = static_cast<size_t>(std::popcount(set)) - 1;
    bool first = true;
    // From its own name on: that is kept where others are as good.
    for (size_t k = 0; k < count; ++k) {
      const size_t name = (object + k) % count;
      if ((set >> name & 1) == 0) continue;
      const size_t sum = most[set ^ size_t{1} << name] + within[object][name];
      if (!first && sum <= most[set]) continue;
      first = false;
      most[set] = sum;
      last[set] = name;
    }
  }
  std::vector<size_t> order(count);
  for (size_t object = count, set = sets - 1; object-- > 0; set ^= size_t{1} << order[object]) {
    order[object] = last[set];
  }
  return order;
}

// The logged names of objects that look the same, by their own.
std::map<std::string, std::string> match_names(const TruthByObject& truth,
                                               std::span<const PoseLogRow> poses,
                                               const EvaluateOptions& options) {
  std::map<std::string, std::string> out;
  for (const std::vector<std::string>& group : options.alike) {
    std::vector<std::string> names;
    std::copy_if(group.begin(), group.end(), std::back_inserter(names),
                 [&](const std::string& name) { return truth.contains(name); });
    if (names.size() > EvaluateOptions::kMostAlike) continue;
    std::vector<std::vector<size_t>> within;
    for (const std::string& name : names) {
      within.emplace_back();
      for (const std::string& other : names) {
        within.back().push_back(evaluate_object(*truth.find(name), other, poses, options).within);
      }
    }
    const std::vector<size_t> order = best_order(within);
    for (size_t i = 0; i < names.size(); ++i) out[names[i]] = names[order[i]];
  }
  return out;
}

}  // namespace

std::optional<Rigid3> truth_at(std::span<const TruthRow> truth, Time time, Duration max_gap) {
  const auto after = std::lower_bound(truth.begin(), truth.end(), time,
                                      [](const TruthRow& row, Time t) { return row.time < t; });
  if (after == truth.end()) return std::nullopt;
  if (after->time == time) return after->world_from_object;
  if (after == truth.begin()) return std::nullopt;
  const TruthRow& a = *std::prev(after);
  const TruthRow& b = *after;
  if (b.time - a.time > max_gap) return std::nullopt;
  const double share = to_seconds(time - a.time) / to_seconds(b.time - a.time);
  const Vector6 step = difference(a.world_from_object, b.world_from_object);
  return a.world_from_object * Rigid3::exp(share * step);
}

double ObjectEvaluation::coverage() const {
  return truth_times == 0 ? 0.0 : static_cast<double>(covered) / static_cast<double>(truth_times);
}

double ObjectEvaluation::success() const {
  return judged == 0 ? 0.0 : static_cast<double>(within) / static_cast<double>(judged);
}

Rigid3 nearest_symmetric(const Rigid3& truth, const Rigid3& pose, const SymmetryOption& symmetry) {
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

PoseError pose_error(const Rigid3& truth, const Rigid3& pose, const SymmetryOption& symmetry,
                     const EvaluatedShape& shape) {
  return {1e3 * (truth * shape.center - pose * shape.center).norm(),
          kDegreesPerRadian * rotation_angle(nearest_symmetric(truth, pose, symmetry), pose)};
}

Evaluation evaluate(std::span<const TruthRow> truth, std::span<const PoseLogRow> poses,
                    const EvaluateOptions& options) {
  TruthByObject by_object;
  for (const auto& row : truth) by_object[row.object].push_back(row);
  Evaluation out;
  out.keyframes = options.keyframes;
  for (auto& [name, rows] : by_object) {
    std::stable_sort(rows.begin(), rows.end(),
                     [](const TruthRow& a, const TruthRow& b) { return a.time < b.time; });
  }
  const std::map<std::string, std::string> logged = match_names(by_object, poses, options);
  for (const auto& [name, rows] : by_object) {
    const auto other = logged.find(name);
    const std::string& logged_as = other == logged.end() ? name : other->second;
    out.objects.push_back(evaluate_object({name, rows}, logged_as, poses, options));
  }
  std::set<std::string> unknown;
  for (const auto& row : poses) {
    if (!by_object.contains(row.object)) unknown.insert(row.object);
  }
  out.without_truth.assign(unknown.begin(), unknown.end());
  return out;
}

}  // namespace sightline
