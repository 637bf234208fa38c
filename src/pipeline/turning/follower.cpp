// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/follower.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sightline/pipeline/turning/scan_places.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kSlope = 0.1;    // [s], over which the target's rate is taken
constexpr double kSmooth = 0.15;  // [s], over which it is smoothed
constexpr Duration kGoalLasts = 500ms;
// A turn that nobody here ordered: over this time it goes by so much further than any order that
// may be in force says. An order's latency is known badly, and heads have their own idea of rates.
constexpr Duration kWatched = 500ms, kDisturbedFor = 120ms;
constexpr double kOwnIdea = 3 * kDegree, kOwnShare = 0.25;
constexpr double kReach = 2 * kDegree;  // beyond the range, of what is followed already
// Looking around: time at a place, in which searches find what it shows; it is there when so near;
// a head that does not come there is not waited for.
constexpr Duration kLook = 800ms, kLate = 3s;
constexpr double kThere = 1 * kDegree;
constexpr double kSamePlace = 0.02 * kDegree;

Eigen::Vector3d middle_ray(const CameraModel& model) {
  const auto ray = model.unproject({(model.width() - 1) / 2.0, (model.height() - 1) / 2.0});
  return ray.value_or(Eigen::Vector3d::UnitZ());
}

}  // namespace

std::string_view to_string(FollowMode mode) {
  switch (mode) {
    case FollowMode::kBlind:
      return "blind";
    case FollowMode::kFollowing:
      return "following";
    case FollowMode::kWaiting:
      return "waiting";
    case FollowMode::kScanning:
      return "scanning";
    case FollowMode::kHome:
      return "home";
    case FollowMode::kHeld:
      return "held";
    case FollowMode::kYielding:
      return "yielding";
  }
  return "";
}

Follower::Follower(const FollowConfig& config, const CalibratedCamera& camera)
    : config_(config),
      axes_(camera.axes.value_or(CameraAxes{})),
      ray_(middle_ray(camera.model)),
      pan_(config.limits, 0),
      tilt_(config.limits, 1),
      view_(view_angles(camera.model)) {}

void Follower::hold(const std::optional<HeadAngles>& place, Time until) {
  held_ = place;
  status_.until = until;
  status_.mode = FollowMode::kHeld;
}

void Follower::release() {
  if (status_.mode != FollowMode::kHeld && status_.mode != FollowMode::kYielding) return;
  status_.until = Time{};
  status_.mode = FollowMode::kWaiting;
  disturbed_ = Time{};
}

// Where it has to look at `when`, and how fast that changes.
std::optional<Follower::Goal> Follower::aim(Time when, const PoseTrack& track,
                                            const FollowTarget& target) {
  const PoseAt now = track.at(when);
  if (now.source == PoseSource::kNone || !has_pose(now.estimate.state)) return std::nullopt;
  const auto place = [&](const PoseEstimate& at) {
    return at.world_from_object * target.center_in_object;
  };
  const auto angles = aim_head(axes_, place(now.estimate), ray_, status_.angles);
  if (!angles) return std::nullopt;
  const PoseEstimate later =
      predict(now.estimate, now.estimate.time + from_seconds(kSlope), track.noise());
  const auto ahead = aim_head(axes_, place(later), ray_, *angles);
  if (!ahead) return std::nullopt;
  return Goal{*angles, (*ahead - *angles) / kSlope};
}

std::optional<Follower::Goal> Follower::see(Time now, const Scene& scene) {
  const Time when = now + from_seconds(config_.limits.latency_s);
  std::vector<std::optional<Goal>> goals(scene.targets.size());
  for (size_t i = 0; i < goals.size(); ++i) {
    const size_t index = scene.targets[i].object.index();
    if (index >= scene.tracks.size() || !scene.tracks[index] || scene.tracks[index]->empty()) {
      continue;
    }
    goals[i] = aim(when, *scene.tracks[index], scene.targets[i]);
    if (goals[i] && !scene.shared) break;
  }
  const auto chosen = choose(now, scene, goals);
  if (!chosen) return std::nullopt;
  for (size_t i = 0; i < goals.size(); ++i) {
    if (goals[i] && scene.targets[i].object == *chosen) return smoothed(now, *chosen, *goals[i]);
  }
  return std::nullopt;
}

// Of those that can be seen.
std::optional<ObjectId> Follower::choose(Time now, const Scene& scene,
                                         std::span<const std::optional<Goal>> goals) const {
  const HeadLimits& limits = config_.limits;
  std::vector<FollowBid> bids;
  for (size_t i = 0; i < goals.size(); ++i) {
    if (!goals[i]) continue;
    const ObjectId object = scene.targets[i].object;
    if (!scene.shared) return object;
    const double slack = status_.object == object ? kReach : 0;
    const auto angles = goals[i]->angles.array();
    const bool within = (angles >= limits.low.array() - slack).all() &&
                        (angles <= limits.high.array() + slack).all();
    bids.push_back(
        {object, static_cast<int>(i), (goals[i]->angles - status_.angles).norm(), within});
  }
  if (!scene.shared) return std::nullopt;
  return scene.shared->sharing.choose(scene.shared->number, now, bids);
}

// Velocities jitter by what is measured new: heads need not.
Follower::Goal Follower::smoothed(Time now, ObjectId object, Goal goal) {
  const bool same = status_.object == object && now - goal_time_ < kGoalLasts;
  const double share = same ? std::min(to_seconds(now - goal_time_) / kSmooth, 1.0) : 1;
  goal.rates = last_goal_.rates + share * (goal.rates - last_goal_.rates);
  if (!same) goal.rates.setZero();
  last_goal_ = goal;
  goal_time_ = now;
  status_.object = object;
  return goal;
}

// Somebody else moves it: in half a second it went further than all that may be in force.
bool Follower::disturbed(Time now) {
  if (seen_.size() < 2 || now < quiet_) return false;
  const Seen& last = seen_.back();
  auto first = seen_.begin();
  while (last.stamp - std::next(first)->stamp >= kWatched) ++first;
  if (last.stamp - first->stamp < kWatched * 4 / 5) return false;
  const HeadAngles went = last.angles - first->angles;
  bool foreign = false;
  for (int axis = 0; axis < 2; ++axis) {
    const AxisDrive& drive = axis == 0 ? pan_ : tilt_;
    double low = 1e9, high = -1e9;
    const double latest = 2 * config_.limits.latency_s + 0.25;
    for (double late = 0; late <= latest; late += 0.05) {
      const Duration shift = from_seconds(late);
      const double turn = drive.ordered(first->stamp - shift, last.stamp - shift);
      low = std::min(low, turn);
      high = std::max(high, turn);
    }
    const double free = kOwnIdea + kOwnShare * std::max(std::abs(low), std::abs(high));
    foreign = foreign || went[axis] < low - free || went[axis] > high + free;
  }
  if (!foreign) {
    disturbed_ = Time{};
    return false;
  }
  if (disturbed_ == Time{}) disturbed_ = now;
  return now - disturbed_ >= kDisturbedFor;
}

void Follower::stop(Time now, FollowMode mode) {
  pan_.rest(now);
  tilt_.rest(now);
  resting_ = false;
  status_.mode = mode;
  status_.object.reset();
  status_.error.setZero();
}

// Others have the head: what it lost before is not looked for afterwards.
void Follower::forget() {
  lost_ = Time{};
  scan_due_ = false;
  scan_.clear();
}

HeadAngles Follower::stopping_place(Time now) const {
  const Seen& seen = seen_.back();
  return {pan_.stopping_place(now, seen.stamp, seen.angles.x()),
          tilt_.stopping_place(now, seen.stamp, seen.angles.y())};
}

Follower::Goal Follower::decide(Time now, const Scene& scene) {
  if (status_.mode == FollowMode::kHeld) {
    if (!held_) held_ = stopping_place(now);
    status_.object.reset();
    return {*held_, HeadAngles::Zero()};
  }
  if (const auto goal = see(now, scene)) {
    status_.mode = FollowMode::kFollowing;
    lost_ = Time{};
    scan_due_ = true;
    scan_.clear();
    return *goal;
  }
  const FollowMode before = status_.mode;
  const bool on_its_own = before == FollowMode::kWaiting || before == FollowMode::kScanning ||
                          before == FollowMode::kHome;
  if (lost_ == Time{} || !on_its_own) {
    lost_ = now;
    held_ = stopping_place(now);
  }
  status_.object.reset();
  if (now - lost_ < config_.home_after) {
    status_.mode = FollowMode::kWaiting;
    return {*held_, HeadAngles::Zero()};
  }
  if (const auto goal = scan(now)) {
    status_.mode = FollowMode::kScanning;
    return *goal;
  }
  status_.mode = FollowMode::kHome;
  return {config_.home, HeadAngles::Zero()};
}

// From place to place, while there are some and its time lasts.
std::optional<Follower::Goal> Follower::scan(Time now) {
  if (!scan_due_ || now - lost_ >= config_.home_after + config_.scan) {
    scan_due_ = false;
    return std::nullopt;
  }
  const HeadLimits& limits = config_.limits;
  const auto go_on = [&] {
    const HeadAngles way = (scan_.back() - status_.angles).cwiseAbs();
    scan_there_ = Time{};
    scan_next_ = now + kLate + from_seconds(way.maxCoeff() / limits.max_rate);
  };
  if (scan_.empty()) {
    scan_ = scan_places(last_goal_.angles, view_, limits);
    std::ranges::reverse(scan_);
    go_on();
  }
  const double off = (scan_.back() - status_.angles).cwiseAbs().maxCoeff();
  if (scan_there_ == Time{} && off < kThere + limits.dead_zone) scan_there_ = now;
  const bool looked = scan_there_ != Time{} && now - scan_there_ >= kLook;
  if (looked || now >= scan_next_) {
    scan_.pop_back();
    scan_due_ = !scan_.empty();
    if (!scan_due_) return std::nullopt;
    go_on();
  }
  return Goal{scan_.back(), HeadAngles::Zero()};
}

std::optional<HeadOrder> Follower::drive(Time now, const Goal& goal) {
  const Seen& seen = seen_.back();
  const auto pan = pan_.step(now, seen.stamp, seen.angles.x(), goal.angles.x(), goal.rates.x());
  const auto tilt = tilt_.step(now, seen.stamp, seen.angles.y(), goal.angles.y(), goal.rates.y());
  status_.error = goal.angles - seen.angles;
  const HeadOrder order{{pan.place, tilt.place}, {pan.rate, tilt.rate}};
  const bool rests = pan.rate == 0 && tilt.rate == 0;
  // Whoever stands is told so once.
  const bool told = rests && resting_ && (order.place - sent_.place).norm() < kSamePlace;
  resting_ = rests;
  if (told) return std::nullopt;
  sent_ = order;
  return order;
}

std::optional<HeadOrder> Follower::step(Time now, const AxisHistory& history,
                                        std::span<const PoseTrackPtr> tracks,
                                        std::span<const FollowTarget> targets,
                                        const std::optional<SharedHead>& shared) {
  // What is known of the present without going on from it: what readings say now was true then.
  const Time then = now - from_seconds(axes_.latency_s);
  const AxesAt at = history.at(then);
  const bool ended = status_.until != Time{} && now >= status_.until;
  if (ended) release();
  const bool blind = at.state != AxesState::kKnown && at.state != AxesState::kZoomed;
  if (blind) {
    seen_.clear();
    const bool kept = status_.mode == FollowMode::kHeld;
    stop(now, kept ? FollowMode::kHeld : FollowMode::kBlind);
  } else {
    if (seen_.empty()) quiet_ = now + kWatched;
    status_.angles = {at.pan, at.tilt};
    if (seen_.empty() || then > seen_.back().stamp) seen_.push_back({then, status_.angles});
    while (then - seen_.front().stamp > 2 * kWatched) seen_.pop_front();
    if (status_.mode != FollowMode::kHeld && disturbed(now)) {
      if (status_.mode != FollowMode::kYielding) stop(now, FollowMode::kYielding);
      status_.until = now + config_.yield;
    }
  }
  const bool taken = status_.mode == FollowMode::kHeld || status_.mode == FollowMode::kYielding;
  if (taken) forget();
  if ((taken || blind) && shared) shared->sharing.leave(shared->number);
  if (blind || status_.mode == FollowMode::kYielding) return std::nullopt;
  return drive(now, decide(now, {tracks, targets, shared}));
}

}  // namespace sightline
