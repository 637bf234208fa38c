// SPDX-License-Identifier: Apache-2.0
// What all measurements share: the robust loss, errors in common, the header of an observation.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "observe/terms/image_colors.hpp"
#include "observe/terms/rig_motion.hpp"
#include "observe/terms/robust_loss.hpp"
#include "observe/terms/shared_error.hpp"
#include "sightline/observe/terms/observation_header.hpp"

namespace sightline::observe {
namespace {

TEST(ImageColors, GraysOfOneTintAreNone) {
  constexpr int kWidth = 64, kHeight = 48;
  std::vector<uint8_t> u(kWidth * kHeight, 128), v(kWidth * kHeight, 121);
  const PlaneView tinted{v.data(), kWidth, kHeight, kWidth};
  const PlaneView plain{u.data(), kWidth, kHeight, kWidth};
  EXPECT_FALSE(has_colors(plain, tinted));
  for (size_t i = 0; i < u.size(); ++i) u[i] = static_cast<uint8_t>(126 + i % 5);
  EXPECT_FALSE(has_colors(plain, tinted)) << "noise of compressed video";
  for (int y = 10; y < 30; ++y) std::fill_n(&v[static_cast<size_t>(y * kWidth + 10)], 20, 140);
  EXPECT_TRUE(has_colors(plain, tinted)) << "one thing in color";
  EXPECT_FALSE(has_colors({}, {})) << "no pixels";
}

TEST(HuberLoss, WeightIsTheSlopeOverTheError) {
  const HuberLoss loss(2.0);
  for (const double error : {0.1, 1.0, 1.999, 2.001, 5.0, 100.0}) {
    const double slope = (loss.cost(error + 1e-6) - loss.cost(error - 1e-6)) / 2e-6;
    EXPECT_NEAR(loss.weight(error) * error, slope, 1e-6) << error;
  }
  EXPECT_EQ(loss.weight(0), 1);
  EXPECT_EQ(loss.cost(0), 0);
  EXPECT_DOUBLE_EQ(loss.cost(2), 2);
}

// One scalar residual of a pose, and of an offset and a slope that all residuals share.
struct Line {
  Vector6 by_pose;
  Eigen::Vector2d by_shared;
  double value;

  double error(const Eigen::Vector2d& shared) const {
    return std::abs(value - by_shared.dot(shared));
  }
  void add_shared(double weight, Eigen::Matrix2d& information, Eigen::Vector2d& right) const {
    information += weight * by_shared * by_shared.transpose();
    right += weight * value * by_shared;
  }
};

TEST(SharedError, EliminationIsTheMarginalOfBoth) {
  std::vector<Line> lines;
  const Eigen::Vector2d prior(3, 5);
  Eigen::Matrix<double, 8, 8> both = Eigen::Matrix<double, 8, 8>::Zero();
  both.diagonal().tail<2>() = prior;
  LinearizedTerm term;
  Eigen::Matrix<double, 6, 2> pose_by_shared = Eigen::Matrix<double, 6, 2>::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (int i = 0; i < 12; ++i) {
    Line line;
    for (int k = 0; k < 6; ++k) line.by_pose[k] = std::sin(1.7 * i * (k + 1) + k);
    line.by_shared = {1, 0.1 * i};
    line.value = 0.5 + 0.01 * i;
    lines.push_back(line);
    Eigen::Matrix<double, 8, 1> row;
    row << line.by_pose, line.by_shared;
    both += row * row.transpose();
    term.information += line.by_pose * line.by_pose.transpose();
    pose_by_shared += line.by_pose * line.by_shared.transpose();
    right += line.value * line.by_shared;
  }
  SharedError<2> shared;
  shared.minimize(lines, prior, HuberLoss(10), 30, 1e-16);
  const Eigen::Vector2d solved = both.bottomRightCorner<2, 2>().inverse() * right;
  EXPECT_LT((shared.value - solved).norm(), 1e-9);
  shared.eliminate(pose_by_shared, term);
  const Matrix6 marginal = both.inverse().topLeftCorner<6, 6>();
  EXPECT_LT((term.information.inverse() - marginal).norm(), 1e-9 * marginal.norm());
}

TEST(MotionSystem, StartsAsThePriorOfTheTwist) {
  Vector6 twist = Vector6::Zero();
  twist[0] = kTwistSigmaAngular;
  twist[5] = 2 * kTwistSigmaLinear;
  EXPECT_NEAR(twist_cost(twist), 0.5 * (1 + 4), 1e-12);
  const MotionSystem system(twist);
  EXPECT_NEAR(system.cost, twist_cost(twist), 1e-12);
  EXPECT_NEAR(system.gradient[6], 1 / kTwistSigmaAngular, 1e-12);
  EXPECT_TRUE((system.information.topLeftCorner<6, 6>().isZero()));
}

TEST(MotionJacobian, IsTheDerivativeOfThePoseAtItsTime) {
  RigMotion motion;
  motion.world_from_object = Rigid3::exp((Vector6() << 0.3, -0.2, 0.1, 0.5, 0.2, 1).finished());
  motion.twist << 1, -2, 0.5, 0.3, 0.1, -0.4;
  constexpr double kSeconds = 0.08;
  const Matrix6x12 jacobian = motion_jacobian(motion.twist, kSeconds);
  for (int i = 0; i < 12; ++i) {
    Vector12 d = Vector12::Zero();
    d[i] = 1e-6;
    const RigMotion moved{motion.world_from_object * Rigid3::exp(d.head<6>()),
                          motion.twist + d.tail<6>()};
    const Vector6 numeric = (motion.at(kSeconds).inverse() * moved.at(kSeconds)).log() / 1e-6;
    EXPECT_LT((jacobian.col(i) - numeric).norm(), 1e-5) << i;
  }
  const Matrix6x12 first_order = motion_jacobian_first_order(motion.twist, kSeconds);
  EXPECT_LT((first_order - jacobian).norm(), 0.1 * jacobian.norm());
}

TEST(MakeObservation, HasEverythingThatTheFrameKnowsOfItsTime) {
  FrameInfo info;
  info.camera = CameraId(7);
  info.epoch = 2;
  info.sequence = 40;
  info.capture = Time(Duration(123456789));
  info.capture_error = std::chrono::microseconds(250);
  const Observation made = make_observation(info, CameraId(1), ObjectId(3));
  EXPECT_EQ(made.camera, CameraId(1)) << "the caller's";
  EXPECT_EQ(made.object, ObjectId(3));
  EXPECT_EQ(made.epoch, info.epoch);
  EXPECT_EQ(made.sequence, info.sequence);
  EXPECT_EQ(made.capture, info.capture);
  EXPECT_EQ(made.capture_error, info.capture_error);
  EXPECT_TRUE(made.terms.empty());
}

}  // namespace
}  // namespace sightline::observe
