// SPDX-License-Identifier: Apache-2.0
// What is small in an image is looked at closely at full size.
#include <gtest/gtest.h>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "sized_scene.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

using test::turned;

constexpr double kDistance = 2.0;  // [m]

DetectorOptions range(double nearest, double farthest) {
  DetectorOptions out;
  out.nearest = nearest;
  out.farthest = farthest;
  return out;
}

const DetectorOptions kFar = range(0.6 * kDistance, 1.5 * kDistance);
const DetectorOptions kNear = range(0.1, 0.2);  // where it is large

// A truck so far from three cameras that it is small in their images.
test::SceneRigOptions far_truck() {
  return SizedScene::options(test::make_truck(), {0.03, -0.02, 0.01}, kDistance);
}

const SizedScene& scene() {
  static const SizedScene made(far_truck());
  return made;
}

TEST(Magnified, CameraSeesTheSamePointsAtTwiceTheSize) {
  const CalibratedCamera& camera = scene().cameras[0].calibration;
  const auto twice = magnified(camera);
  ASSERT_TRUE(twice);
  EXPECT_EQ(twice->model.width(), 2 * camera.model.width());
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0.1, -0.2, 1), Eigen::Vector3d(-0.3, 0.1, 1.5), Eigen::Vector3d(0, 0, 2)}) {
    const auto pixel = camera.model.project(point), there = twice->model.project(point);
    ASSERT_TRUE(pixel && there);
    // Corners of the image stay corners: both count from the middle of their first pixel.
    const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);
    EXPECT_LT((*there + half - 2 * (*pixel + half)).norm(), 1e-9);
  }
}

TEST(Magnified, ImageIsTheFrameAsItIs) {
  HalfSizeFrame kept;
  const auto frame = scene().rig.shoot(scene().rig.shots().front());
  const auto camera = static_cast<size_t>(scene().rig.shots().front().camera);
  const CameraModel& model = scene().cameras[camera].calibration.model;
  kept.store(*frame, model);
  EXPECT_TRUE(kept.full_luma.empty()) << "not wanted";
  kept.store(*frame, model, 1, true);
  HalfSizeImage magnified;
  kept.magnify(magnified, {0, 0, model.width(), model.height()});
  ASSERT_EQ(magnified.width, model.width());
  ASSERT_EQ(magnified.height, model.height());
  const PlaneView luma = frame->gray();
  for (int y = 0; y < model.height(); y += 7) {
    for (int x = 0; x < model.width(); x += 3) {
      ASSERT_EQ(magnified.row(0, y)[x], luma.row(y)[x]);
      ASSERT_EQ(magnified.row(1, y)[x], kept.image.row(1, y / 2)[x / 2]);
      ASSERT_EQ(magnified.row(2, y)[x], kept.image.row(2, y / 2)[x / 2]);
    }
  }
}

TEST(Magnified, OnlyWhereTheObjectIsSmall) {
  const DetectorFrames frames = scene().frames(kFar);
  const PoseFitter& fitter = scene().fitter;
  for (const FitCamera& camera : frames.fit_cameras()) {
    ASSERT_NE(camera.magnified, nullptr);
    EXPECT_EQ(camera.magnified->camera()->image->width, 2 * camera.image->width);
    const double fx = camera.camera->model.parameters().fx;
    const double edge = fx * fitter.width() / kSmallObjectPx;  // [m] from the camera
    EXPECT_EQ(&fitter.look(camera, scene().before(camera, 1.1 * edge)), camera.magnified->camera());
    EXPECT_EQ(&fitter.look(camera, scene().before(camera, 0.9 * edge)), &camera);
  }
  // Told that it comes no farther than where it is large, nothing is kept at full size.
  const DetectorFrames large = scene().frames(kNear);
  for (const FitCamera& camera : large.fit_cameras()) EXPECT_EQ(camera.magnified, nullptr);
}

TEST(Magnified, NotWhereNoiseWouldHideTheEdges) {
  test::SceneRigOptions options = far_truck();
  options.sensor.read_noise = 6;
  const SizedScene noisy(options);
  const DetectorFrames frames = noisy.frames(kFar);
  for (const FitCamera& camera : frames.fit_cameras()) {
    EXPECT_EQ(&noisy.fitter.look(camera, noisy.truth), &camera);
  }
}

TEST(Magnified, FitsAreNearerToTheTruth) {
  const PoseFitter& fitter = scene().fitter;
  double error[2] = {0, 0};
  for (const bool magnify : {false, true}) {
    const DetectorFrames frames = scene().frames(magnify ? kFar : kNear);
    for (const double angle : {-0.06, 0.06}) {
      const Rigid3 start = scene().truth * turned(angle, {1, 0, 1}, {0.004, 0.003, -0.004});
      const PoseFit fit = fitter.fit(frames.fit_cameras(), {start, Vector6::Zero()}, kSearchReach);
      for (const CameraFit& camera : fit.cameras) EXPECT_EQ(camera.pixel_size < 2, magnify);
      error[magnify] += rotation_angle(fit.motion.world_from_object, scene().truth);
    }
  }
  EXPECT_LT(error[1], error[0]);
  EXPECT_LT(error[1], 2 * 0.03) << "[rad], the sum of two";
}

TEST(Magnified, ReachesAsFarForWhatHasMoved) {
  const PoseFitter& fitter = scene().fitter;
  const DetectorFrames frames = scene().frames(kFar);
  const double fx = scene().cameras[0].calibration.model.parameters().fx;
  const double shift = 2 * kSearchReach * kDistance / fx;  // twice the reach at full size
  // Left, right, up, down, near and far: how many are found again.
  const auto found = [&](bool moved) {
    int count = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {-1.0, 1.0}) {
        Rigid3 start = scene().truth;
        start.translation[axis] += sign * shift;
        const PoseFit fit = fitter.fit(frames.fit_cameras(), {start, Vector6::Zero()}, kSearchReach,
                                       {.moved = moved});
        count += translation_distance(fit.motion.world_from_object, scene().truth) < 0.006;
      }
    }
    return count;
  };
  EXPECT_EQ(found(true), 6);
  EXPECT_LT(found(false), 4) << "or it need not be said";
}

TEST(Magnified, ForegroundIsThatOfTheHalfSize) {
  const ForegroundMap map = foreground_in(320, 240, 140, 100, 180, 140);
  const DetectorFrames frames = scene().frames(kFar, &map);
  for (const FitCamera& camera : frames.fit_cameras()) {
    ASSERT_NE(camera.magnified, nullptr);
    const ForegroundMap* large = camera.magnified->camera()->foreground;
    ASSERT_NE(large, nullptr);
    ASSERT_EQ(large->width, 2 * map.width);
    for (int y = 0; y < large->height; ++y) {
      for (int x = 0; x < large->width; ++x) {
        ASSERT_EQ(large->row(y)[x], map.row(y / 2)[x / 2]);
        // Edges count near to it only, at either size.
        if (x < 260 || x > 380 || y < 180 || y > 300) {
          ASSERT_EQ(
              camera.magnified->camera()->edges->bins()[static_cast<size_t>(y * large->width + x)],
              0);
        }
      }
    }
  }
}

}  // namespace
}  // namespace sightline::observe
