// SPDX-License-Identifier: Apache-2.0
// What is large in an image is looked at roughly at a quarter of its size, and what is large before
// one camera counts for more.
#include <gtest/gtest.h>

#include <cmath>

#include "observe/detect/contour_search.hpp"
#include "observe/detect/detect_constants.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/looks/reduced_look.hpp"
#include "observe/detect/pixels/foreground_masks.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "observe/detect/template_bank.hpp"
#include "sized_scene.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

using test::turned;

constexpr double kDistance = 0.2;  // [m]

// A carton, more than 200 px large before each camera.
struct NearScene : SizedScene {
  explicit NearScene(size_t count)
      : SizedScene(options(test::make_carton(), {0.01, -0.01, 0.01}, kDistance, count)) {}
  DetectorFrames frames(const ForegroundMap* foreground = nullptr) const {
    DetectorOptions range;
    range.nearest = 0.6 * kDistance;
    range.farthest = 6 * kDistance;
    return SizedScene::frames(range, foreground);
  }
};

TEST(Reduced, CameraSeesTheSamePointsAtHalfTheSize) {
  const NearScene scene(1);
  const CalibratedCamera& camera = scene.cameras[0].calibration;
  const auto half = reduced(camera);
  ASSERT_TRUE(half);
  EXPECT_EQ(half->model.width(), camera.model.width() / 2);
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0.1, -0.2, 1), Eigen::Vector3d(-0.3, 0.1, 1.5), Eigen::Vector3d(0, 0, 2)}) {
    const auto pixel = camera.model.project(point), there = half->model.project(point);
    ASSERT_TRUE(pixel && there);
    // Corners of the image stay corners: both count from the middle of their first pixel.
    const Eigen::Vector2d middle = Eigen::Vector2d::Constant(0.5);
    EXPECT_LT((2 * (*there + middle) - (*pixel + middle)).norm(), 1e-9);
  }
}

TEST(Reduced, PixelsAreTheMeansOfFour) {
  HalfSizeImage from;
  from.width = 5;  // the last column has no neighbor
  from.height = 4;
  for (size_t plane = 0; plane < 3; ++plane) {
    for (int i = 0; i < 20; ++i) {
      from.planes[plane].push_back(static_cast<uint8_t>(10 * i + static_cast<int>(plane)));
    }
  }
  HalfSizeImage to;
  reduce(from, to);
  ASSERT_EQ(to.width, 2);
  ASSERT_EQ(to.height, 2);
  EXPECT_EQ(to.planes[0], (std::vector<uint8_t>{30, 50, 130, 150}));
  EXPECT_EQ(to.planes[2], (std::vector<uint8_t>{32, 52, 132, 152}));
  std::vector<uint8_t> mask;
  reduce({0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0}, 5, 4, mask);
  EXPECT_EQ(mask, (std::vector<uint8_t>{1, 0, 0, 0}));
}

TEST(Reduced, OnlyRoughlyAndWhereTheObjectIsLarge) {
  const NearScene scene(1);
  const DetectorFrames frames = scene.frames();
  const FitCamera& camera = frames.fit_cameras()[0];
  ASSERT_NE(camera.reduced, nullptr);
  const double edge = camera.camera->model.parameters().fx * scene.fitter.width() / kLargeObjectPx;
  EXPECT_EQ(&scene.fitter.look(camera, scene.before(camera, 0.9 * edge), true),
            &camera.reduced->camera());
  EXPECT_EQ(camera.reduced->camera().image->width, camera.image->width / 2);
  EXPECT_EQ(&scene.fitter.look(camera, scene.before(camera, 1.1 * edge), true), &camera);
  EXPECT_EQ(&scene.fitter.look(camera, scene.before(camera, 0.9 * edge)), &camera);
}

TEST(Reduced, NotOfferedWhereTheObjectIsNeverLarge) {
  const NearScene scene(1);
  DetectorOptions far;
  far.nearest = 1;
  far.farthest = 2;
  const DetectorFrames frames = scene.SizedScene::frames(far);
  EXPECT_EQ(frames.fit_cameras()[0].reduced, nullptr);
}

TEST(Reduced, RoughFitsComeFromFarther) {
  const NearScene scene(2);
  const DetectorFrames frames = scene.frames();
  const auto found = [&](bool rough) {
    int count = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {-1.0, 1.0}) {
        Rigid3 start = scene.truth * turned(0.25 * sign, Eigen::Vector3d::Unit(axis), {0, 0, 0});
        start.translation[axis] += 0.01 * sign;
        FitEffort effort;
        effort.rough = rough;
        const PoseFit fit =
            scene.fitter.fit(frames.fit_cameras(), {start, Vector6::Zero()}, kSearchReach, effort);
        count += rotation_angle(fit.motion.world_from_object, scene.truth) < 0.05;
      }
    }
    return count;
  };
  const int at_once = found(false), roughly = found(true);
  EXPECT_GT(roughly, at_once);
  EXPECT_GE(roughly, 4) << "of 6; at half size " << at_once;
}

TEST(Reduced, EdgesCountNearTheForegroundOnly) {
  const NearScene scene(2);
  const ForegroundMap map = foreground_in(320, 240, 60, 60, 180, 140);
  const DetectorFrames frames = scene.frames(&map);
  for (const FitCamera& camera : frames.fit_cameras()) {
    ASSERT_NE(camera.reduced, nullptr);
    const FitCamera& small = camera.reduced->camera();
    ASSERT_NE(small.foreground, nullptr);
    EXPECT_EQ(small.foreground->row(60)[80], ForegroundMap::kForeground);
    EXPECT_EQ(small.foreground->row(20)[80], ForegroundMap::kBackground);
    int edges = 0;
    for (int y = 0; y < small.edges->height(); ++y) {
      for (int x = 0; x < small.edges->width(); ++x) {
        const int bin = small.edges->bins()[static_cast<size_t>(y * small.edges->width() + x)];
        edges += bin != 0;
        if (x < 27 || x > 92 || y < 27 || y > 72) {
          ASSERT_EQ(bin, 0) << x << ", " << y;
        }
      }
    }
    EXPECT_GT(edges, 0);
  }
}

TEST(Extent, CountsWhereOneCameraLooksAlone) {
  for (const size_t count : {1u, 2u}) {
    const NearScene scene(count);
    const DetectorFrames frames = scene.frames();
    const TemplateBank bank(scene.views);
    const SilhouetteSearch silhouettes(bank);
    const ContourSearch contours(bank, silhouettes, scene.fitter);
    const ContourPose here = contours.evaluate(frames, {scene.truth, Vector6::Zero()});
    if (count == 2) {
      EXPECT_EQ(here.extent, 1);
      continue;
    }
    const double share = here.fit.cameras[0].share();
    EXPECT_NEAR(here.rank, here.extent * share * here.cameras[0], 1e-9);
    const Rigid3 camera_from_object = frames.fit_cameras()[0].camera_from_world * scene.truth;
    const View view = scene.views->view(scene.views->nearest(camera_from_object));
    const double size_px = std::sqrt(static_cast<double>(view.area)) * 600 /
                           (camera_from_object * scene.views->center()).norm();
    EXPECT_GT(size_px, 150);
    EXPECT_NEAR(here.extent, std::pow(size_px / kUsualSizePx, kExtentPower), 1e-6);
  }
}

}  // namespace
}  // namespace sightline::observe
