// SPDX-License-Identifier: Apache-2.0
// What moves is looked for first: frame differencing, and the search of what it shows.
#include "observe/detect/pixels/frame_difference.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/detector_frames.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "support/random.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

using namespace std::chrono_literals;
using test::turned;

constexpr int kWidth = 320, kHeight = 240, kSide = 30;

// A noisy gray wall of vertical stripes, with a bright square.
HalfSizeImage image_with_square(int left, int top, uint64_t seed, double noise = 2, double gain = 1,
                                int shift = 0) {
  HalfSizeImage image;
  image.width = kWidth;
  image.height = kHeight;
  test::Random random(seed);
  for (size_t plane = 0; plane < 3; ++plane) {
    image.planes[plane].resize(static_cast<size_t>(kWidth * kHeight));
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool inside = x >= left && x < left + kSide && y >= top && y < top + kSide;
        const double luma = inside ? 170 : (x + shift) / 8 % 2 == 0 ? 80 : 120;
        const double value = (plane == 0 ? gain * luma : 128) + noise * random.normal();
        image.planes[plane][static_cast<size_t>(y * kWidth + x)] =
            static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
      }
    }
  }
  return image;
}

Time at(Duration since_start) { return Time(10s) + since_start; }

// Whether the second image, so much later, shows motion.
bool moves(HalfSizeImage before, const HalfSizeImage& now, Duration later,
           std::vector<uint8_t>& mask) {
  FrameDifference difference;
  difference.remember(before, at(0ms));
  return difference.find(now, at(later), mask);
}

TEST(FrameDifference, ShowsWhereSomethingWasAndIs) {
  std::vector<uint8_t> mask;
  ASSERT_TRUE(moves(image_with_square(60, 100, 1), image_with_square(160, 100, 2), 200ms, mask));
  ASSERT_EQ(mask.size(), static_cast<size_t>(kWidth * kHeight));
  const auto count = [&](int left, int top, int right, int bottom) {
    int sum = 0;
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) sum += mask[static_cast<size_t>(y * kWidth + x)];
    }
    return sum;
  };
  const int whole = kSide * kSide;
  EXPECT_EQ(count(60, 100, 60 + kSide, 100 + kSide), whole);
  EXPECT_EQ(count(160, 100, 160 + kSide, 100 + kSide), whole);
  // And so far around that the outline's edges are in it, no more.
  const int margin = kMotionMargin + 1, grown = (kSide + 2 * margin) * (kSide + 2 * margin);
  EXPECT_LE(count(0, 0, kWidth, kHeight), 2 * grown);
  EXPECT_GE(count(0, 0, kWidth, kHeight), 2 * whole);
}

TEST(FrameDifference, SaysNothingOfNoiseLightAndWhatStandsStill) {
  std::vector<uint8_t> mask;
  EXPECT_FALSE(
      moves(image_with_square(60, 100, 1, 6), image_with_square(60, 100, 2, 6), 200ms, mask))
      << "noise";
  EXPECT_TRUE(mask.empty());
  EXPECT_FALSE(
      moves(image_with_square(60, 100, 1), image_with_square(60, 100, 2, 2, 1.5), 200ms, mask))
      << "a lamp";
  EXPECT_FALSE(
      moves(image_with_square(60, 100, 1), image_with_square(59, 100, 2, 2, 1, 1), 200ms, mask))
      << "a camera that is carried: few pixels change, but all over the image";
  FrameDifference nothing;
  EXPECT_FALSE(nothing.find(image_with_square(60, 100, 1), at(0ms), mask)) << "a first frame";
}

TEST(FrameDifference, ComparesWithNothingOldOrOfAnotherSize) {
  std::vector<uint8_t> mask;
  const HalfSizeImage now = image_with_square(160, 100, 2);
  EXPECT_TRUE(moves(image_with_square(60, 100, 1), now, kMotionAge, mask));
  EXPECT_FALSE(moves(image_with_square(60, 100, 1), now, kMotionAge + 1ms, mask));
  EXPECT_FALSE(moves(image_with_square(60, 100, 1), now, -10ms, mask)) << "time runs backwards";
  HalfSizeImage small = image_with_square(60, 100, 1);
  small.height /= 2;
  EXPECT_FALSE(moves(small, now, 200ms, mask));
}

// Half a pixel from one frame to the next cannot be told from noise; over some frames it can.
TEST(FrameDifference, SeesSlowMotionAtAnyFrameRate) {
  FrameDifference difference;
  std::vector<uint8_t> mask;
  HalfSizeImage before = image_with_square(100, 100, 0);
  bool seen = false;
  for (int i = 1; i < 16; ++i) {
    HalfSizeImage next = image_with_square(100 + i / 2, 100, static_cast<uint64_t>(i));
    difference.remember(before, at((i - 1) * 33ms));
    seen |= difference.find(next, at(i * 33ms), mask);
    before = std::move(next);
  }
  EXPECT_TRUE(seen);
}

// A truck that is carried through a cluttered room.
struct CarriedTruck {
  CarriedTruck() {
    const TriangleMesh mesh = test::make_truck();
    const auto path = [](Time time) {
      const double t = to_seconds(time - Time{});
      return turned(0.8, {1, 2, 3}, {0.4 * t - 0.05, 0.02 - 0.2 * t, 0.01});
    };
    rig = std::make_unique<test::SceneRig>(test::search_scene(mesh, path));
    views = test::views_of(mesh);
  }
  std::unique_ptr<test::SceneRig> rig;
  std::shared_ptr<const ViewpointModel> views;
};

template <typename Add>
void add_set(const test::SceneRig& rig, size_t set, const Add& add) {
  const auto sets = rig.sets();
  for (const test::SceneShot& shot : sets.at(set)) {
    add(CameraId(static_cast<uint32_t>(shot.camera)), rig.shoot(shot));
  }
}

// Share of the places that a stage has left which are the truck's.
double share_at(const DetectionTrace& trace, const std::string& name, const Rigid3& truth,
                const ViewpointModel& views) {
  for (const DetectionTrace::Stage& stage : trace.stages) {
    if (stage.name != name || stage.candidates.empty()) continue;
    const auto here =
        std::count_if(stage.candidates.begin(), stage.candidates.end(), [&](const auto& candidate) {
          const Eigen::Vector3d off =
              (candidate.world_from_object * views.center()) - truth * views.center();
          return off.norm() < views.radius();
        });
    return static_cast<double>(here) / static_cast<double>(stage.candidates.size());
  }
  return 0;
}

TEST(ObjectDetector, LooksWhereSomethingMoves) {
  const CarriedTruck scene;
  const auto detector =
      ObjectDetector::create(ObjectId(1), scene.views, test::detector_cameras(*scene.rig), {})
          .value();
  const auto add = [&](CameraId id, const FramePtr& frame) { detector->add_frame(id, *frame); };
  add_set(*scene.rig, 0, add);
  add_set(*scene.rig, 6, add);
  DetectionTrace everywhere, moving;
  moving.moving = true;
  detector->explain(everywhere, nullptr);
  detector->explain(moving, nullptr);
  const Rigid3 truth = scene.rig->truth(moving.time);
  for (const char* stage : {"pool", "screened"}) {
    const double share = share_at(moving, stage, truth, *scene.views);
    EXPECT_GT(share, 0.3) << stage;
    EXPECT_GT(share, 2 * share_at(everywhere, stage, truth, *scene.views)) << stage;
  }
  Detection found;  // what stands out by little has to be found twice
  for (int i = 0; i < 3 && found.poses.empty(); ++i) found = detector->detect();
  ASSERT_EQ(found.poses.size(), 1u);
  EXPECT_LT(translation_distance(found.poses[0].world_from_object, scene.rig->truth(found.time)),
            0.01);
}

TEST(DetectorFrames, KeepEdgesNearWhatMoves) {
  const CarriedTruck scene;
  DetectorOptions options;
  DetectorFrames frames(test::detector_cameras(*scene.rig), options);
  const auto add = [&](CameraId id, const FramePtr& frame) { frames.add(id, *frame, nullptr); };
  add_set(*scene.rig, 0, add);
  EXPECT_FALSE(frames.show_motion()) << "of one frame";
  add_set(*scene.rig, 6, add);
  ASSERT_TRUE(frames.show_motion());
  ASSERT_TRUE(frames.select(DetectorFrames::Where::kEverywhere));
  const Rigid3 truth = scene.rig->truth(frames.newest());
  // Near the truck, and elsewhere.
  const auto edges = [&](size_t i) {
    std::array<int, 2> out{};
    const FitCamera& camera = frames.fit_cameras()[i];
    const Eigen::Vector3d center = camera.camera_from_world * (truth * scene.views->center());
    const Eigen::Vector2d pixel = camera.camera->model.project(center).value() / 2;
    const double reach =
        scene.views->radius() * camera.camera->model.parameters().fx / center.norm() / 2;
    const EdgeImage& image = frames.edges(i);
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) {
        if (image.bins()[static_cast<size_t>(y * image.width() + x)] == 0) continue;
        ++out[(Eigen::Vector2d(x, y) - pixel).norm() < reach ? 0 : 1];
      }
    }
    return out;
  };
  std::vector<std::array<int, 2>> everywhere;
  for (size_t i = 0; i < frames.size(); ++i) everywhere.push_back(edges(i));
  ASSERT_TRUE(frames.select(DetectorFrames::Where::kMotion));
  for (size_t i = 0; i < frames.size(); ++i) {
    ASSERT_TRUE(frames.shows(i, DetectorFrames::Where::kMotion));
    const auto [here, elsewhere] = edges(i);
    EXPECT_GT(here, 0.7 * everywhere[i][0]) << "of the truck";
    EXPECT_LT(elsewhere, 0.4 * everywhere[i][1]) << "the room stands still";
  }
}

TEST(DetectorFrames, SeeNoMotionInCamerasThatTurn) {
  const CarriedTruck scene;
  DetectorFrames frames(test::detector_cameras(*scene.rig), {});
  const auto place = std::make_shared<CameraPlace>();
  const auto add = [&](CameraId id, const FramePtr& frame) {
    frames.add(id, *Frame::with_place(frame, place), nullptr);
  };
  add_set(*scene.rig, 0, add);
  add_set(*scene.rig, 6, add);
  EXPECT_FALSE(frames.show_motion());
}

}  // namespace
}  // namespace sightline::observe
