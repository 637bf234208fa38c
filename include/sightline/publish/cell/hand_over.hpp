// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "sightline/base/time.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// What a cell has of an object: the less certain, the less it is worth.
struct EstimateWorth {
  TrackState state = TrackState::kSearching;
  /// Largest standard deviation of the pose, alternatives included [m]: a rotation counts at a
  /// distance of 0.1 m. 0: no pose.
  double sigma = 0;
};
EstimateWorth worth_of(const PoseEstimate& estimate);
/// Seen now: `tracking` or `degraded`.
constexpr bool is_measured(TrackState state) {
  return state == TrackState::kTracking || state == TrackState::kDegraded;
}

/// What a cell says of an object to its neighbors: what it has, and whether it keeps it. A cell
/// that keeps it publishes the estimates of frames captured after `from` until `until`; the greater
/// `term` is in force.
struct Holding {
  EstimateWorth worth;
  bool holds = false;
  uint64_t term = 0;
  Time from{};
  std::string next;  ///< cell that is to go on after `until`; empty: none
  Time until = Time::max();
};

/// Which of several cells that see one object publishes it: one at each capture time, without a gap
/// where the object goes from one cell to the next. Each cell has one of these per object and hears
/// the others'. Who keeps the object gives it to a neighbor whose estimate is surer by kMargin for
/// kPatience, or that sees it while the keeper does not: it names the neighbor and a capture time,
/// a moment ahead if it sees the object itself, the neighbor takes it from there on, and where no
/// answer comes soon, the keeper goes on. A keeper that is not heard for kSilence is followed by
/// whoever has a pose, from the last frame on that was heard of. Of two that keep it (the network
/// was cut) the later one goes on. Passive, no clock of its own: `now` is CLOCK_MONOTONIC, as are
/// capture times. One thread at a time.
class HandOver {
 public:
  /// `cell`: this one's name.
  explicit HandOver(std::string cell) : cell_(std::move(cell)) {}

  /// What a neighbor says.
  void hear(const std::string& cell, const Holding& said, Time now);
  /// An estimate of a neighbor that keeps the object arrived, captured then.
  void hear_estimate(const std::string& cell, Time capture, Time now);
  /// A neighbor says that it ends, or has died.
  void gone(const std::string& cell);
  /// Decides; true: something that the neighbors should know at once has changed. `own`: what this
  /// cell has now; `utc_ns`: terms are made of it, so that they grow over restarts.
  bool step(const EstimateWorth& own, Time now, uint64_t utc_ns);

  /// To be said to the neighbors about every kSayEvery, and when step() says so.
  const Holding& own() const { return own_; }
  /// Whether this cell's estimate of a frame captured then is the one to publish.
  bool publishes(Time capture) const;
  /// The cell that keeps the object, as far as it is known here; empty: none.
  std::string holder() const;
  /// The greatest term that was heard or said.
  uint64_t term() const { return greatest_; }

  static constexpr Duration kSayEvery = std::chrono::milliseconds(100);
  static constexpr Duration kSilence = std::chrono::milliseconds(500);
  static constexpr Duration kPatience = std::chrono::milliseconds(300);
  static constexpr Duration kLead = std::chrono::milliseconds(150);    ///< of the time of a change
  static constexpr Duration kAnswer = std::chrono::milliseconds(150);  ///< bound, after that time
  static constexpr Duration kListen = std::chrono::milliseconds(150);  ///< before the first claim
  static constexpr double kMargin = 0.7;                               ///< of the keeper's sigma

 private:
  struct Other {
    Holding said;
    Time heard{};
    Time estimate = Time::min();   // the newest of its estimates
    std::optional<Time> better{};  // since when its estimate is the surer one
  };
  bool is_later(uint64_t term, const std::string& cell) const;
  const std::pair<const std::string, Other>* keeper() const;
  void note_end(const Other& other);
  bool yield();
  const std::string* better_one(const EstimateWorth& own, Time now);
  bool give(const EstimateWorth& own, Time now, uint64_t utc_ns);
  bool take(const EstimateWorth& own, Time now, uint64_t utc_ns);
  void hold(Time from, uint64_t utc_ns);

  std::string cell_;
  Holding own_;
  std::map<std::string, Other> others_;
  uint64_t greatest_ = 0;
  std::optional<Time> vacant_;         // since when nobody keeps it
  std::optional<Time> last_estimate_;  // of the last keeper
  bool died_ = false;                  // that one did not end by itself
};

}  // namespace sightline
