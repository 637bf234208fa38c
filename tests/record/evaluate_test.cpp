// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/evaluate.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <numbers>

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

Rigid3 turned(double degrees, const Eigen::Vector3d& axis, const Eigen::Vector3d& t) {
  return Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(degrees * kDegree, axis.normalized())), t);
}

Time at_ms(double ms) { return time_from_ns(static_cast<int64_t>(ms * 1e6)); }

/// Pose of "cup" with a constant twist.
Rigid3 moving_pose(double seconds) {
  const Vector6 twist = (Vector6() << 0.3, -0.2, 0.5, 0.1, 0.2, -0.1).finished();
  return Rigid3::exp(seconds * twist);
}

/// From 1 s to 2 s, every 100 ms.
std::vector<TruthRow> moving_truth() {
  std::vector<TruthRow> rows;
  for (int i = 0; i <= 10; ++i)
    rows.push_back({at_ms(1000 + 100 * i), "cup", moving_pose(0.1 * i)});
  return rows;
}

/// "cup" stands at the origin for 100 ms.
std::vector<TruthRow> still_truth() { return {{at_ms(0), "cup", {}}, {at_ms(100), "cup", {}}}; }

PoseLogRow row_at(double ms, const Rigid3& pose, TrackState state = TrackState::kTracking) {
  PoseLogRow row;
  row.time = at_ms(ms);
  row.object = "cup";
  row.state = state;
  if (has_pose(state)) row.world_from_object = pose;
  return row;
}

TEST(Evaluate, InterpolatesOnTheGeodesic) {
  std::vector<PoseLogRow> rows;
  for (double ms = 1000; ms <= 2000; ms += 12.5) {
    rows.push_back(row_at(ms, moving_pose((ms - 1000) / 1e3)));
  }
  const auto result = evaluate(moving_truth(), rows);
  ASSERT_EQ(result.objects.size(), 1u);
  const auto& cup = result.objects[0];
  EXPECT_EQ(cup.all.count, rows.size());
  EXPECT_LT(cup.all.max_mm, 1e-6);
  EXPECT_LT(cup.all.max_deg, 1e-5);
  EXPECT_EQ(cup.coverage(), 1.0);
}

TEST(Evaluate, NeverExtrapolatesAndDoesNotBridgeGaps) {
  auto truth = moving_truth();
  truth.erase(truth.begin() + 4, truth.begin() + 7);  // a gap of 0.4 s
  const std::vector<PoseLogRow> rows = {row_at(999, {}), row_at(2001, {}), row_at(1450, {}),
                                        row_at(1000, moving_pose(0))};
  const auto cup = evaluate(truth, rows).objects[0];
  EXPECT_EQ(cup.outside_truth, 3u);
  EXPECT_EQ(cup.all.count, 1u);
}

TEST(Evaluate, SummarizesErrors) {
  std::vector<PoseLogRow> rows;
  for (int i = 1; i <= 100; ++i) {
    rows.push_back(row_at(i, turned(0.1 * i, {1, 2, 3}, {1e-3 * i, 0, 0})));
  }
  const auto all = evaluate(still_truth(), rows).objects[0].all;
  EXPECT_NEAR(all.median_mm, 50.5, 1e-9);
  EXPECT_NEAR(all.p95_mm, 95, 1e-9);
  EXPECT_NEAR(all.max_mm, 100, 1e-9);
  EXPECT_NEAR(all.median_deg, 5.05, 1e-9);
  EXPECT_NEAR(all.p95_deg, 9.5, 1e-9);
}

TEST(Evaluate, CountsWrongClaimsOnlyWhileTracking) {
  const Rigid3 far(Eigen::Quaterniond::Identity(), {0.021, 0, 0});
  const Rigid3 tilted = turned(10.5, {0, 1, 0}, {0, 0, 0});
  const std::vector<PoseLogRow> rows = {row_at(0, {}),
                                        row_at(10, far),
                                        row_at(20, tilted),
                                        row_at(30, far, TrackState::kDegraded),
                                        row_at(40, far, TrackState::kCoasting),
                                        row_at(50, {}, TrackState::kLost),
                                        row_at(60, {}, TrackState::kSearching)};
  const auto cup = evaluate(still_truth(), rows).objects[0];
  EXPECT_THAT(cup.wrong_claims, testing::ElementsAre(at_ms(10), at_ms(20)));
  EXPECT_EQ(cup.by_state.at(TrackState::kDegraded).count, 1u);
  EXPECT_EQ(cup.state_rows[static_cast<size_t>(TrackState::kLost)], 1u);
  EXPECT_EQ(cup.covered, 1u);
  EXPECT_EQ(cup.coverage(), 0.5);
}

TEST(Evaluate, ForgivesSymmetry) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Rigid3 truth = turned(40, {1, 1, 0}, {0.1, 0.2, 0.3});
  const Rigid3 quarter = truth * turned(90, z, {0, 0, 0});
  EXPECT_NEAR(pose_error(truth, quarter).deg, 90, 1e-9);
  EXPECT_NEAR(pose_error(truth, quarter, {Symmetry::kDiscrete, z, 4}).deg, 0, 1e-5);
  EXPECT_NEAR(pose_error(truth, quarter, {Symmetry::kDiscrete, z, 2}).deg, 90, 1e-9);
  EXPECT_NEAR(pose_error(truth, quarter, {Symmetry::kAxis, z, 1}).deg, 0, 1e-9);
  const Rigid3 tilted = truth * turned(33, z, {0, 0, 0}) * turned(5, {1, 0, 0}, {0, 0, 0});
  EXPECT_NEAR(pose_error(truth, tilted, {Symmetry::kAxis, z, 1}).deg, 5, 1e-9);
}

TEST(Evaluate, NearestAlikeDiffersByASymmetryAndIsTheNearest) {
  const Eigen::Vector3d axis = Eigen::Vector3d(0.2, -0.5, 1).normalized();
  const Rigid3 truth = turned(70, {1, 2, 3}, {0.1, 0.2, 0.3});
  const Rigid3 pose = truth * turned(133, axis, {0, 0, 0}) * turned(3, {1, 0.3, 0}, {0, 0, 0});
  for (const SymmetryOption& symmetry :
       {SymmetryOption{Symmetry::kAxis, axis, 1}, SymmetryOption{Symmetry::kDiscrete, axis, 6}}) {
    const Rigid3 alike = nearest_symmetric(truth, pose, symmetry);
    EXPECT_LT((alike.translation - truth.translation).norm(), 1e-12);
    // The axis stays where it is.
    EXPECT_LT((alike.rotation * axis - truth.rotation * axis).norm(), 1e-9);
    const int steps = symmetry.kind == Symmetry::kAxis ? 3600 : 6;
    for (int i = 0; i < steps; ++i) {
      const Rigid3 other = truth * turned(360.0 * i / steps, axis, {0, 0, 0});
      EXPECT_LE(rotation_angle(alike, pose), rotation_angle(other, pose) + 1e-9);
    }
  }
  EXPECT_LT(rotation_angle(nearest_symmetric(truth, pose, {}), truth), 1e-12);
}

TEST(Evaluate, CountsRowsWithoutAPoseAsFailures) {
  const std::vector rows = {row_at(0, {}), row_at(25, turned(4, {1, 0, 0}, {0.049, 0, 0})),
                            row_at(50, turned(6, {1, 0, 0}, {0, 0, 0})),
                            row_at(75, {}, TrackState::kLost), row_at(500, {}, TrackState::kLost)};
  const auto cup = evaluate(still_truth(), rows).objects[0];
  EXPECT_EQ(cup.judged, 4u);  // the last is after the truth
  EXPECT_EQ(cup.within, 2u);
  EXPECT_EQ(cup.success(), 0.5);
}

TEST(Evaluate, ComparesErrorsWithWhatIsClaimed) {
  std::vector rows = {row_at(0, turned(1, {1, 0, 0}, {0.002, 0, 0})),
                      row_at(50, turned(4, {1, 0, 0}, {0, 0, 0}))};
  for (PoseLogRow& row : rows) row.sigma_t_mm = 1, row.sigma_r_deg = 1;
  const auto claimed = evaluate(still_truth(), rows).objects[0].normalized;
  ASSERT_EQ(claimed.size(), 1u);
  const NormalizedError& e = claimed.at(TrackState::kTracking);
  EXPECT_EQ(e.count, 2u);
  EXPECT_NEAR(e.translation, 2, 1e-9);  // (2^2 + 0) / 2
  EXPECT_NEAR(e.rotation, 8.5, 1e-9);   // (1 + 16) / 2
  EXPECT_EQ(e.beyond, 0.5);
}

TEST(Evaluate, KeyframesAreTrueAtTheirOwnTimesOnly) {
  EvaluateOptions options;
  options.keyframes = true;
  const std::vector rows = {row_at(0, {}), row_at(50, turned(90, {1, 0, 0}, {1, 0, 0}))};
  const auto cup = evaluate(still_truth(), rows, options).objects[0];
  EXPECT_EQ(cup.all.count, 1u);  // the row at 50 ms is no matter of the truth
  EXPECT_EQ(cup.outside_truth, 1u);
  EXPECT_EQ(cup.judged, 2u);  // the key frame at 100 ms has no row: a failure
  EXPECT_EQ(cup.within, 1u);
  EXPECT_EQ(cup.success(), 0.5);
  EXPECT_EQ(cup.coverage(), 0.5);
}

TEST(Evaluate, AKeyframeIsCountedOnceAndByItsLastRow) {
  EvaluateOptions options;
  options.keyframes = true;
  const Rigid3 wrong = turned(90, {1, 0, 0}, {1, 0, 0});
  const auto count = [&](std::vector<PoseLogRow> rows) {
    return evaluate(still_truth(), rows, options).objects[0].within;
  };
  EXPECT_EQ(count({row_at(0, {}), row_at(0, {})}), 1u);  // a row for each camera
  EXPECT_EQ(count({row_at(0, wrong), row_at(0, {})}), 1u);
  EXPECT_EQ(count({row_at(0, {}), row_at(0, wrong)}), 0u);
}

TEST(Evaluate, MeasuresAtTheMiddleOfTheShapeWithAndWithoutItsSymmetries) {
  EvaluateOptions options;
  options.keyframes = true;
  // A box whose origin is a corner: half a turn about its middle.
  const Eigen::Vector3d center(0.1, 0, 0);
  const Eigen::Quaterniond half(Eigen::AngleAxisd(180 * kDegree, Eigen::Vector3d::UnitZ()));
  options.shape["cup"] = {center, {Rigid3(half, center - half * center)}};
  const Rigid3 about_center(half, center - half * center);
  const std::vector rows = {row_at(0, about_center),
                            row_at(100, turned(0, {1, 0, 0}, {0, 0.003, 0}))};
  const auto cup = evaluate(still_truth(), rows, options).objects[0];
  EXPECT_NEAR(cup.all.max_mm, 3, 1e-9);
  EXPECT_NEAR(cup.all.max_deg, 180, 1e-9);
  EXPECT_EQ(cup.within, 1u);
  EXPECT_EQ(cup.wrong_claims.size(), 1u);
  ASSERT_TRUE(cup.up_to_symmetry);
  EXPECT_EQ(cup.up_to_symmetry->within, 2u);
  EXPECT_EQ(cup.up_to_symmetry->wrong_claims, 0u);
  EXPECT_NEAR(cup.up_to_symmetry->all.max_deg, 0, 1e-9);
  EXPECT_NEAR(cup.up_to_symmetry->all.max_mm, 3, 1e-9);
}

TEST(Evaluate, NamesWhatIsMissing) {
  const std::vector<TruthRow> truth = {{at_ms(0), "box", {}}};
  const std::vector<PoseLogRow> rows = {row_at(0, {})};
  const auto result = evaluate(truth, rows);
  ASSERT_EQ(result.objects.size(), 1u);
  EXPECT_EQ(result.objects[0].rows, 0u);
  EXPECT_EQ(result.objects[0].coverage(), 0.0);
  EXPECT_THAT(result.without_truth, testing::ElementsAre("cup"));
  EXPECT_THAT(to_text(result), testing::HasSubstr("object cup: no truth"));
}

TEST(Evaluate, PrintsJsonAndText) {
  const auto result = evaluate(moving_truth(), std::vector{row_at(1000, moving_pose(0))});
  const auto json = nlohmann::json::parse(to_json(result));
  EXPECT_EQ(json["objects"][0]["object"], "cup");
  EXPECT_EQ(json["objects"][0]["errors"]["count"], 1);
  EXPECT_EQ(json["objects"][0]["state_rows"]["tracking"], 1);
  EXPECT_EQ(json["objects"][0]["wrong_claims"], 0);
  EXPECT_THAT(to_text(result), testing::HasSubstr("coverage 9.1 % (1 of 11)"));
}

TEST(Evaluate, NamesThatAreNotUtf8StillPrint) {
  const std::vector<TruthRow> truth = {{at_ms(0), "cup\xff", {}}};
  EXPECT_TRUE(nlohmann::json::accept(to_json(evaluate(truth, {}))));
}

// Three that look the same, logged under names that go round; the first two are exchanged later on.
TEST(Evaluate, NamesOfAlikeObjectsFitTheTruthOnce) {
  const std::vector<std::string> names = {"a", "b", "c"};
  const auto place = [](size_t i) {
    return Rigid3(Eigen::Quaterniond::Identity(), {0.3 * static_cast<double>(i), 0, 0});
  };
  std::vector<TruthRow> truth;
  std::vector<PoseLogRow> rows;
  for (int ms = 0; ms <= 100; ms += 10) {
    for (size_t i = 0; i < 3; ++i) {
      truth.push_back({at_ms(ms), names[i], place(i)});
      const bool swapped = ms >= 80 && i < 2;
      rows.push_back(row_at(ms, place(swapped ? 1 - i : i)));
      rows.back().object = names[(i + 1) % 3];
    }
  }
  for (const ObjectEvaluation& object : evaluate(truth, rows).objects) {
    EXPECT_EQ(object.logged_as, object.object);
    EXPECT_LE(object.within, 3u);
  }
  EvaluateOptions options;
  options.alike = {{"c", "a", "b", "unknown"}};
  const Evaluation matched = evaluate(truth, rows, options);
  for (size_t i = 0; i < 3; ++i) {
    const ObjectEvaluation& object = matched.objects[i];
    EXPECT_EQ(object.logged_as, names[(i + 1) % 3]);
    EXPECT_EQ(object.within, i < 2 ? 8u : 11u);
    EXPECT_EQ(object.wrong_claims.size(), i < 2 ? 3u : 0u) << "a swap is an error";
  }
  EXPECT_THAT(to_text(matched), testing::HasSubstr("object a (logged as b)"));
  options.alike = {{"a", "b"}};
  EXPECT_EQ(evaluate(truth, rows, options).objects[2].logged_as, "c");
}

TEST(Evaluate, NamesOfAlikeObjectsStayWhereNothingTells) {
  const std::vector<TruthRow> truth = {
      {at_ms(0), "a", {}}, {at_ms(0), "b", {}}, {at_ms(100), "a", {}}, {at_ms(100), "b", {}}};
  EvaluateOptions options;
  options.alike = {{"a", "b"}};
  for (const ObjectEvaluation& object : evaluate(truth, {}, options).objects) {
    EXPECT_EQ(object.logged_as, object.object);
  }
}

}  // namespace
}  // namespace sightline
