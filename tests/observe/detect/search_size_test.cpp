// SPDX-License-Identifier: Apache-2.0
// Cameras with more pixels than a search has use for are searched at a smaller size.
#include "observe/detect/plan/search_size.hpp"

#include <gtest/gtest.h>

#include "observe/detect/pixels/foreground_masks.hpp"
#include "observe/detect/pixels/half_size_frame.hpp"
#include "sightline/image/image.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "sized_scene.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

using test::turned;

constexpr double kRadius = 0.1, kDistance = 1.0;  // [m]

CalibratedCamera camera_of(int width, int height, double fx_per_width = 0.9) {
  CameraModel::Parameters lens;
  lens.width = width;
  lens.height = height;
  lens.fx = lens.fy = fx_per_width * width;
  lens.cx = 0.51 * width;
  lens.cy = 0.48 * height;
  lens.distortion = {-0.1, 0.05, 0.001, -0.001, 0.01};
  return {"c", CameraModel::create(lens, "c").value(), {}};
}

int shrink_of(int width, int height, double radius = kRadius) {
  DetectorOptions options;
  options.nearest = 0.8 * kDistance;
  options.farthest = kDistance / 0.8;
  std::vector<DetectorCamera> cameras = {{CameraId(0), camera_of(width, height)}};
  const auto sizes = shrink_to_search(cameras, radius, options);
  EXPECT_EQ(sizes.at(0).width, width);
  EXPECT_EQ(sizes.at(0).height, height);
  EXPECT_EQ(cameras[0].calibration.model.width(),
            sizes[0].shrink == 1 ? width : 2 * (width / (2 * sizes[0].shrink)));
  return sizes[0].shrink;
}

TEST(SearchSize, IsAboutTheSameForAllCameras) {
  EXPECT_EQ(shrink_of(320, 240), 1);
  EXPECT_EQ(shrink_of(640, 480), 1);
  EXPECT_EQ(shrink_of(800, 600), 1);
  EXPECT_EQ(shrink_of(1280, 720), 2);
  EXPECT_EQ(shrink_of(1440, 1080), 2);
  EXPECT_EQ(shrink_of(1920, 1080), 3);
  EXPECT_EQ(shrink_of(2592, 1944), 4);
  EXPECT_EQ(shrink_of(3840, 2160), 5);
}

TEST(SearchSize, KeepsThePixelsOfWhatIsSmall) {
  // 2 x 0.03 m x 1152 px / m: 69 px, 35 px at half of that.
  EXPECT_EQ(shrink_of(1280, 720, 0.03), 1);
  EXPECT_EQ(shrink_of(1280, 720, 0.055), 2);
  EXPECT_EQ(shrink_of(1920, 1080, 0.055), 3);
  EXPECT_EQ(shrink_of(1920, 1080, 0.045), 2);
}

TEST(SearchSize, PointsOfTheFrameAreWhereTheShrunkCameraSeesThem) {
  const CalibratedCamera camera = camera_of(1922, 1081);
  for (const int shrink : {2, 3, 4}) {
    const auto smaller = shrunk(camera, shrink);
    ASSERT_TRUE(smaller);
    EXPECT_EQ(smaller->model.width() % 2, 0);
    EXPECT_EQ(smaller->model.width(), 2 * (1922 / (2 * shrink)));
    EXPECT_EQ(smaller->model.height(), 2 * (1081 / (2 * shrink)));
    const SearchSize size{1922, 1081, shrink};
    for (const Eigen::Vector3d& point :
         {Eigen::Vector3d(0.1, -0.2, 1), Eigen::Vector3d(-0.3, 0.1, 1.5)}) {
      const auto pixel = camera.model.project(point), there = smaller->model.project(point);
      ASSERT_TRUE(pixel && there);
      EXPECT_LT((size.searched(*pixel) - *there).norm(), 1e-9);
    }
  }
  EXPECT_FALSE(shrunk(camera_of(64, 48), 40)) << "no camera has no pixels";
}

TEST(SearchSize, FramesBecomeMeansOfSquares) {
  constexpr int kWidth = 38, kHeight = 27, kShrink = 3;  // 2 x 6 and 2 x 4 whole squares
  const auto image = std::make_shared<Image>(kWidth, kHeight);
  const MutableI420View to = image->mutable_view();
  const auto luma = [](int x, int y) { return 3 * x + 2 * y + 40; };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) to.y.row(y)[x] = static_cast<uint8_t>(luma(x, y));
  }
  for (int y = 0; y < to.u.height; ++y) {
    for (int x = 0; x < to.u.width; ++x) {
      to.u.row(y)[x] = static_cast<uint8_t>(100 + 4 * x);
      to.v.row(y)[x] = static_cast<uint8_t>(90 + 5 * y);
    }
  }
  FrameInfo info;
  info.width = kWidth;
  info.height = kHeight;
  HalfSizeFrame kept;
  const auto frame = Frame::decoded(info, image);
  EXPECT_TRUE(HalfSizeFrame::can_store(*frame, kWidth, kHeight));
  EXPECT_FALSE(HalfSizeFrame::can_store(*frame, kWidth, kHeight - 1));
  const auto smaller = shrunk(camera_of(kWidth, kHeight), kShrink);
  ASSERT_TRUE(smaller);
  kept.store(*frame, smaller->model, kShrink, true);
  ASSERT_EQ(kept.width, 12);
  ASSERT_EQ(kept.height, 8);
  ASSERT_EQ(kept.image.width, 6);
  ASSERT_EQ(kept.image.height, 4);
  EXPECT_EQ(kept.info.width, kWidth) << "the frame's own";
  for (int y = 0; y < kept.height; ++y) {
    for (int x = 0; x < kept.width; ++x) {
      EXPECT_NEAR(kept.full_luma[static_cast<size_t>(y * kept.width + x)],
                  luma(kShrink * x + 1, kShrink * y + 1), 1.01);
    }
  }
  for (int y = 0; y < kept.image.height; ++y) {
    for (int x = 0; x < kept.image.width; ++x) {
      EXPECT_NEAR(kept.image.row(0, y)[x], luma(2 * kShrink * x, 2 * kShrink * y) + 12.5, 1.6);
      EXPECT_NEAR(kept.image.row(1, y)[x], 100 + 4 * (kShrink * x + 1), 1.01);
      EXPECT_NEAR(kept.image.row(2, y)[x], 90 + 5 * (kShrink * y + 1), 1.01);
    }
  }
}

TEST(SearchSize, ForegroundGoesWithTheFrame) {
  const ForegroundMap map = foreground_in(19, 13, 6, 3, 12, 9);
  ForegroundMap small;
  shrink(map, 3, 6, 4, small);
  ASSERT_EQ(small.classes.size(), 24u);
  EXPECT_EQ(small.share, map.share);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 6; ++x) {
      const bool inside = x >= 2 && x < 4 && y >= 1 && y < 3;
      EXPECT_EQ(small.row(y)[x], inside ? ForegroundMap::kForeground : ForegroundMap::kBackground);
    }
  }
}

// The frame with each pixel four times: half of its size are the same pixels again.
FramePtr doubled(const Frame& frame) {
  FrameInfo info = frame.info();
  const auto image = std::make_shared<Image>(2 * info.width, 2 * info.height);
  const I420View from = frame.i420();
  const MutableI420View to = image->mutable_view();
  const auto repeat = [](const PlaneView& plane, const MutablePlaneView& out) {
    for (int y = 0; y < out.height; ++y) {
      for (int x = 0; x < out.width; ++x) out.row(y)[x] = plane.row(y / 2)[x / 2];
    }
  };
  repeat(from.y, to.y);
  repeat(from.u, to.u);
  repeat(from.v, to.v);
  info.width *= 2;
  info.height *= 2;
  return Frame::decoded(info, image);
}

class LargerImages : public testing::Test {
 protected:
  LargerImages()
      : mesh_(test::make_truck()),
        rig_(
            test::search_scene(mesh_, test::resting(turned(0.8, {1, 2, 3}, {0.03, -0.02, 0.01})))) {
    options_.nearest = 0.55;
    options_.farthest = 0.9;
  }

  // Of the rig's cameras, or of such with twice as many pixels.
  std::unique_ptr<ObjectDetector> detector(bool twice, size_t scan_hits = 12000) const {
    std::vector<DetectorCamera> cameras = test::detector_cameras(rig_);
    for (DetectorCamera& camera : cameras) {
      if (twice) camera.calibration = magnified(camera.calibration).value();
    }
    DetectorOptions options = options_;
    options.scan_hits = scan_hits;
    return ObjectDetector::create(ObjectId(1), test::views_of(mesh_), std::move(cameras), options)
        .value();
  }

  void show(ObjectDetector& detector, bool twice) const {
    test::add_first_frames(rig_, [&](CameraId id, const Frame& frame) {
      detector.add_frame(id, twice ? *doubled(frame) : frame);
    });
  }

  static void expect_same(const Detection& a, const Detection& b) {
    ASSERT_EQ(a.poses.size(), 1u);
    ASSERT_EQ(b.poses.size(), 1u);
    EXPECT_LT(translation_distance(a.poses[0].world_from_object, b.poses[0].world_from_object),
              1e-6);
    EXPECT_LT(rotation_angle(a.poses[0].world_from_object, b.poses[0].world_from_object), 1e-6);
    EXPECT_NEAR(a.poses[0].evidence, b.poses[0].evidence, 1e-6);
    ASSERT_EQ(a.observations.size(), b.observations.size());
  }

  TriangleMesh mesh_;
  test::SceneRig rig_;
  DetectorOptions options_;
};

TEST_F(LargerImages, AreSearchedWithTheSameResultAndWork) {
  const auto usual = detector(false), twice = detector(true);
  show(*usual, false);
  show(*twice, true);
  const Detection found = usual->detect(), there = twice->detect();
  expect_same(found, there);
  const Rigid3 truth = rig_.truth(found.time);
  EXPECT_LT(translation_distance(there.poses[0].world_from_object, truth), 0.006);
  EXPECT_EQ(twice->work().images, usual->work().images);
  EXPECT_EQ(twice->work().places, usual->work().places);
  EXPECT_EQ(twice->work().fits, usual->work().fits);
}

TEST_F(LargerImages, HintsAreInTheirPixels) {
  const auto usual = detector(false, 40), twice = detector(true, 40);
  show(*usual, false);
  show(*twice, true);
  const Rigid3 truth = rig_.truth(rig_.shots().front().true_capture);
  const CalibratedCamera& camera = rig_.cameras()[0];
  const auto pixel = camera.model.project(camera.world_from_camera.inverse() *
                                          (truth * test::views_of(mesh_)->center()));
  ASSERT_TRUE(pixel);
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);
  (void)usual->detect_at(ImageHint{CameraId(0), *pixel, 30});
  (void)twice->detect_at(ImageHint{CameraId(0), 2 * (*pixel + half) - half, 60});
  expect_same(usual->detect(), twice->detect());
  EXPECT_EQ(twice->work().places, usual->work().places);
}

TEST_F(LargerImages, FramesOfTheSizeThatIsSearchedAreNotTheirs) {
  const auto twice = detector(true);
  show(*twice, false);
  EXPECT_EQ(twice->detect().time, Time{}) << "no frame took part";
  show(*twice, true);
  EXPECT_EQ(twice->detect().poses.size(), 1u);
}

}  // namespace
}  // namespace sightline::observe
