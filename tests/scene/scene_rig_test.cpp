// SPDX-License-Identifier: Apache-2.0
#include "support/scene_rig.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "sightline/record/pose_log.hpp"
#include "sightline/record/replay.hpp"
#include "support/matchers.hpp"
#include "support/scene_recording.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::test {
namespace {

// A white box in a dark empty room, without noise.
SceneRigOptions white_box() {
  SceneRigOptions options;
  options.azimuths_deg = {20};
  options.lens.width = 320, options.lens.height = 240;
  options.lens.fx = options.lens.fy = 300;
  options.lens.cx = 159.5, options.lens.cy = 119.5;
  options.shape = std::make_shared<const RayMesh>(make_carton());
  options.paint.color = {0.9f, 0.9f, 0.9f};
  options.backdrop.clutter = 0;
  options.backdrop.similarity = 1;
  options.backdrop.like = {0.001f, 0.001f, 0.001f};
  options.sensor.read_noise = options.sensor.shot_noise = 0;
  options.path = resting(
      Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized())),
             {0, 0, 0}));
  options.duration = std::chrono::milliseconds(100);
  return options;
}

// Middle and area of what is bright.
struct Blob {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  double area = 0;
};
Blob blob(const FramePtr& frame) {
  Blob out;
  const PlaneView gray = frame->gray();
  for (int y = 0; y < gray.height; ++y) {
    for (int x = 0; x < gray.width; ++x) {
      const double weight = gray.row(y)[x] > 60 ? 1 : 0;
      out.middle += weight * Eigen::Vector2d(x, y);
      out.area += weight;
    }
  }
  out.middle /= std::max(1.0, out.area);
  return out;
}

TEST(SceneRig, PutsTheObjectWhereTheLensModelSays) {
  SceneRigOptions options = white_box();
  options.lens.distortion = {-0.3, 0.1, 0.002, -0.003, 0};
  // A small ball far off the middle, where the lens bends most.
  options.shape = std::make_shared<const RayMesh>(make_bumpy_torus(2000, 0.03f));
  options.path = resting(Rigid3(Eigen::Quaterniond::Identity(), {0.1, 0.22, 0.1}));
  const SceneRig rig(options);
  const FramePtr frame = rig.shoot(rig.shots().front());
  // The same by projecting points of its surface, many of them.
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  const CalibratedCamera& camera = rig.cameras().front();
  for (const auto& v : options.shape->mesh().vertices) {
    const auto pixel = camera.model.project(camera.world_from_camera.inverse() *
                                            (rig.truth(options.start) * v.cast<double>()));
    ASSERT_TRUE(pixel);
    low = low.min(pixel->array());
    high = high.max(pixel->array());
  }
  const PlaneView gray = frame->gray();
  Eigen::Array2d first(1e9, 1e9), last(-1e9, -1e9);
  for (int y = 0; y < gray.height; ++y) {
    for (int x = 0; x < gray.width; ++x) {
      if (gray.row(y)[x] < 60) continue;
      first = first.min(Eigen::Array2d(x - 0.5, y - 0.5));
      last = last.max(Eigen::Array2d(x + 0.5, y + 0.5));
    }
  }
  EXPECT_GT(blob(frame).area, 300);
  EXPECT_LT((first - low).abs().maxCoeff(), 1.6);  // blur and whole pixels
  EXPECT_LT((last - high).abs().maxCoeff(), 1.6);
}

TEST(SceneRig, NoiseHasTheSizeThatIsAskedFor) {
  SceneRigOptions options = white_box();
  options.sensor.read_noise = 5;
  options.backdrop.like = {0.2f, 0.2f, 0.2f};
  const SceneRig noisy(options);
  options.sensor.read_noise = 0;
  const SceneRig clean(options);
  const FramePtr a = noisy.shoot(noisy.shots()[0]), b = clean.shoot(clean.shots()[0]);
  double sum = 0, squares = 0;
  int count = 0;
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 320; ++x) {
      const double d = a->gray().row(y)[x] - b->gray().row(y)[x];
      sum += d;
      squares += d * d;
      ++count;
    }
  }
  // Luma is 219/255 of the sum of three channels weighted 0.299, 0.587, 0.114.
  const double expected = 5 * std::sqrt(0.299 * 0.299 + 0.587 * 0.587 + 0.114 * 0.114) * 219 / 255;
  EXPECT_NEAR(std::sqrt(squares / count), expected, 0.25);
  EXPECT_NEAR(sum / count, 0, 0.1);
}

TEST(SceneRig, MotionBlurWidensAndKeepsTheMiddle) {
  SceneRigOptions options = white_box();
  options.path = [](Time time) {
    const double t = to_seconds(time.time_since_epoch());
    return Rigid3(Eigen::Quaterniond::Identity(), {0, 0.9 * t, 0});
  };
  const SceneRig sharp(options);
  options.sensor.shutter = 0.03;
  const SceneRig blurred(options);
  const SceneShot& shot = sharp.shots()[1];
  const Blob a = blob(sharp.shoot(shot)), b = blob(blurred.shoot(shot));
  EXPECT_LT((a.middle - b.middle).norm(), 1.0);
  EXPECT_GT(b.area, 1.1 * a.area);
}

TEST(SceneRig, ACardHidesAndIsGoneAgain) {
  SceneRigOptions options = white_box();
  options.duration = std::chrono::milliseconds(600);
  options.azimuths_deg = {0, 60};
  using std::chrono::milliseconds;
  options.cards = {{1, milliseconds(200), milliseconds(400), milliseconds(50)}};
  const SceneRig rig(options);
  for (const SceneShot& shot : rig.shots()) {
    const Duration at = shot.true_capture - options.start;
    const double share = rig.visible_share(shot);
    if (shot.camera == 0 || at < milliseconds(150) || at > milliseconds(450)) {
      EXPECT_EQ(share, 1) << shot.camera << " " << at.count();
    } else if (at >= milliseconds(200) && at <= milliseconds(400)) {
      EXPECT_EQ(share, 0) << at.count();
    }
  }
}

TEST(SceneRig, IsTheSameEveryTimeAndDiffersByFrame) {
  SceneRigOptions options = white_box();
  options.sensor.read_noise = 3;
  const SceneRig rig(options), again(options);
  const auto bytes = [](const FramePtr& frame) {
    const PlaneView y = frame->i420().y;
    std::vector<uint8_t> all;
    for (int row = 0; row < y.height; ++row)
      all.insert(all.end(), y.row(row), y.row(row) + y.width);
    return all;
  };
  EXPECT_EQ(bytes(rig.shoot(rig.shots()[0])), bytes(again.shoot(again.shots()[0])));
  EXPECT_NE(bytes(rig.shoot(rig.shots()[0])), bytes(rig.shoot(rig.shots()[1])));
}

TEST(SceneRig, CamerasKeepTheirPhasesAndSkews) {
  SceneRigOptions options = white_box();
  options.azimuths_deg = {0, 60};
  options.phases = {0, 0.25};
  options.skews = {Duration(0), std::chrono::milliseconds(2)};
  const SceneRig rig(options);
  EXPECT_EQ(rig.sets().size(), 6u);
  for (const SceneShot& shot : rig.shots()) {
    EXPECT_EQ(shot.stamp - shot.true_capture, std::chrono::milliseconds(shot.camera == 1 ? 2 : 0));
  }
}

TEST(SceneMotion, StepsAreAsLongAsAskedFor) {
  SceneSteps steps;
  steps.step = 0.031;
  steps.turn = 0.25;
  for (const bool erratic : {false, true}) {
    const Duration duration = std::chrono::seconds(20);
    const ScenePath path = erratic ? erratic_path(steps, duration) : smooth_path(steps, duration);
    double moved = 0, turned = 0, furthest = 0;
    constexpr int kFrames = 500;
    for (int i = 0; i < kFrames; ++i) {
      const Rigid3 a = path(Time(i * steps.period)), b = path(Time((i + 1) * steps.period));
      moved += translation_distance(a, b) / kFrames;
      turned += rotation_angle(a, b) / kFrames;
      furthest = std::max(furthest, a.translation.cwiseAbs().maxCoeff());
    }
    // Smooth motion is bent between frames, and its mean is over all time.
    EXPECT_NEAR(moved, steps.step, erratic ? 1e-6 : 0.25 * steps.step) << erratic;
    EXPECT_NEAR(turned, steps.turn, erratic ? 1e-6 : 0.25 * steps.turn) << erratic;
    EXPECT_LE(furthest, 0.1001);
  }
}

TEST(SceneRecording, IsARecordingWithItsTruth) {
  const std::filesystem::path folder = ::testing::TempDir() + "scene_recording";
  std::filesystem::remove_all(folder);
  SceneRigOptions options = white_box();
  options.azimuths_deg = {0, 60};
  ASSERT_THAT(write_scene_recording(SceneRig(options), folder), IsOk());
  auto recording = open_recording(folder, RecordingMode::kStrict);
  ASSERT_THAT(recording, IsOk());
  EXPECT_EQ(recording->frame_count(), 6u);
  ASSERT_TRUE(recording->truth);
  const auto truth = read_truth(*recording->truth);
  ASSERT_THAT(truth, IsOk());
  EXPECT_EQ(truth->size(), 3u);
  EXPECT_THAT(truth->front().world_from_object, PoseNear(options.path(Time{}), 1e-6, 1e-6));
  // The images come back as they were shot.
  const SceneRig rig(options);
  auto replay =
      VirtualReplay::open(std::make_shared<const Recording>(std::move(recording).value()));
  ASSERT_THAT(replay, IsOk());
  const auto frames = (*replay)->next();
  ASSERT_THAT(frames, IsOk());
  ASSERT_TRUE(*frames);
  ASSERT_EQ((*frames)->size(), 2u);
  const FramePtr shot = rig.shoot(rig.shots()[1]);
  for (int y = 0; y < 240; y += 7) {
    ASSERT_EQ(0, memcmp(shot->i420().y.row(y), (**frames)[1]->i420().y.row(y), 320)) << y;
  }
}

}  // namespace
}  // namespace sightline::test
