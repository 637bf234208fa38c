// SPDX-License-Identifier: Apache-2.0
#include "observe/track/second_look.hpp"

#include <gtest/gtest.h>

namespace sightline {
namespace {

using namespace std::chrono_literals;
using observe::Prediction;

constexpr double kRadius = 0.1;  // [m]

PoseEstimate moving(const Eigen::Vector3d& rad_per_s, const Eigen::Vector3d& m_per_s) {
  PoseEstimate estimate;
  estimate.time = Time(1s);
  estimate.state = TrackState::kTracking;
  estimate.world_from_object = Rigid3(Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3});
  estimate.covariance.diagonal().head<6>().setConstant(1e-6);
  estimate.twist << rad_per_s, m_per_s;
  return estimate;
}

Eigen::Vector3d variances(const Prediction& prediction, int at) {
  return prediction.covariance.diagonal().segment<3>(at);
}

TEST(SecondLook, IsAtTheNewestPoseAsFarAroundAsItMoved) {
  const PoseEstimate newest = moving({0, 3, 0}, {0.9, 0, 0});
  const auto was = observe::where_it_was(newest, newest.time + 100ms, kRadius, true);
  ASSERT_TRUE(was);
  EXPECT_EQ(was->world_from_object.translation, newest.world_from_object.translation);
  EXPECT_TRUE(was->ambiguous);
  // In every direction: 0.3 rad and 90 mm, shared by three axes.
  EXPECT_TRUE(variances(*was, 0).isApproxToConstant(0.3 * 0.3 / 3 + 1e-6, 1e-9));
  EXPECT_TRUE(variances(*was, 3).isApproxToConstant(0.09 * 0.09 / 3 + 1e-6, 1e-9));
}

TEST(SecondLook, IsNotForWhatHardlyMovedOrWasNotThere) {
  const PoseEstimate fast = moving({0, 3, 0}, {0.9, 0, 0});
  const auto at = [&](const PoseEstimate& newest, Duration later) {
    return observe::where_it_was(newest, newest.time + later, kRadius, false).has_value();
  };
  EXPECT_TRUE(at(fast, 33ms));
  EXPECT_FALSE(at(moving({0, 0.1, 0}, {0.05, 0, 0}), 33ms)) << "2 mm";
  EXPECT_FALSE(at(fast, 0ms)) << "the very frame";
  EXPECT_FALSE(at(fast, 101ms)) << "its prediction is wide by now";
  PoseEstimate lost = fast;
  lost.state = TrackState::kLost;
  EXPECT_FALSE(at(lost, 33ms));
}

TEST(SecondLook, IsCalledForByWhatIsNotSeenOrElsewhere) {
  Prediction prediction{Rigid3(), Matrix6::Identity() * 1e-4};
  observe::ModelTracker::Measurement measurement;
  EXPECT_TRUE(observe::calls_for_second_look(prediction, measurement)) << "not seen";
  EXPECT_EQ(observe::agreement(measurement.result), 0);
  measurement.result.seen = true;
  measurement.result.evidence = 0.8;
  measurement.result.lines_total = 200;
  measurement.result.lines_used = 150;
  measurement.fitted = prediction.world_from_object;
  EXPECT_FALSE(observe::calls_for_second_look(prediction, measurement));
  EXPECT_NEAR(observe::agreement(measurement.result), 0.6, 1e-12);
  Vector6 off = Vector6::Zero();
  off[4] = 0.03;  // 3 sigmas
  measurement.fitted = Rigid3::exp(off);
  EXPECT_FALSE(observe::calls_for_second_look(prediction, measurement));
  off[4] = 0.04;
  measurement.fitted = Rigid3::exp(off);
  EXPECT_TRUE(observe::calls_for_second_look(prediction, measurement));
}

}  // namespace
}  // namespace sightline
