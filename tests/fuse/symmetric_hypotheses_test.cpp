// SPDX-License-Identifier: Apache-2.0
// Objects whose shape looks the same in several poses.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <numbers>

#include "sightline/fuse/estimator.hpp"
#include "support/synthetic_rig.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::RigOptions;
using test::SyntheticRig;

constexpr double kDeg = std::numbers::pi / 180;

Rigid3 turn(const Eigen::Vector3d& axis, double degrees, const Eigen::Vector3d& center) {
  const Eigen::Quaterniond q(Eigen::AngleAxisd(degrees * kDeg, axis));
  return Rigid3(q, center - q * center);
}

/// A box: half turns about its three axes, through a middle that is not the object's origin.
ShapeSymmetry box() {
  const Eigen::Vector3d center(0.01, -0.02, 0.03);
  return {{turn(Eigen::Vector3d::UnitX(), 180, center), turn(Eigen::Vector3d::UnitY(), 180, center),
           turn(Eigen::Vector3d::UnitZ(), 180, center)},
          {},
          {},
          {}};
}

/// What outline and edges of a shape say: the same at all symmetric poses.
class ShapeTerm : public PoseTerm {
 public:
  ShapeTerm(PoseTermPtr inner, std::vector<Rigid3> turns)
      : inner_(std::move(inner)), turns_(std::move(turns)) {}
  LinearizedTerm linearize(const Rigid3& pose) const override {
    LinearizedTerm best;
    best.cost = std::numeric_limits<double>::infinity();
    for (const Rigid3& turn : turns_) {
      LinearizedTerm term = inner_->linearize(pose * turn);
      if (!(term.cost < best.cost)) continue;
      const Matrix6 back = turn.inverse().adjoint();
      term.gradient = (back.transpose() * term.gradient).eval();
      term.information = (back.transpose() * term.information * back).eval();
      best = term;
    }
    return best;
  }
  std::string_view kind() const override { return "region"; }

 private:
  PoseTermPtr inner_;
  std::vector<Rigid3> turns_;
};

/// What outline and edges of a round thing say: nothing of turns about z.
class RoundTerm : public PoseTerm {
 public:
  explicit RoundTerm(PoseTermPtr inner) : inner_(std::move(inner)) {}
  LinearizedTerm linearize(const Rigid3& pose) const override {
    Rigid3 turned = pose;
    double min = std::numeric_limits<double>::infinity();
    for (int degrees = 0; degrees < 360; degrees += 15) {
      const Rigid3 other = pose * turn(Eigen::Vector3d::UnitZ(), degrees, {0, 0, 0});
      const double cost = inner_->linearize(other).cost;
      if (cost < min) min = cost, turned = other;
    }
    LinearizedTerm term = inner_->linearize(turned);
    for (int i = 0; i < 4; ++i) {
      const double step = -term.gradient[2] / term.information(2, 2);
      turned = turned * turn(Eigen::Vector3d::UnitZ(), step / kDeg, {0, 0, 0});
      term = inner_->linearize(turned);
    }
    const Matrix6 forth = difference(pose, turned).isZero(1e-12)
                              ? Matrix6(Matrix6::Identity())
                              : Matrix6((turned.inverse() * pose).adjoint());
    // Schur complement: the turn is free.
    const Vector6 column = term.information.col(2);
    term.information -= column * column.transpose() / column[2];
    term.gradient = (forth.transpose() * term.gradient).eval();
    term.information = (forth.transpose() * term.information * forth).eval();
    return term;
  }
  std::string_view kind() const override { return "region"; }

 private:
  PoseTermPtr inner_;
};

RigOptions rig_options(Duration duration = 1s) {
  RigOptions options;
  options.cameras = 2;
  options.arc = 1.05;
  options.phases = {0.0, 0.0};
  options.duration = duration;
  options.motion.kind = test::MotionKind::kSinusoid;
  options.seed = 4;
  return options;
}

/// Sets of the rig as a tracker of shapes would make them, proposing the pose turned by `wrong`.
std::vector<std::vector<Observation>> shape_sets(const SyntheticRig& rig,
                                                 const ShapeSymmetry& shape_symmetry,
                                                 size_t wrong) {
  std::vector<Rigid3> turns = {Rigid3()};
  turns.insert(turns.end(), shape_symmetry.rotations.begin(), shape_symmetry.rotations.end());
  auto sets = rig.sets();
  for (auto& set : sets) {
    for (Observation& observation : set) {
      for (PoseTermPtr& term : observation.terms) {
        term = std::make_shared<ShapeTerm>(term, turns);
      }
      for (PoseHypothesis& proposed : observation.hypotheses) {
        proposed.world_from_object = proposed.world_from_object * turns[wrong];
      }
    }
  }
  return sets;
}

ObjectEstimator estimator_of(const ShapeSymmetry& shape_symmetry) {
  return ObjectEstimator::create({}, ObjectId(0), shape_symmetry).value();
}

/// Colors that prefer the true pose by `advantage` over the others.
void add_colors(const Rigid3& truth, const ShapeSymmetry& shape_symmetry, double advantage,
                std::vector<Observation>& set) {
  for (Observation& observation : set) {
    if (observation.terms.empty()) continue;
    observation.symmetric_hypotheses = {{truth, -advantage}};
    for (const Rigid3& turn : shape_symmetry.rotations)
      observation.symmetric_hypotheses.push_back({truth * turn, 0});
  }
}

TEST(SymmetricHypotheses, ShapeAloneIsNeverTracking) {
  const SyntheticRig rig(rig_options());
  for (size_t wrong = 0; wrong < 4; ++wrong) {
    ObjectEstimator estimator = estimator_of(box());
    int posed = 0;
    for (const auto& set : shape_sets(rig, box(), wrong)) {
      const UpdateReport report = estimator.process(set);
      const PoseEstimate& estimate = report.estimate;
      ASSERT_NE(estimate.state, TrackState::kTracking);
      if (!has_pose(estimate.state)) continue;
      EXPECT_NE(estimate.degraded_reasons & kAmbiguous, 0);
      EXPECT_EQ(report.hypotheses, 1);
      if (++posed < 5) continue;
      EXPECT_EQ(estimate.degraded_reasons, kAmbiguous);
      // The truth is where the covariance says that it may be.
      EXPECT_GT(estimate.sigma_rotation(), 80 * kDeg);
      EXPECT_LT(estimate.own_sigma_rotation(), 3 * kDeg);
      const Vector6 off = difference(estimate.world_from_object, rig.truth(estimate.time));
      EXPECT_LT(off.dot(estimate.pose_covariance().ldlt().solve(off)), 16.8);
    }
    EXPECT_GT(posed, 25);
  }
}

// On its way to the right edges an outline passes every test now and then.
TEST(OutlineOnly, IsTrackingAfterATenthOfASecondWithoutDoubt) {
  const SyntheticRig rig(rig_options());
  ObjectEstimator estimator = estimator_of({});
  std::optional<Time> first, tracking;
  for (const auto& set : shape_sets(rig, {}, 0)) {
    const PoseEstimate estimate = estimator.process(set).estimate;
    if (has_pose(estimate.state) && !first) first = estimate.time;
    if (estimate.state != TrackState::kTracking) {
      EXPECT_FALSE(tracking) << "it stays";
      EXPECT_TRUE(!first || (estimate.degraded_reasons & kUnconfirmed) != 0);
    } else if (!tracking) {
      tracking = estimate.time;
    }
  }
  ASSERT_TRUE(first && tracking);
  EXPECT_GE(*tracking - *first, 100ms);
  EXPECT_LE(*tracking - *first, 200ms);
}

TEST(SymmetricHypotheses, ColorsDecideAndTheRightOneWins) {
  const SyntheticRig rig(rig_options());
  for (size_t wrong = 0; wrong < 4; ++wrong) {
    ObjectEstimator estimator = estimator_of(box());
    size_t count = 0;
    for (auto& set : shape_sets(rig, box(), wrong)) {
      if (count >= 10) add_colors(rig.truth(set[0].capture), box(), 3.0, set);
      const PoseEstimate estimate = estimator.process(set).estimate;
      if (count++ < 10) {
        ASSERT_NE(estimate.state, TrackState::kTracking);
        continue;
      }
      const Rigid3 truth = rig.truth(estimate.time);
      const double off = rotation_angle(truth, estimate.world_from_object);
      if (estimate.state == TrackState::kTracking) {
        EXPECT_LT(off, 3 * kDeg);
        EXPECT_LT(translation_distance(truth, estimate.world_from_object), 0.005);
        const Vector6 twist = rig.truth_twist(estimate.time) - estimate.twist;
        EXPECT_LT(twist.head<3>().norm(), 1.5);
        EXPECT_LT(twist.tail<3>().norm(), 0.3);
      }
      if (count > 20) {  // an outline has to settle
        EXPECT_EQ(estimate.state, TrackState::kTracking);
      }
    }
  }
}

TEST(SymmetricHypotheses, WeakHintsProveNothingHoweverManyTheyAre) {
  const SyntheticRig rig(rig_options(2s));
  ObjectEstimator estimator = estimator_of(box());
  for (auto& set : shape_sets(rig, box(), 1)) {
    add_colors(rig.truth(set[0].capture), box(), 0.3, set);
    EXPECT_NE(estimator.process(set).estimate.state, TrackState::kTracking);
  }
}

TEST(SymmetricHypotheses, MarkersDecideAtOnce) {
  class Marker : public PoseTerm {
   public:
    explicit Marker(PoseTermPtr inner) : inner_(std::move(inner)) {}
    LinearizedTerm linearize(const Rigid3& pose) const override { return inner_->linearize(pose); }
    std::string_view kind() const override { return "fiducial"; }

   private:
    PoseTermPtr inner_;
  };
  const SyntheticRig rig(rig_options());
  ObjectEstimator estimator = estimator_of(box());
  const auto markers = rig.sets();
  auto sets = shape_sets(rig, box(), 3);
  for (size_t i = 0; i < sets.size(); ++i) {
    if (i >= 10) {
      sets[i] = markers[i];
      for (Observation& observation : sets[i]) {
        for (PoseTermPtr& term : observation.terms) term = std::make_shared<Marker>(term);
      }
    }
    const PoseEstimate estimate = estimator.process(sets[i]).estimate;
    if (i < 10) {
      EXPECT_NE(estimate.state, TrackState::kTracking);
    } else {
      EXPECT_EQ(estimate.state, TrackState::kTracking) << i;
      EXPECT_LT(rotation_angle(rig.truth(estimate.time), estimate.world_from_object), 3 * kDeg);
    }
  }
}

TEST(SymmetricHypotheses, ALongGapOpensTheQuestionAgain) {
  RigOptions options = rig_options(3s);
  options.occlusions = {{-1, 500ms, 600ms}, {-1, 1500ms, 2100ms}};
  const SyntheticRig rig(options);
  ObjectEstimator estimator = estimator_of(box());
  const Time start = rig.frames().front().observation.capture;
  int sure_after_short = 0, sure_after_long = 0;
  for (auto& set : shape_sets(rig, box(), 0)) {
    const Duration age = set[0].capture - start;
    if (age < 200ms) add_colors(rig.truth(set[0].capture), box(), 8.0, set);
    const TrackState state = estimator.process(set).estimate.state;
    if (age > 700ms && age < 1500ms) sure_after_short += state == TrackState::kTracking ? 1 : 0;
    if (age > 2100ms) sure_after_long += state == TrackState::kTracking ? 1 : 0;
  }
  EXPECT_GT(sure_after_short, 20);
  EXPECT_EQ(sure_after_long, 0);
}

TEST(SymmetricHypotheses, ADeclaredAxisIsTrackedAndItsTurnNotClaimed) {
  ShapeSymmetry bottle;
  bottle.axis = {Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero(), true};
  const SyntheticRig rig(rig_options());
  ObjectEstimator estimator = estimator_of(bottle);
  int sure = 0;
  for (auto& set : rig.sets()) {
    for (Observation& observation : set) {
      for (PoseTermPtr& term : observation.terms) term = std::make_shared<RoundTerm>(term);
    }
    const PoseEstimate estimate = estimator.process(set).estimate;
    if (estimate.state != TrackState::kTracking) continue;
    ++sure;
    EXPECT_GT(estimate.sigma_rotation(), 90 * kDeg);
    EXPECT_LT(estimate.own_sigma_rotation(), 10 * kDeg);
    const Rigid3 truth = rig.truth(estimate.time);
    const Eigen::Vector3d up = truth.rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d seen = estimate.world_from_object.rotation * Eigen::Vector3d::UnitZ();
    EXPECT_LT(up.cross(seen).norm(), 2 * kDeg);
    EXPECT_LT(translation_distance(truth, estimate.world_from_object), 0.004);
  }
  EXPECT_GT(sure, 25);
}

TEST(SymmetricHypotheses, AnAxisThatIsNotDeclaredIsWeakAndNamed) {
  ShapeSymmetry round;
  round.axis = {Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero(), false};
  const SyntheticRig rig(rig_options());
  ObjectEstimator estimator = estimator_of(round);
  int weak = 0;
  for (auto& set : rig.sets()) {
    for (Observation& observation : set) {
      for (PoseTermPtr& term : observation.terms) term = std::make_shared<RoundTerm>(term);
    }
    const PoseEstimate estimate = estimator.process(set).estimate;
    ASSERT_NE(estimate.state, TrackState::kTracking);
    if (estimate.degraded_reasons != kWeakRotation) continue;
    ++weak;
    EXPECT_GT(estimate.sigma_rotation(), 90 * kDeg);
    const Eigen::Vector3d axis = rig.truth(estimate.time).rotation * Eigen::Vector3d::UnitZ();
    EXPECT_GT(std::abs(estimate.weak_axis().dot(axis)), std::cos(5 * kDeg));
  }
  EXPECT_GT(weak, 20);
}

/// A cup: a small handle tells the turn about z, where it shows.
ShapeSymmetry cup() {
  ShapeSymmetry out;
  out.near_axis = {Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero(), false};
  for (int degrees = 15; degrees < 360; degrees += 15) {
    out.near_rotations.push_back(turn(Eigen::Vector3d::UnitZ(), degrees, {0, 0, 0}));
  }
  return out;
}

/// What silhouettes say: the farther from the truth, the less likely, up to 90 degrees.
void add_silhouettes(const Rigid3& truth, const Rigid3& pose, double most,
                     std::vector<Observation>& set) {
  std::vector<Rigid3> turns = cup().near_rotations;
  turns.insert(turns.begin(), Rigid3());
  for (Observation& observation : set) {
    if (observation.terms.empty()) continue;
    for (const Rigid3& turn : turns) {
      const double off = rotation_angle(pose * turn, truth) / (90 * kDeg);
      observation.symmetric_hypotheses.push_back({pose * turn, most * std::min(1.0, off)});
    }
  }
}

/// The handle, where it shows: the turn to a degree or two, from less than 20 degrees away.
std::vector<std::vector<Observation>> cup_sets(const SyntheticRig& rig, Duration shown) {
  auto sets = rig.sets();
  const Time start = sets.front()[0].capture;
  for (auto& set : sets) {
    for (Observation& observation : set) {
      for (PoseTermPtr& term : observation.terms) {
        if (set[0].capture - start >= shown) term = std::make_shared<RoundTerm>(term);
      }
    }
  }
  return sets;
}

TEST(NearAxis, IsFollowedToTheTurnThatThePictureTells) {
  const SyntheticRig rig(rig_options());
  ShapeSymmetry as_terms = cup();
  as_terms.rotations = as_terms.near_rotations;
  for (const size_t wrong : {0u, 2u, 6u, 12u}) {
    ObjectEstimator estimator = estimator_of(cup());
    Rigid3 pose;
    int sure = 0, count = 0;
    for (auto& set : shape_sets(rig, as_terms, wrong)) {
      const Rigid3 truth = rig.truth(set[0].capture);
      if (++count > 8) add_silhouettes(truth, pose, 6.0, set);
      const PoseEstimate estimate = estimator.process(set).estimate;
      if (!has_pose(estimate.state)) continue;
      pose = estimate.world_from_object;
      if (count <= 8) {
        EXPECT_NE(estimate.state, TrackState::kTracking) << "nothing tells the turn";
      }
      if (estimate.state != TrackState::kTracking) continue;
      ++sure;
      EXPECT_LT(rotation_angle(truth, pose), 3 * kDeg) << wrong;
    }
    EXPECT_GT(sure, 10) << wrong;
  }
}

TEST(NearAxis, IsNotSureWhileAPoseBesideItIsAsGood) {
  const SyntheticRig rig(rig_options());
  for (const bool settled : {false, true}) {
    ObjectEstimator estimator = estimator_of(cup());
    int sure = 0;
    for (auto& set : rig.sets()) {
      const Rigid3 truth = rig.truth(set[0].capture);
      add_silhouettes(truth, truth, 60.0, set);
      for (Observation& observation : set) {
        // First the turn itself, then that by 15 degrees.
        if (!settled && observation.symmetric_hypotheses.size() > 1) {
          observation.symmetric_hypotheses[1].cost = 0;
        }
      }
      sure += estimator.process(set).estimate.state == TrackState::kTracking ? 1 : 0;
    }
    EXPECT_EQ(sure > 20, settled) << sure;
    EXPECT_EQ(sure > 0, settled) << sure;
  }
}

TEST(NearAxis, IsWeakAgainSoonAfterTheHandleIsHidden) {
  const SyntheticRig rig(rig_options(2s));
  ObjectEstimator estimator = estimator_of(cup());
  const auto sets = cup_sets(rig, 600ms);
  const Time start = sets.front()[0].capture;
  int sure_while_shown = 0, sure_long_after = 0, outside = 0;
  for (auto set : sets) {
    const Duration age = set[0].capture - start;
    const Rigid3 truth = rig.truth(set[0].capture);
    if (age < 600ms) add_silhouettes(truth, truth, 8.0, set);
    const PoseEstimate estimate = estimator.process(set).estimate;
    const bool sure = estimate.state == TrackState::kTracking;
    if (age > 300ms && age < 600ms) sure_while_shown += sure ? 1 : 0;
    if (age > 1200ms) sure_long_after += sure ? 1 : 0;
    if (!has_pose(estimate.state)) continue;
    const Vector6 off = difference(estimate.world_from_object, truth);
    outside += off.dot(estimate.pose_covariance().ldlt().solve(off)) > 22.5 ? 1 : 0;
  }
  EXPECT_GT(sure_while_shown, 7);
  EXPECT_EQ(sure_long_after, 0);
  EXPECT_EQ(outside, 0) << "the covariance covers the truth";
}

TEST(SymmetricHypotheses, LateSetsComeToTheSame) {
  const SyntheticRig rig(rig_options());
  auto sets = shape_sets(rig, box(), 2);
  for (size_t i = 6; i < sets.size(); ++i) {
    add_colors(rig.truth(sets[i][0].capture), box(), 4.0, sets[i]);
  }
  ObjectEstimator in_order = estimator_of(box()), late = estimator_of(box());
  for (const auto& set : sets) in_order.process(set);
  for (size_t i = 0; i < sets.size(); ++i) {
    if (i != 7) late.process(sets[i]);
    if (i == 11) late.process(sets[7]);
  }
  const PoseEstimate a = in_order.track()->newest(), b = late.track()->newest();
  EXPECT_EQ(a.world_from_object.matrix(), b.world_from_object.matrix());
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.alternatives, b.alternatives);
  EXPECT_EQ(a.state, TrackState::kTracking);
}

}  // namespace
}  // namespace sightline
