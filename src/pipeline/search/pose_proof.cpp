// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/search/pose_proof.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sightline {
namespace {

// Checks of a pose that is known: often after it was found, rarely later.
constexpr int kEarlyChecks = 4;
constexpr Duration kEarlyCheck = std::chrono::milliseconds(150);
constexpr Duration kDegradedCheck = std::chrono::milliseconds(500);
constexpr Duration kCheck = std::chrono::seconds(2);
constexpr Duration kSecondCheck = std::chrono::milliseconds(80);  // and after a suspicion
// Another orientation has to score so much. Of each check the logarithm of its score over that of
// the orientation in force counts, less what chance gives (at true poses of twelve recordings it
// has 1.06 of it at most, docs/detection.md), up to a bound: no single one decides.
constexpr double kMinOtherScore = 0.45, kChance = 0.04, kMostOfCheck = 0.2, kEnoughSupport = 0.2;
constexpr double kOtherScoreRatio = 1.15;  // one check that doubts the pose
constexpr double kGoodScore = 0.55;
constexpr double kMinScoreHere = 0.42;  // at true poses that two cameras see: 0.46 and more
constexpr int kChecksOfWeak = 2;        // that have to pass before what scored less is claimed:
constexpr double kWeakScore = 0.7;
constexpr int kChecksWithoutDoubt = 4;  // in a row, if another orientation scores as much
constexpr int kDoubts = 2;              // checks in a row that end in a search
// A pose that ranks so much as it is stands out, the more the nearer to the second: where that is
// enough, it needs no search about its place.
constexpr double kRankThatStandsOut = 0.45, kRankThatProves = 0.5;
// Of poses as they were found, right ones rank 0.19 to 0.88, wrong ones up to 0.52 or no better
// than their other orientations (docs/detection.md, "From the first frame to `tracking`").
constexpr double kRankAsFound = 0.55, kOtherAsFound = 0.85;
// A search about its place has found something else of so much its rank.
constexpr double kOutdone = 1.15;
// Or something that stands out, by so many times the rank of the pose as it is, and by more than
// what is fitted from there: so near to a pose that has lost the object turning that it is taken
// for the same. Of 333 such searches at right poses none said so, of 45 at others 8
// (docs/detection.md, "Lost while it turns").
constexpr double kLostTo = 2.0, kFittedOfLost = 0.92;
// Or the pose has fallen to so much of the rank that it had, and another one there ranks so many
// times that: 1 and 9.
constexpr double kFallen = 0.4, kOutranks = 1.5;
// Log ratios of how often right and wrong poses give that (docs/detection.md, "Found again by
// itself"). By that the third would be below 0, too; but what no search comes to, and nothing
// outranks time after time, is right: the search is not good enough for it.
constexpr double kFoundAgain = 2.5, kStandsOut = 1.5, kStandsOutALittle = 0.4, kUndecided = 0.4,
                 kOutdoneOdds = -4;
constexpr double kLeastOdds = -5, kMostOdds = 3;  // what was long so may change
// Ratio test (Lowe 2004, section 7.1): it counts in full where the next pose at that place has the
// first share of the best one's rank at most, and not at all from the second share on.
constexpr double kDistinct = 0.7, kIndistinct = 0.85;
constexpr double kClaimedOdds = 1, kDisbelievedOdds = -4;
// The same by colors, where one check says what the next one does: it withholds, and proves
// nothing.
constexpr double kColorsShow = 1, kColorsDoNot = -1;
constexpr double kLeastColorOdds = -4, kMostColorOdds = 2, kClaimedColorOdds = -2;

}  // namespace

void PoseProof::begin_again() {
  best_rank_ = 0;
  checks_ = passed_ = undoubted_ = 0;
  proven_ = false;
  log_odds_ = std::min(log_odds_, 0.0);
}

void PoseProof::begin_weakly() {
  begin_again();
  found_weakly_ = true;
}

// What stands out by little may err: it has to pass more checks. So does what is found of an object
// that was just taken for something else.
void PoseProof::begin(const Detection& found) {
  begin_again();
  log_odds_ /= 2;
  color_odds_ = std::min(color_odds_ / 2, 0.0);
  forget_suspicion();
  if (found.poses.empty()) return;
  found_weakly_ = found.by_contour && found.contour_score < kWeakScore;
}

void PoseProof::forget_suspicion() {
  suspicion_.reset();
  doubts_ = 0;
}

Duration PoseProof::pause(TrackState state) const {
  if (suspected()) return kSecondCheck;
  if (unchecked()) return kSecondCheck;
  if (checks_ < kEarlyChecks) return kEarlyCheck;
  const bool settled = state == TrackState::kTracking && log_odds_ >= kMostOdds;
  return settled ? kCheck : kDegradedCheck;
}

bool PoseProof::take_doubts() {
  if (doubts_ < kDoubts) return false;
  doubts_ = 0;
  return true;
}

bool PoseProof::refuted_by(const ViewpointModel& views, const Rigid3& pose,
                           const OrientationComparison& compared) {
  best_rank_ = std::max(best_rank_, compared.rank);
  const bool is_turned = turned(views, pose, compared);
  note_passed(compared);
  return is_turned;
}

bool PoseProof::shown_as_found(const ViewpointModel& views, const Rigid3& pose,
                               const OrientationComparison& compared) {
  best_rank_ = std::max(best_rank_, compared.rank);
  if (compared.rank < kRankAsFound) return false;
  if (compared.other > kOtherAsFound * compared.here) return false;
  count();
  (void)refuted_by(views, pose, compared);
  add_odds(kStandsOut);
  return true;
}

void PoseProof::let_pass() {
  if (log_odds_ < 0) return;
  proven_ = true;
  log_odds_ = std::max(log_odds_, kClaimedOdds);
}

bool PoseProof::proven() const {
  return proven_ && log_odds_ >= kClaimedOdds && color_odds_ >= kClaimedColorOdds;
}
bool PoseProof::disbelieved() const { return log_odds_ <= kDisbelievedOdds; }
void PoseProof::note_found_again() { add_odds(kFoundAgain); }

void PoseProof::add_odds(double log_ratio) {
  log_odds_ = std::clamp(log_odds_ + log_ratio, kLeastOdds, kMostOdds);
}

bool PoseProof::wants_search(const OrientationComparison& compared, Time now) {
  const bool stands_out = compared.rank >= kRankThatStandsOut;
  if (stands_out) {
    const double share =
        (compared.rank - kRankThatStandsOut) / (kRankThatProves - kRankThatStandsOut);
    add_odds(std::lerp(kStandsOutALittle, kStandsOut, std::min(share, 1.0)));
  }
  if ((stands_out && log_odds_ >= kClaimedOdds) || disbelieved()) return false;
  return log_odds_ < kMostOdds || has_fallen(compared) || now - searched_ >= kCheck;
}

bool PoseProof::has_fallen(const OrientationComparison& compared) const {
  return compared.rank < kFallen * best_rank_;
}

bool PoseProof::has_lost_it(const PlaceSearch& search,
                            const OrientationComparison& compared) const {
  if (has_fallen(compared) && !search.same && search.rank >= kOutranks * compared.rank) return true;
  return search.rank >= kRankThatStandsOut && search.rank >= kLostTo * compared.rank &&
         compared.fitted_rank <= kFittedOfLost * search.rank;
}

void PoseProof::note_search(const PlaceSearch& search, const OrientationComparison& compared,
                            Time now) {
  searched_ = now;
  const bool outdone = (!search.same && search.rank > kOutdone * compared.fitted_rank) ||
                       has_lost_it(search, compared);
  const double distinct =
      std::clamp((kIndistinct - search.second) / (kIndistinct - kDistinct), 0.0, 1.0);
  add_odds(outdone ? kOutdoneOdds : distinct * (search.same ? kFoundAgain : kUndecided));
}

// In a row, because a wrong orientation passes now and then. Of what stands still another one may
// score more by a hair, every time: that is no reason to doubt it for ever.
void PoseProof::note_passed(const OrientationComparison& compared) {
  color_odds_ = std::clamp(color_odds_ + (compared.shows_colors ? kColorsShow : kColorsDoNot),
                           kLeastColorOdds, kMostColorOdds);
  const bool passes = compared.other <= compared.here && compared.here >= kMinScoreHere;
  passed_ = passes ? passed_ + 1 : 0;
  undoubted_ = suspected() ? 0 : undoubted_ + 1;
  proven_ |= passed_ >= (found_weakly_ ? kChecksOfWeak : 1) || undoubted_ >= kChecksWithoutDoubt;
}

// Whether the checks in a row that show it in the same other orientation are enough. What speaks
// against the pose without naming another one is counted as a doubt.
bool PoseProof::turned(const ViewpointModel& views, const Rigid3& pose,
                       const OrientationComparison& compared) {
  const std::optional<Suspicion> before = std::exchange(suspicion_, std::nullopt);
  const bool clear = compared.other >= kOtherScoreRatio * compared.here;
  const bool possible = compared.other >= kMinOtherScore && !compared.best.poses.empty();
  doubts_ = (possible && clear) || compared.here < kMinScoreHere ? doubts_ + 1 : 0;
  if (!possible || !(compared.here > 0)) return false;
  Suspicion now{pose.inverse() * compared.best.poses.front().world_from_object, 0, clear};
  now.support = std::min(std::log(compared.other / compared.here), kMostOfCheck) - kChance;
  const bool again =
      before && views.angle_up_to_symmetry(before->other, now.other) < kSameOrientation;
  if (again) now.support += before->support;
  if (now.support > 0) suspicion_ = now;
  // The one in force is wrong, even if it is not clear what is right.
  const bool twice = before && before->clear && clear && compared.other >= kGoodScore;
  return twice || (again && now.support >= kEnoughSupport);
}

}  // namespace sightline
