// SPDX-License-Identifier: Apache-2.0
#include "observe/terms/rig_pose.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "observe/features/feature_match.hpp"
#include "observe/print_scene.hpp"
#include "support/matchers.hpp"
#include "support/random.hpp"

namespace sightline::observe {
namespace {

using test::PoseNear;
using test::Random;

constexpr double kDegree = std::numbers::pi / 180;

// Cameras on a circle of 0.7 m about the origin that look at it, and what is there.
class Scene {
 public:
  explicit Scene(std::vector<double> azimuths_deg, std::vector<double> seconds = {},
                 LensModel lens = LensModel::kBrownConrady) {
    for (size_t i = 0; i < azimuths_deg.size(); ++i) {
      CalibratedCamera camera = test::test_camera(lens);
      const double a = azimuths_deg[i] * kDegree;
      const Eigen::Vector3d eye(0.7 * std::cos(a), 0.7 * std::sin(a), 0.3);
      Eigen::Matrix3d axes;  // x right, y down, z forward
      axes.col(2) = -eye.normalized();
      axes.col(0) = axes.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
      axes.col(1) = axes.col(2).cross(axes.col(0));
      camera.world_from_camera = Rigid3(Eigen::Quaterniond(axes), eye);
      views.push_back({std::make_shared<const CalibratedCamera>(std::move(camera)),
                       i < seconds.size() ? seconds[i] : 0});
    }
  }

  // `count` right matches in a view, of points in a box of these half sides about the origin;
  // their surface faces the camera, or as `normal` says.
  void see(size_t view, const RigMotion& motion, int count, const Eigen::Vector3d& half,
           double noise_px, Random& random, const Eigen::Vector3d& normal = {0, 0, 0}) {
    const Rigid3 camera_from_object =
        views[view].camera->world_from_camera.inverse() * motion.at(views[view].seconds);
    const Eigen::Vector3d eye = camera_from_object.inverse().translation;
    const CameraModel& model = views[view].camera->model;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d point = somewhere_in(half, random);
      const auto pixel = model.project(camera_from_object * point);
      ASSERT_TRUE(pixel.has_value());
      const ImagePatch seen = somehow_at(model, *pixel, random);
      const Eigen::Vector3d facing = normal.isZero() ? (eye - point).normalized() : normal;
      const SurfacePatch here = surface_patch(seen, camera_from_object.rotation * facing,
                                              (camera_from_object * point).norm());
      const auto in_object = [&](const Eigen::Vector3d& axis) -> Eigen::Vector3d {
        return camera_from_object.rotation.inverse() * axis;
      };
      matches.push_back({view,
                         {point, *pixel + noise_px * random.normal<2>(), std::max(0.2, noise_px)},
                         {in_object(here.seen_from), facing, in_object(here.direction), here.size},
                         seen});
      matches.back().seen.ray = model.unproject(matches.back().match.pixel)->normalized();
    }
  }
  // Wrong ones.
  void mislead(size_t view, int count, const Eigen::Vector3d& half, Random& random) {
    for (int i = 0; i < count; ++i) {
      const CameraModel& model = views[view].camera->model;
      const Eigen::Vector2d pixel(random.uniform(5, model.width() - 5),
                                  random.uniform(5, model.height() - 5));
      const Eigen::Vector3d normal = random.normal<3>().normalized();
      const Eigen::Vector3d seen_from = (normal + 0.5 * random.normal<3>()).normalized();
      matches.push_back({view,
                         {somewhere_in(half, random), pixel, 0.5},
                         {seen_from, normal, normal.cross(random.normal<3>()).normalized(),
                          random.uniform(0.015, 0.06)},
                         somehow_at(model, pixel, random)});
    }
  }

  std::vector<RigView> views;
  std::vector<RigMatch> matches;

 private:
  static Eigen::Vector3d somewhere_in(const Eigen::Vector3d& half, Random& random) {
    return half.cwiseProduct(
        Eigen::Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)));
  }
  static ImagePatch somehow_at(const CameraModel& model, const Eigen::Vector2d& pixel,
                               Random& random) {
    return image_patch(model, pixel, random.uniform(-3, 3), random.uniform(15, 30)).value();
  }
};

RigMotion somewhere(uint64_t seed) {
  Random random(seed);
  Vector6 place;
  place << random.normal<3>(), 0.04 * random.normal<3>();
  return {Rigid3::exp(place)};
}

const Eigen::Vector3d kBox(0.06, 0.04, 0.03);
const Eigen::Vector3d kSheet(0.06, 0.04, 0);

TEST(RigPose, GradientIsTheDerivativeOfTheCost) {
  Random random(3);
  for (const LensModel lens : {LensModel::kBrownConrady, LensModel::kFisheye}) {
    Scene scene({0, 70}, {0, -0.03}, lens);
    RigMotion motion = somewhere(5);
    motion.twist << 0.5, -1.2, 0.7, 0.3, -0.2, 0.1;
    for (size_t view = 0; view < 2; ++view) scene.see(view, motion, 20, kBox, 0.5, random);
    const RigPose pose = judge_rig(scene.views, scene.matches, motion, {}, 5);
    ASSERT_EQ(pose.inliers.size(), 40u);
    RigMotion beside = motion;  // away from the minimum
    Vector6 off;
    off << 0.004, -0.003, 0.005, 0.0004, -0.0003, 0.0005;
    beside.world_from_object = beside.world_from_object * Rigid3::exp(off);
    const MotionSystem at = linearize_rig(pose.terms, scene.views, beside);
    for (int i = 0; i < 12; ++i) {
      const auto cost_at = [&](double step) {
        RigMotion moved = beside;
        Vector6 d = Vector6::Zero();
        d[i % 6] = step;
        if (i < 6) {
          moved.world_from_object = moved.world_from_object * Rigid3::exp(d);
        } else {
          moved.twist += d;
        }
        return linearize_rig(pose.terms, scene.views, moved).cost;
      };
      const double numeric = (cost_at(1e-6) - cost_at(-1e-6)) / 2e-6;
      EXPECT_NEAR(at.gradient[i], numeric, 1e-4 * (1 + at.gradient.norm())) << i;
    }
    EXPECT_TRUE(at.information.isApprox(at.information.transpose(), 1e-9));
  }
}

TEST(RigPose, ComesOutOfManyWrongMatchesInAllCameras) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Random random(seed);
    Scene scene({0, 60, 200});
    const RigMotion truth = somewhere(seed);
    for (size_t view = 0; view < 3; ++view) {
      scene.see(view, truth, 15, kBox, 0.5, random);
      scene.mislead(view, 60, kBox, random);
    }
    const auto poses = solve_rig(scene.views, scene.matches);
    ASSERT_FALSE(poses.empty()) << seed;
    EXPECT_THAT(poses[0].motion.world_from_object, PoseNear(truth.world_from_object, 0.02, 0.001))
        << seed;
    EXPECT_GE(poses[0].inliers.size(), 40u) << seed;
    EXPECT_LE(poses[0].inliers.size(), 50u) << seed;
  }
}

// No camera has enough by itself: one has the samples, the others only agree.
TEST(RigPose, CamerasThatSeeLittleHelp) {
  double alone = 0, together = 0;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Random random(seed);
    Scene scene({0, 90, 180});
    const RigMotion truth = somewhere(seed);
    scene.see(0, truth, 8, kBox, 0.7, random);
    const auto one = solve_rig(scene.views, scene.matches);
    ASSERT_FALSE(one.empty());
    alone += translation_distance(one[0].motion.world_from_object, truth.world_from_object);
    for (size_t view = 1; view < 3; ++view) scene.see(view, truth, 3, kBox, 0.7, random);
    const auto all = solve_rig(scene.views, scene.matches);
    ASSERT_FALSE(all.empty());
    together += translation_distance(all[0].motion.world_from_object, truth.world_from_object);
  }
  EXPECT_LT(together, 0.6 * alone);
}

// A sheet far away, almost without perspective: one image leaves two poses, which are both named;
// a second image leaves one.
TEST(RigPose, BothPosesOfASheetAreNamed) {
  int both = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    Random random(seed);
    Scene scene({0, 70});
    // Its normal 30 degrees from the first camera's line of sight.
    const Rigid3& eye = scene.views[0].camera->world_from_camera;
    const Rigid3 tilted(
        eye.rotation *
            Eigen::AngleAxisd((180 - 30) * kDegree,
                              Eigen::Vector3d(std::cos(double(seed)), std::sin(double(seed)), 0)),
        Eigen::Vector3d::Zero());
    const RigMotion truth{tilted};
    const Eigen::Vector3d small = 0.4 * kSheet;
    scene.see(0, truth, 40, small, 0.5, random, Eigen::Vector3d::UnitZ());
    const auto poses = solve_rig(scene.views, scene.matches);
    ASSERT_FALSE(poses.empty());
    const auto near = [&](const RigPose& pose) {
      return rotation_angle(pose.motion.world_from_object, truth.world_from_object) < 0.2;
    };
    EXPECT_TRUE(std::any_of(poses.begin(), poses.end(), near)) << seed;
    both += poses.size() > 1 && rotation_angle(poses[0].motion.world_from_object,
                                               poses[1].motion.world_from_object) > 40 * kDegree;
    scene.see(1, truth, 40, small, 0.5, random);  // it may see its back
    const auto decided = solve_rig(scene.views, scene.matches);
    ASSERT_FALSE(decided.empty());
    EXPECT_TRUE(near(decided[0])) << seed;
    EXPECT_TRUE(decided.size() == 1 || decided[1].support < 0.8 * decided[0].support) << seed;
  }
  EXPECT_GE(both, 6);
}

TEST(RigPose, ImagesOfDifferentTimesHaveAVelocityInCommon) {
  Random random(8);
  Scene scene({0, 80, 160}, {-0.030, -0.012, 0});
  RigMotion truth = somewhere(9);
  truth.twist << 0.4, 0.8, -0.5, 0.4, -0.3, 0.2;
  for (size_t view = 0; view < 3; ++view) {
    scene.see(view, truth, 40, kBox, 0.4, random);
    scene.mislead(view, 40, kBox, random);
  }
  const auto poses = solve_rig(scene.views, scene.matches);
  ASSERT_FALSE(poses.empty());
  EXPECT_THAT(poses[0].motion.world_from_object, PoseNear(truth.world_from_object, 0.03, 0.002));
  EXPECT_LT((poses[0].motion.twist - truth.twist).tail<3>().norm(), 0.15);
}

// Normalized squared errors of many poses: chi-square with six degrees of freedom.
TEST(RigPose, CovarianceIsHonest) {
  double sum = 0;
  constexpr int kPoses = 60;
  for (uint64_t seed = 1; seed <= kPoses; ++seed) {
    Random random(seed);
    Scene scene({0, 60});
    const RigMotion truth = somewhere(seed);
    for (size_t view = 0; view < 2; ++view) scene.see(view, truth, 25, kBox, 0.6, random);
    RigPoseOptions options;
    options.view_error = {};
    const auto poses = solve_rig(scene.views, scene.matches, options);
    ASSERT_FALSE(poses.empty());
    const Vector6 error = difference(poses[0].motion.world_from_object, truth.world_from_object);
    const Matrix6 information = linearize_rig(poses[0].terms, scene.views, poses[0].motion)
                                    .information.topLeftCorner<6, 6>();
    sum += error.dot(information * error);
  }
  EXPECT_GT(sum / kPoses, 4.5);
  EXPECT_LT(sum / kPoses, 8.5);
}

// Pixels by chance are many; of these few look as they should as well.
TEST(RigPose, PatchesThatLookOtherwiseSupportNothing) {
  Random random(12);
  Scene scene({0});
  const RigMotion truth = somewhere(3);
  scene.see(0, truth, 20, kBox, 0.3, random);
  ASSERT_EQ(judge_rig(scene.views, scene.matches, truth, {}, 3).inliers.size(), 20u);
  for (size_t i = 0; i < 15; ++i) {
    RigMatch& match = scene.matches[i];
    if (i < 5) match.seen.size *= 2;
    if (i >= 5 && i < 10) match.seen.direction = match.seen.ray.cross(match.seen.direction);
    if (i >= 10) match.trained.normal *= -1;
  }
  EXPECT_EQ(judge_rig(scene.views, scene.matches, truth, {}, 3).inliers.size(), 5u);
}

TEST(RigPose, SaysNothingOfTooLittle) {
  Random random(1);
  Scene scene({0, 60});
  EXPECT_TRUE(solve_rig(scene.views, scene.matches).empty());
  scene.see(0, somewhere(1), 3, kBox, 0.1, random);
  EXPECT_TRUE(solve_rig(scene.views, scene.matches).empty());
  scene.matches.clear();  // all at one place
  scene.see(0, somewhere(1), 1, kBox, 0.1, random);
  scene.matches.resize(10, scene.matches.front());
  EXPECT_TRUE(solve_rig(scene.views, scene.matches).empty());
}

TEST(RigPose, GivesTheSameTwice) {
  Random random(4);
  Scene scene({0, 60});
  for (size_t view = 0; view < 2; ++view) {
    scene.see(view, somewhere(2), 20, kBox, 0.5, random);
    scene.mislead(view, 80, kBox, random);
  }
  const auto a = solve_rig(scene.views, scene.matches), b = solve_rig(scene.views, scene.matches);
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].motion.world_from_object.matrix(), b[i].motion.world_from_object.matrix());
    EXPECT_EQ(a[i].inliers, b[i].inliers);
  }
}

TEST(FeatureMatch, ProcessorsAgreeAndPlacesAreToldApart) {
  Random random(6);
  std::vector<OrbFeature> seen(300);
  std::vector<TrainedFeature> trained(500);
  for (auto& feature : trained) {
    feature.point = (0.05 * random.normal<3>()).cast<float>();
    for (uint8_t& byte : feature.descriptor) byte = static_cast<uint8_t>(random.bits());
  }
  for (size_t i = 0; i < seen.size(); ++i) {
    seen[i].descriptor = trained[i].descriptor;
    seen[i].descriptor[i % 32] ^= 0x11;  // two bits
  }
  trained[400] = trained[7];                        // learned twice
  trained[401].descriptor = trained[8].descriptor;  // the same print at another place
  std::vector<NearestTrained> out(seen.size()), again(seen.size());
  const TrainedDescriptors descriptors(trained);
  match_features(seen, descriptors, 0.005f, out);
  match_features_scalar(seen, descriptors, 0.005f, again);
  for (size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(out[i].index, i);
    EXPECT_EQ(out[i].bits, 2);
    EXPECT_EQ(out[i].index, again[i].index);
    EXPECT_EQ(out[i].bits, again[i].bits);
    EXPECT_EQ(out[i].other, again[i].other);
  }
  EXPECT_GT(out[7].other, 60);
  EXPECT_EQ(out[8].other, 2);
  // Too much of its first half is another's.
  for (size_t i = 0; i < 7; ++i)
    seen[20].descriptor[i] = static_cast<uint8_t>(~seen[20].descriptor[i]);
  match_features(seen, descriptors, 0.005f, out);
  EXPECT_NE(out[20].index, 20u);
}

}  // namespace
}  // namespace sightline::observe
