// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/scene/occlusion_learner.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "observe/scene/background_colors.hpp"
#include "observe/scene/occlusion_cells.hpp"
#include "observe/scene/surface_colors.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/scene_rig.hpp"
#include "support/scene_shapes.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using observe::BackgroundColors;
using observe::CellEvidence;
using observe::CellReader;
using observe::CellRect;
using observe::OcclusionCells;
using observe::SurfaceColors;
using test::SceneRig;
using test::SceneRigOptions;
using test::SceneShot;

constexpr auto kLearned = OcclusionCells::Change::kLearned;
constexpr auto kForgotten = OcclusionCells::Change::kForgotten;
constexpr auto kNone = OcclusionCells::Change::kNone;

TEST(OcclusionCells, OneClearFrameIsEnoughAndWeakOnesAddUp) {
  OcclusionCells cells(8, 8);
  EXPECT_EQ(cells.judge(1, 1, 0.8f, {-1, true}), kLearned);
  EXPECT_TRUE(cells.hides(1, 1, 0.8f));
  EXPECT_FALSE(cells.hides(1, 2, 0.8f));
  int frames = 0;
  while (cells.judge(2, 2, 0.8f, {-0.3f, true}) == kNone) ASSERT_LT(++frames, 10);
  EXPECT_GE(frames, 1);
}

TEST(OcclusionCells, EvidenceEitherWayHasToPassAThreshold) {
  OcclusionCells cells(4, 4);
  for (int i = 0; i < 100; ++i) {  // to and fro: nothing flickers
    EXPECT_EQ(cells.judge(0, 0, 0.8f, {i % 2 == 0 ? -0.4f : 0.4f, true}), kNone);
  }
  EXPECT_EQ(cells.judge(1, 0, 0.8f, {-1, true}), kLearned);
  EXPECT_EQ(cells.judge(1, 0, 0.8f, {0.5f, false}), kNone);
  EXPECT_TRUE(cells.hides(1, 0, 0.8f));
  int frames = 0;
  while (cells.judge(1, 0, 0.8f, {1, false}) != kForgotten) ASSERT_LT(++frames, 3);
  EXPECT_FALSE(cells.hides(1, 0, 0.8f));
}

TEST(OcclusionCells, WhatHidesFarThingsNeedNotHideNearOnes) {
  OcclusionCells cells(4, 4);
  cells.judge(0, 0, 0.8f, {-1, true});
  EXPECT_TRUE(cells.hides(0, 0, 0.7f));   // farther
  EXPECT_FALSE(cells.hides(0, 0, 1.0f));  // nearer
  EXPECT_EQ(cells.judge(0, 0, 1.0f, {0, false}), kNone);
  EXPECT_FALSE(cells.hides(0, 0, 1.0f));
  EXPECT_EQ(cells.judge(0, 0, 1.0f, {1, false}), kNone);  // seen there: the far bound stays
  EXPECT_TRUE(cells.hides(0, 0, 0.7f));
}

TEST(OcclusionCells, WhatOnlyPassedIsForgottenWithTheObject) {
  OcclusionCells cells(4, 4);
  cells.judge(0, 0, 0.8f, {-1, true});
  cells.judge(1, 0, 0.8f, {-1, false});
  cells.left(0, 0);
  cells.left(1, 0);
  EXPECT_TRUE(cells.hides(0, 0, 0.8f));
  EXPECT_FALSE(cells.hides(1, 0, 0.8f));
  cells.judge(2, 0, 0.8f, {-1, false});
  cells.forget_passing();
  EXPECT_FALSE(cells.hides(2, 0, 0.8f));
}

TEST(OcclusionCells, PublishesBoundsNearerThanTheObject) {
  OcclusionCells cells(16, 16);
  OcclusionDepth out;
  EXPECT_FALSE(cells.publish({0, 0, 16, 16}, out));
  cells.judge(5, 6, 0.8f, {-1, true});
  ASSERT_TRUE(cells.publish({4, 4, 12, 12}, out));
  EXPECT_GT(out.at(10, 12), 0.8f * 1.03f);
  EXPECT_GT(out.at(13, 13), 0.8f * 1.03f);  // beside it: nothing is known there
  EXPECT_EQ(out.at(20, 20), 0);
  EXPECT_EQ(out.at(1000, -4), 0);
  for (int i = 0; i < 3; ++i) cells.judge(6, 6, 0.8f, {1, false});
  ASSERT_TRUE(cells.publish({4, 4, 12, 12}, out));
  EXPECT_EQ(out.at(13, 13), 0);  // seen there
}

std::shared_ptr<const Image> plain(uint8_t y, uint8_t u, uint8_t v) {
  auto image = std::make_shared<Image>(32, 16);
  const MutableI420View view = image->mutable_view();
  for (int row = 0; row < 16; ++row) std::fill_n(view.y.row(row), 32, y);
  for (int row = 0; row < 8; ++row) {
    std::fill_n(view.u.row(row), 16, u);
    std::fill_n(view.v.row(row), 16, v);
  }
  return image;
}

TEST(BackgroundColors, KnowsWhatNoObjectCovered) {
  BackgroundColors background(16, 8);
  const auto image = plain(100, 120, 130);
  const CellRect object{4, 2, 8, 6};
  for (int i = 0; i < 6; ++i) background.learn(CellReader(image->view()), {&object, 1});
  EXPECT_TRUE(background.known(3, 2));
  EXPECT_TRUE(background.known(8, 2));
  EXPECT_FALSE(background.known(4, 2));
  EXPECT_FALSE(background.known(7, 5));
  EXPECT_LT(background.distance(0, 0, {101, 120, 130}), 1);
  EXPECT_GT(background.distance(0, 0, {101, 135, 130}), 25);
  EXPECT_FALSE(background.textured(3, 2));
  const auto other = plain(40, 120, 130);
  background.learn(CellReader(other->view()), {&object, 1});
  EXPECT_GT(background.changed(), 0.9f);
}

TEST(SurfaceColors, RemembersPlacesAndThePalette) {
  SurfaceColors surface({0, 0, 0}, 0.1);
  const size_t here = surface.at({0.05f, 0, 0}), there = surface.at({-0.05f, 0, 0});
  EXPECT_NE(here, there);
  EXPECT_EQ(surface.at({9, 9, 9}), surface.at({0.0999f, 0.0999f, 0.0999f}));
  for (int i = 0; i < 10; ++i) surface.learn(here, {90, 100, 180});
  EXPECT_TRUE(surface.known(here));
  EXPECT_FALSE(surface.known(there));
  EXPECT_LT(surface.distance(here, {100, 101, 179}), 4);
  EXPECT_GT(surface.distance(here, {90, 128, 128}), 25);
  EXPECT_TRUE(surface.has({92, 101, 182}));
  EXPECT_FALSE(surface.has({92, 128, 128}));
}

// The object goes to and fro behind a block that stands before camera 1 only. The poses are the
// truth with a millimeter of noise, as if camera 0 had measured them.
class LearnedScene {
 public:
  explicit LearnedScene(test::Paint::Kind paint, bool block, Duration block_goes = 1h) {
    SceneRigOptions options;
    const TriangleMesh mesh = test::make_carton();
    options.shape = std::make_shared<const test::RayMesh>(mesh);
    options.paint.kind = paint;
    options.duration = 1100ms;
    options.path = [start = options.start](Time time) {
      const double t = to_seconds(time - start);
      const Eigen::AngleAxisd turn(0.6 + 0.5 * t, Eigen::Vector3d::UnitZ());
      return Rigid3(Eigen::Quaterniond(turn), {0.12 * std::sin(2.8 * t - 1.2), 0, 0});
    };
    options.azimuths_deg = {0, 90};
    if (block) {
      test::SceneBody body;
      body.shape = std::make_shared<const test::RayMesh>(make_box({0.08f, 0.04f, 0.20f}));
      body.paint.color = {0.05f, 0.06f, 0.09f};
      const Time goes = options.start + block_goes;
      // Before camera 1, which looks from +y: half of the object's way is behind it.
      body.world_from_body = [goes](Time time) -> std::optional<Rigid3> {
        if (time >= goes) return std::nullopt;
        return Rigid3(Eigen::Quaterniond::Identity(), {-0.07, 0.307, 0.168});
      };
      options.others.push_back(body);
    }
    rig_ = std::make_unique<SceneRig>(options);
    mesh_ = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
    auto made = OcclusionLearner::create(
        rig_->cameras()[1], CameraId(1),
        {{ObjectId(0), mesh_->center.cast<double>(), static_cast<double>(mesh_->radius),
          mesh_depth_renderer_factory(mesh_)}});
    EXPECT_TRUE(made) << made.error().message();
    learner = *std::move(made);
  }

  PoseTrackPtr track(Time time, CameraSet cameras = 1,
                     TrackState state = TrackState::kTracking) const {
    PoseEstimate estimate;
    estimate.object = ObjectId(0);
    estimate.time = estimate.last_measured = time;
    estimate.state = state;
    estimate.cameras = cameras;
    estimate.world_from_object = rig_->truth(time);
    const double wave = 0.001 * std::sin(1e-6 * static_cast<double>(to_ns(time) % 999983));
    estimate.world_from_object.translation += Eigen::Vector3d(wave, -wave, wave);
    estimate.covariance.diagonal().head<6>().setConstant(1e-6);
    return std::make_shared<PoseTrack>(ObjectId(0), std::vector<PoseEstimate>{estimate},
                                       MotionNoise{});
  }

  /// Calls each(shot, hidden share as learned, hidden share in truth) for every image of camera
  /// 1.
  template <typename Each>
  void play(const Each& each) {
    for (const SceneShot& shot : rig_->shots()) {
      if (shot.camera != 1) continue;
      const PoseTrackPtr now = track(shot.true_capture);
      learner->step(*rig_->shoot(shot), {&now, 1});
      const auto& result = learner->last_step();
      const double share = result.cells > 0 ? static_cast<double>(result.hidden) / result.cells : 0;
      each(shot, share, 1 - rig_->visible_share(shot));
    }
  }

  const SceneRig& rig() const { return *rig_; }
  std::unique_ptr<OcclusionLearner> learner;

 private:
  std::unique_ptr<SceneRig> rig_;
  std::shared_ptr<const RenderMesh> mesh_;
};

void expect_agreement(test::Paint::Kind paint) {
  LearnedScene scene(paint, true);
  std::vector<double> off;
  double max_hidden = 0;
  scene.play([&](const SceneShot&, double learned, double truth) {
    off.push_back(std::abs(learned - truth));
    max_hidden = std::max(max_hidden, truth);
  });
  EXPECT_GT(max_hidden, 0.5);
  std::sort(off.begin(), off.end());
  const double median = off[off.size() / 2], max = off[off.size() * 9 / 10];
  std::printf("hidden share off by %.1f points (median), %.1f (90 %%), %.1f (most)\n", 100 * median,
              100 * max, 100 * off.back());
  EXPECT_LT(median, 0.05);
  EXPECT_LT(max, 0.10);
}

TEST(OcclusionLearner, FindsWhatHidesAPlainObject) { expect_agreement(test::Paint::Kind::kPlain); }
TEST(OcclusionLearner, FindsWhatHidesAPrintedObject) {
  expect_agreement(test::Paint::Kind::kPrinted);
}

TEST(OcclusionLearner, DrawsNothingAsHiddenThatNothingHides) {
  for (const auto paint : {test::Paint::Kind::kPlain, test::Paint::Kind::kPrinted}) {
    LearnedScene scene(paint, false);
    int cells = 0, hidden = 0;
    scene.play([&](const SceneShot&, double, double) {
      cells += scene.learner->last_step().cells;
      hidden += scene.learner->last_step().hidden;
    });
    EXPECT_GT(cells, 10000);
    EXPECT_LE(hidden, cells / 1000);
  }
}

TEST(OcclusionLearner, ForgetsWhatHasGone) {
  LearnedScene scene(test::Paint::Kind::kPrinted, true, 800ms);
  double before = 0, after = 1;
  int frames = 0;
  scene.play([&](const SceneShot& shot, double learned, double) {
    if (shot.true_capture < scene.rig().options().start + 800ms) {
      before = std::max(before, learned);
    } else if (++frames == 5) {
      after = learned;
    }
  });
  EXPECT_GT(before, 0.3);
  EXPECT_LT(after, 0.03);
}

TEST(OcclusionLearner, LearnsOnlyWhileOtherCamerasHoldThePose) {
  LearnedScene scene(test::Paint::Kind::kPrinted, true);
  int judged = 0;
  for (const SceneShot& shot : scene.rig().shots()) {
    if (shot.camera != 1 || shot.sequence > 5) continue;
    const FramePtr frame = scene.rig().shoot(shot);
    const Time time = shot.true_capture;
    for (const PoseTrackPtr& track :
         {scene.track(time, 2), scene.track(time, 1, TrackState::kDegraded),
          scene.track(time, 1, TrackState::kCoasting), PoseTrackPtr()}) {
      scene.learner->step(*frame, {&track, 1});
      judged += scene.learner->last_step().judged;
    }
  }
  EXPECT_EQ(judged, 0);
  EXPECT_EQ(scene.learner->hidden(), nullptr);
}

TEST(OcclusionLearner, LeavesOutDamagedAndForeignFrames) {
  LearnedScene scene(test::Paint::Kind::kPlain, false);
  const SceneShot& shot = scene.rig().shots()[1];
  const PoseTrackPtr track = scene.track(shot.true_capture);
  FrameInfo info = scene.rig().info_of(shot);
  info.status = FrameStatus::kDamaged;
  scene.learner->step(*Frame::decoded(info, std::make_shared<Image>(640, 480)), {&track, 1});
  EXPECT_EQ(scene.learner->last_step().judged, 0);
  info.status = FrameStatus::kGood;
  info.width = 320;
  info.height = 240;
  scene.learner->step(*Frame::decoded(info, std::make_shared<Image>(320, 240)), {&track, 1});
  EXPECT_EQ(scene.learner->last_step().judged, 0);
}

TEST(OcclusionLearner, RefusesAnObjectWithoutMesh) {
  const SceneRig rig([] {
    SceneRigOptions options;
    options.shape = std::make_shared<const test::RayMesh>(test::make_carton());
    options.path = test::resting(Rigid3());
    return options;
  }());
  const auto made =
      OcclusionLearner::create(rig.cameras()[0], CameraId(0), {{ObjectId(0), {}, 0.1, {}}});
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().message().find("mesh"), std::string::npos);
}

}  // namespace
}  // namespace sightline
