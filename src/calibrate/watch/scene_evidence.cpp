// SPDX-License-Identifier: Apache-2.0
#include "calibrate/watch/scene_evidence.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

namespace sightline::calibrate {
namespace {

constexpr double kFloor = 0.00016;   // of what is found without a cause [rad] (0.009 deg)
constexpr double kParallax = 0.001;  // 2 mm to the side before a room 2 m away [rad]
constexpr double kRestored = 10;     // significance below which it stands where it should
constexpr size_t kFewestBuckets = 4;
constexpr size_t kRecent = 10;
constexpr int kUnfitLooks = 6;  // on end
constexpr Duration kTogether = std::chrono::seconds(60);
constexpr size_t kFewestTogether = 3;  // cameras of a rig

CalibrationWatchOptions with_floor(CalibrationWatchOptions options) {
  options.floor_rotation = kFloor;
  return options;
}

Correction of_look(const SceneLook& look) {
  Correction c;
  c.information.topLeftCorner<3, 3>() = look.covariance.ldlt().solve(Eigen::Matrix3d::Identity());
  c.vector = c.information.leftCols<3>() * look.turn;
  return c;
}

}  // namespace

SceneEvidence::SceneEvidence(const CalibrationWatchOptions& options)
    : options_(with_floor(options)), evidence_(options_) {}

void SceneEvidence::clear() {
  evidence_.clear();
  newest_ = SceneLook();
  bucket_end_ = Time::min();
  moved_ = drifts_ = since_start_ = unfit_ = false;
  confirmed_ = unfit_looks_ = fitting_looks_ = 0;
  since_ = flagged_ = Time();
}

bool SceneEvidence::enough() const { return evidence_.size() >= kFewestBuckets; }

SceneEvidence::Event SceneEvidence::add(const SceneLook& look) {
  const SceneLook before = std::exchange(newest_, look);
  if (look.kind == SceneLook::Kind::kUnfit) {
    fitting_looks_ = 0;
    if (unfit_) return look.looks_like != before.looks_like ? Event::kUnfit : Event::kNone;
    if (unfit_looks_++ == 0) since_ = look.time;
    if (unfit_looks_ < kUnfitLooks) return Event::kNone;
    unfit_ = true;
    moved_ = false;
    evidence_.clear();
    return Event::kUnfit;
  }
  unfit_looks_ = 0;
  if (unfit_) {
    if (++fitting_looks_ < kUnfitLooks) return Event::kNone;
    clear();
    return Event::kFits;
  }
  evidence_.add(look.time, of_look(look), Rigid3());
  if (bucket_end_ == Time::min() || look.time < bucket_end_ - 2 * options_.bucket) {
    bucket_end_ = look.time + options_.bucket;
    return Event::kNone;
  }
  if (look.time < bucket_end_) return Event::kNone;
  bucket_end_ = look.time + options_.bucket;
  evidence_.close();
  return moved_ ? judge_moved() : judge();
}

SceneEvidence::Event SceneEvidence::judge() {
  if (!enough()) return Event::kBucket;
  const CourseFit course = evidence_.fit_course();
  if (course.now.significance < options_.significance) {
    confirmed_ = 0;
    return Event::kBucket;
  }
  if (++confirmed_ < options_.confirm_buckets) return Event::kBucket;
  confirmed_ = 0;
  moved_ = true;
  drifts_ = course.ramp;
  since_ = evidence_.begin(course.from);
  since_start_ = course.from == 0 && !course.ramp;
  flagged_ = newest_.time;
  // The bucket of the knock itself is of both places.
  if (!drifts_ && course.from > 0) {
    evidence_.forget_before(std::max<size_t>(2, evidence_.size() - course.from - 1));
  }
  return Event::kMoved;
}

SceneEvidence::Event SceneEvidence::judge_moved() {
  if (evidence_.size() < kRecent) return Event::kBucket;
  const CorrectionFit recent = evidence_.fit_newest(kRecent);
  if (recent.significance < kRestored && evidence_.begin(evidence_.size() - kRecent) >= flagged_) {
    moved_ = drifts_ = since_start_ = false;
    evidence_.forget_before(kRecent);
    return Event::kBack;
  }
  if (drifts_) return Event::kBucket;
  const CorrectionFit all = evidence_.fit_newest(evidence_.size());
  const Vector6 change = recent.correction - all.correction;
  if (change.dot((recent.covariance + all.covariance).ldlt().solve(change)) >
      options_.significance) {
    evidence_.forget_before(kRecent);  // knocked again
  }
  return Event::kBucket;
}

CorrectionFit SceneEvidence::correction(Vector6& rate) const {
  CorrectionFit fit;
  if (drifts_) {
    const CourseFit course = evidence_.fit_course();
    fit = course.now;
    rate = course.rate;
  } else {
    fit = evidence_.fit_newest(evidence_.size());
    rate.setZero();
  }
  fit.covariance.topLeftCorner<3, 3>().diagonal().array() += kParallax * kParallax;
  return fit;
}

bool ChangedTogether::has(size_t camera, Time now) const {
  return changed_[camera] && now - *changed_[camera] < kTogether;
}

bool ChangedTogether::are_most(std::span<const SceneEvidence> scenes, Time now) const {
  size_t changed = 0, watched = 0;
  for (size_t i = 0; i < scenes.size(); ++i) {
    changed += has(i, now) ? 1 : 0;
    watched += scenes[i].newest().time != Time() ? 1 : 0;
  }
  return watched >= kFewestTogether && 2 * changed > watched;
}

}  // namespace sightline::calibrate
