// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "sightline/base/time.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/observe/detect/pose_check.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline {

/// What checks of a pose have said of it: whether it may be claimed, and whether another
/// orientation has shown itself clearly enough to take its place. Plain value.
class PoseProof {
 public:
  /// [rad] between the orientations of two checks that show the same one.
  static constexpr double kSameOrientation = 0.35;

  /// A pose has been found: nothing is proven of it.
  void begin(const Detection& found);
  /// It has gone out of view: what comes back is to be proven anew.
  void begin_again();
  /// Checks did not find it where it should be, nor a search elsewhere: the same, by more checks.
  void begin_weakly();
  /// A search takes the place of what checks suspect.
  void forget_suspicion();

  /// A check begins.
  void count() { ++checks_; }
  /// What it says. True: the images show another orientation, OrientationComparison::best.
  bool refuted_by(const ViewpointModel& views, const Rigid3& pose,
                  const OrientationComparison& compared);
  /// What a check says in the frames in which it was found. It was found by what that looks at, so
  /// it counts only if it is clear. False: it does not.
  bool shown_as_found(const ViewpointModel& views, const Rigid3& pose,
                      const OrientationComparison& compared);
  /// It is nowhere to be seen: nothing to hold back.
  void let_pass();
  /// Whether a search about its place should say if it is found there by itself, too.
  bool wants_search(const OrientationComparison& compared, Time now);
  /// What that says: it is there, or something else that stands out more, or neither.
  void note_search(const PlaceSearch& search, const OrientationComparison& compared, Time now);
  /// A search of everything has found it where it is.
  void note_found_again();
  /// What searches about its place have found instead says that it is another thing, or nowhere
  /// near: it is searched for as if nothing were known of it.
  bool disbelieved() const;
  /// Checks in a row speak against it without naming another one; once.
  bool take_doubts();

  bool proven() const;
  /// No check of it counts yet.
  bool unchecked() const { return checks_ == 0; }
  bool suspected() const { return suspicion_ || doubts_ > 0; }
  /// From one check to the next.
  Duration pause(TrackState state) const;

 private:
  /// Another orientation that checks in a row have shown.
  struct Suspicion {
    Rigid3 other;        ///< object as tracked from object as shown
    double support = 0;  ///< sum of their log ratios of scores, less what chance gives
    bool clear = false;  ///< the last one alone
  };
  bool turned(const ViewpointModel& views, const Rigid3& pose,
              const OrientationComparison& compared);
  void note_passed(const OrientationComparison& compared);
  bool has_fallen(const OrientationComparison& compared) const;
  bool has_lost_it(const PlaceSearch& search, const OrientationComparison& compared) const;
  void add_odds(double log_ratio);

  bool found_weakly_ = false;  ///< it stood out by little, or checks did not find it
  int checks_ = 0;             ///< since it was found, or out of view
  int passed_ = 0;             ///< of those in a row in which no other orientation scored more
  int undoubted_ = 0;          ///< of those in a row in which none scored clearly more
  bool proven_ = false;        ///< so many passed that it may be claimed
  double best_rank_ = 0;       ///< of the pose as it was in them, or as it was found
  int doubts_ = 0;             ///< checks in a row that speak against it
  std::optional<Suspicion> suspicion_ = std::nullopt;
  /// Logarithm of the odds that it is right, by what searches find that know nothing of it.
  double log_odds_ = 0;
  Time searched_{};        ///< about its place, last
  double color_odds_ = 0;  ///< the same, by the colors of its mesh
};

}  // namespace sightline
