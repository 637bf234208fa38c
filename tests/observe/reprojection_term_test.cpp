// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/terms/reprojection_term.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <random>

#include "print_scene.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::MatrixNear;

constexpr double kHuber = 2.5;

/// A rig camera, an object pose in front of it and matches with noise; every third one is far off.
struct Setting {
  std::shared_ptr<const CalibratedCamera> camera;
  Rigid3 world_from_object;
  std::vector<PointMatch> matches;
};
Setting make_setting(LensModel lens, double outlier_px) {
  CalibratedCamera camera = test::test_camera(lens);
  Vector6 place;
  place << 0.3, -0.2, 0.5, 0.4, -0.1, 0.2;
  camera.world_from_camera = Rigid3::exp(place);
  Setting out;
  out.world_from_object = camera.world_from_camera *
                          Rigid3(Eigen::Quaterniond(0.3, 0.8, -0.2, 0.1), {0.05, -0.03, 0.9});
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place_of(-0.08, 0.08);
  std::normal_distribution<double> noise(0, 0.3);
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d point(place_of(random), place_of(random), place_of(random));
    const auto pixel =
        camera.model.project(camera.world_from_camera.inverse() * (out.world_from_object * point));
    Eigen::Vector2d seen = pixel.value() + Eigen::Vector2d(noise(random), noise(random));
    if (i % 3 == 0) seen.x() += outlier_px;
    out.matches.push_back({point, seen, 0.2 + 0.05 * (i % 2)});
  }
  out.camera = std::make_shared<const CalibratedCamera>(camera);
  return out;
}

TEST(ReprojectionTerm, GradientIsTheDerivativeOfTheCost) {
  for (LensModel lens : {LensModel::kBrownConrady, LensModel::kFisheye}) {
    const Setting s = make_setting(lens, 8.0);
    for (const ViewError& wrong : {ViewError{}, ViewError{0.8, 0}, ViewError{0.8, 0.01}}) {
      const ReprojectionTerm term(s.camera, s.matches, kHuber, wrong);
      const LinearizedTerm at = term.linearize(s.world_from_object);
      for (int i = 0; i < 6; ++i) {
        Vector6 d = Vector6::Zero();
        d[i] = 1e-6;
        const double up = term.linearize(s.world_from_object * Rigid3::exp(d)).cost;
        const double down = term.linearize(s.world_from_object * Rigid3::exp(-d)).cost;
        EXPECT_NEAR(at.gradient[i], (up - down) / 2e-6, 1e-4 * (1 + at.gradient.norm())) << i;
      }
    }
  }
}

TEST(ReprojectionTerm, InformationIsTheSecondDerivativeForExactMatches) {
  Setting s = make_setting(LensModel::kBrownConrady, 0);
  for (PointMatch& m : s.matches) {
    m.pixel = *s.camera->model.project(s.camera->world_from_camera.inverse() *
                                       (s.world_from_object * m.point_in_object));
  }
  for (const ViewError& wrong : {ViewError{}, ViewError{0.8, 0}, ViewError{0.8, 0.01}}) {
    const ReprojectionTerm term(s.camera, s.matches, kHuber, wrong);
    const Matrix6 information = term.linearize(s.world_from_object).information;
    Matrix6 numeric;
    for (int i = 0; i < 6; ++i) {
      Vector6 d = Vector6::Zero();
      d[i] = 1e-6;
      numeric.col(i) = (term.linearize(s.world_from_object * Rigid3::exp(d)).gradient -
                        term.linearize(s.world_from_object * Rigid3::exp(-d)).gradient) /
                       2e-6;
    }
    EXPECT_THAT(numeric, MatrixNear(information, 1e-4 * information.norm()));
  }
}

TEST(ReprojectionTerm, AShiftIsNotAveragedAwayByManyPoints) {
  Setting s = make_setting(LensModel::kBrownConrady, 0);
  // How well the object's lateral place is known from 12 and from 96 corners.
  const auto lateral_px = [&](int copies) {
    std::vector<PointMatch> matches;
    for (int i = 0; i < copies; ++i) {
      matches.insert(matches.end(), s.matches.begin(), s.matches.end());
    }
    const Matrix6 covariance = ReprojectionTerm(s.camera, matches, kHuber, {0.8, 0})
                                   .linearize(s.world_from_object)
                                   .information.inverse();
    const Rigid3 camera_from_object = s.camera->world_from_camera.inverse() * s.world_from_object;
    const Eigen::Matrix3d r = camera_from_object.rotation_matrix();
    const Eigen::Matrix3d place = r * covariance.bottomRightCorner<3, 3>() * r.transpose();
    return std::sqrt(place(0, 0)) / camera_from_object.translation.z() *
           s.camera->model.parameters().fx;
  };
  EXPECT_GT(lateral_px(8), 0.75);
  EXPECT_LT(lateral_px(1), 1.0);
}

TEST(ReprojectionTerm, AnOutlierPullsWithBoundedForce) {
  const Setting near = make_setting(LensModel::kBrownConrady, 20);
  const Setting far = make_setting(LensModel::kBrownConrady, 200);
  const auto a =
      ReprojectionTerm(near.camera, near.matches, kHuber).linearize(near.world_from_object);
  const auto b = ReprojectionTerm(far.camera, far.matches, kHuber).linearize(far.world_from_object);
  EXPECT_LT((a.gradient - b.gradient).norm(), 0.05 * a.gradient.norm());
  EXPECT_LT(a.quality, 0.75);
  EXPECT_GT(a.quality, 0.6);
  EXPECT_EQ(a.residuals, 24);
}

TEST(ReprojectionTerm, PointsBehindTheCameraCostButDoNotPull) {
  const Setting s = make_setting(LensModel::kBrownConrady, 0);
  const ReprojectionTerm term(s.camera, s.matches, kHuber);
  const Rigid3 behind = s.camera->world_from_camera *
                        Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -1));
  const LinearizedTerm at = term.linearize(behind);
  EXPECT_EQ(at.gradient.norm(), 0);
  EXPECT_EQ(at.quality, 0);
  EXPECT_GT(at.cost, 50 * term.linearize(s.world_from_object).cost);
}

}  // namespace
}  // namespace sightline
