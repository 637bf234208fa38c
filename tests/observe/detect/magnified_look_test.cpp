// SPDX-License-Identifier: Apache-2.0
// What is small in an image is looked at closely at full size.
#include <gtest/gtest.h>

#include "observe/detect/contour_search.hpp"
#include "observe/detect/detect_constants.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/plan/search_distances.hpp"
#include "observe/detect/pose_fit.hpp"
#include "observe/detect/template_bank.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

using test::turned;

constexpr double kDistance = 2.0;  // [m]

// A truck at rest so far from three cameras that it is small in their images.
struct FarScene {
  FarScene()
      : rig(options()), cameras(test::detector_cameras(rig)), views(test::views_of(shape())) {
    truth = rig.truth(rig.shots().front().true_capture);
    detector.nearest = 0.6 * kDistance;
    detector.farthest = 1.5 * kDistance;
  }
  static TriangleMesh shape() { return test::make_truck(); }
  static test::SceneRigOptions options() {
    auto out =
        test::search_scene(shape(), test::resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01})));
    out.distance = kDistance;
    return out;
  }

  DetectorFrames frames(bool magnify) const {
    DetectorFrames out(cameras, detector);
    const PoseFitter fitter(*views);
    if (magnify) {
      out.show_at_its_size(search_distances(cameras, views->radius(), detector), fitter.width());
    }
    test::add_first_frames(rig,
                           [&](CameraId id, const Frame& frame) { out.add(id, frame, nullptr); });
    EXPECT_TRUE(out.select(DetectorFrames::Where::kEverywhere));
    return out;
  }

  test::SceneRig rig;
  std::vector<DetectorCamera> cameras;
  std::shared_ptr<const ViewpointModel> views;
  Rigid3 truth;
  DetectorOptions detector;
};

const FarScene& scene() {
  static const FarScene made;
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
  ASSERT_TRUE(kept.store(*frame, model));
  EXPECT_TRUE(kept.full_luma.empty()) << "not wanted";
  ASSERT_TRUE(kept.store(*frame, model, true));
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
  const DetectorFrames frames = scene().frames(true);
  const PoseFitter fitter(*scene().views);
  for (const FitCamera& camera : frames.fit_cameras()) {
    ASSERT_NE(camera.magnified, nullptr);
    EXPECT_EQ(camera.magnified->camera()->image->width, 2 * camera.image->width);
    const double fx = camera.camera->model.parameters().fx;
    const double edge = fx * fitter.width() / kSmallObjectPx;  // [m] from the camera
    const Eigen::Vector3d axis = camera.camera->world_from_camera.rotation_matrix().col(2);
    const Rigid3 eye(Eigen::Quaterniond::Identity(),
                     camera.camera->world_from_camera.translation - scene().views->center());
    const auto at = [&](double distance) {
      return Rigid3(eye.rotation, eye.translation + distance * axis);
    };
    EXPECT_EQ(&fitter.look(camera, at(1.1 * edge)), camera.magnified->camera());
    EXPECT_EQ(&fitter.look(camera, at(0.9 * edge)), &camera);
  }
  // Told that it comes no farther than where it is large, nothing is kept at full size.
  DetectorOptions near = scene().detector;
  near.nearest = 0.1;
  near.farthest = 0.2;
  DetectorFrames large(scene().cameras, near);
  large.show_at_its_size(search_distances(scene().cameras, scene().views->radius(), near),
                         fitter.width());
  test::add_first_frames(scene().rig,
                         [&](CameraId id, const Frame& frame) { large.add(id, frame, nullptr); });
  ASSERT_TRUE(large.select(DetectorFrames::Where::kEverywhere));
  for (const FitCamera& camera : large.fit_cameras()) EXPECT_EQ(camera.magnified, nullptr);
}

TEST(Magnified, NotWhereNoiseWouldHideTheEdges) {
  test::SceneRigOptions options = FarScene::options();
  options.sensor.read_noise = 6;
  const test::SceneRig noisy(options);
  DetectorFrames frames(test::detector_cameras(noisy), scene().detector);
  const PoseFitter fitter(*scene().views);
  frames.show_at_its_size(
      search_distances(scene().cameras, scene().views->radius(), scene().detector), fitter.width());
  test::add_first_frames(noisy,
                         [&](CameraId id, const Frame& frame) { frames.add(id, frame, nullptr); });
  ASSERT_TRUE(frames.select(DetectorFrames::Where::kEverywhere));
  for (const FitCamera& camera : frames.fit_cameras()) {
    EXPECT_EQ(&fitter.look(camera, scene().truth), &camera);
  }
}

TEST(Magnified, FitsAreNearerToTheTruth) {
  const PoseFitter fitter(*scene().views);
  double error[2] = {0, 0};
  for (const bool magnify : {false, true}) {
    const DetectorFrames frames = scene().frames(magnify);
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
  const PoseFitter fitter(*scene().views);
  const DetectorFrames frames = scene().frames(true);
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
  DetectorFrames frames(scene().cameras, scene().detector);
  const PoseFitter fitter(*scene().views);
  frames.show_at_its_size(
      search_distances(scene().cameras, scene().views->radius(), scene().detector), fitter.width());
  ForegroundMap map;
  test::add_first_frames(scene().rig, [&](CameraId id, const Frame& frame) {
    map.width = frame.half_gray().width;
    map.height = frame.half_gray().height;
    map.classes.assign(static_cast<size_t>(map.width) * static_cast<size_t>(map.height),
                       ForegroundMap::kBackground);
    for (int y = 100; y < 140; ++y) {
      for (int x = 140; x < 180; ++x) {
        map.classes[static_cast<size_t>(y * map.width + x)] = ForegroundMap::kForeground;
      }
    }
    map.share = 0.02;
    frames.add(id, frame, &map);
  });
  ASSERT_TRUE(frames.select(DetectorFrames::Where::kForeground));
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
