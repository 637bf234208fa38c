// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/follower.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

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
      tilt_(config.limits, 1) {}

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

std::optional<Follower::Goal> Follower::see(Time now, std::span<const PoseTrackPtr> tracks,
                                            std::span<const FollowTarget> targets) {
  const Time when = now + from_seconds(config_.limits.latency_s);
  for (const FollowTarget& target : targets) {
    const size_t index = target.object.index();
    if (index >= tracks.size() || !tracks[index] || tracks[index]->empty()) continue;
    auto goal = aim(when, *tracks[index], target);
    if (!goal) continue;
    // Velocities jitter by what is measured new: heads need not.
    const bool same = status_.object == target.object && now - goal_time_ < kGoalLasts;
    const double share = same ? std::min(to_seconds(now - goal_time_) / kSmooth, 1.0) : 1;
    goal->rates = last_goal_.rates + share * (goal->rates - last_goal_.rates);
    if (!same) goal->rates.setZero();
    last_goal_ = *goal;
    goal_time_ = now;
    status_.object = target.object;
    return goal;
  }
  return std::nullopt;
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

HeadAngles Follower::stopping_place(Time now) const {
  const Seen& seen = seen_.back();
  return {pan_.stopping_place(now, seen.stamp, seen.angles.x()),
          tilt_.stopping_place(now, seen.stamp, seen.angles.y())};
}

Follower::Goal Follower::decide(Time now, std::span<const PoseTrackPtr> tracks,
                                std::span<const FollowTarget> targets) {
  if (status_.mode == FollowMode::kHeld) {
    if (!held_) held_ = stopping_place(now);
    status_.object.reset();
    return {*held_, HeadAngles::Zero()};
  }
  if (const auto goal = see(now, tracks, targets)) {
    status_.mode = FollowMode::kFollowing;
    lost_ = Time{};
    return *goal;
  }
  if (lost_ == Time{} ||
      (status_.mode != FollowMode::kWaiting && status_.mode != FollowMode::kHome)) {
    lost_ = now;
    held_ = stopping_place(now);
  }
  status_.object.reset();
  if (now - lost_ >= config_.home_after) {
    status_.mode = FollowMode::kHome;
    return {config_.home, HeadAngles::Zero()};
  }
  status_.mode = FollowMode::kWaiting;
  return {*held_, HeadAngles::Zero()};
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
                                        std::span<const FollowTarget> targets) {
  // What is known of the present without going on from it: what readings say now was true then.
  const Time then = now - from_seconds(axes_.latency_s);
  const AxesAt at = history.at(then);
  const bool ended = status_.until != Time{} && now >= status_.until;
  if (ended) release();
  if (at.state != AxesState::kKnown && at.state != AxesState::kZoomed) {
    seen_.clear();
    const bool kept = status_.mode == FollowMode::kHeld;
    stop(now, kept ? FollowMode::kHeld : FollowMode::kBlind);
    return std::nullopt;
  }
  if (seen_.empty()) quiet_ = now + kWatched;
  status_.angles = {at.pan, at.tilt};
  if (seen_.empty() || then > seen_.back().stamp) seen_.push_back({then, status_.angles});
  while (then - seen_.front().stamp > 2 * kWatched) seen_.pop_front();
  if (status_.mode != FollowMode::kHeld && disturbed(now)) {
    if (status_.mode != FollowMode::kYielding) stop(now, FollowMode::kYielding);
    status_.until = now + config_.yield;
  }
  if (status_.mode == FollowMode::kYielding) return std::nullopt;
  return drive(now, decide(now, tracks, targets));
}

}  // namespace sightline
