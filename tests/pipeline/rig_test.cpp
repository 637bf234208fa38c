// SPDX-License-Identifier: Apache-2.0
// What a rig loads, once, and what it takes from the one before it.
#include "sightline/pipeline/rig.hpp"

#include <gtest/gtest.h>

#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/rig_parts.hpp"

namespace sightline {
namespace {

const std::filesystem::path kBench =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench";

// Without its markers, so that the object has to be searched for.
Installation unmarked() {
  Installation installation = recording_installation(kBench).value();
  installation.objects.front().description.modalities.fiducial = false;
  return installation;
}

RigOptions without_cache() {
  RigOptions options;
  options.cache.clear();
  return options;
}

class RigTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    installation_ = std::make_unique<Installation>(unmarked());
    rig_ = std::make_unique<Rig>(load_rig(*installation_, without_cache()).value());
  }
  static void TearDownTestSuite() {
    rig_.reset();
    installation_.reset();
  }
  Result<Rig> load_again(const Installation& next) {
    RigOptions options = without_cache();
    options.before = {installation_.get(), rig_.get()};
    return load_rig(next, options);
  }

  static inline std::unique_ptr<Installation> installation_;
  static inline std::unique_ptr<Rig> rig_;
};

TEST_F(RigTest, TheSearchTakesWhatTheRigHas) {
  const RigObject& object = rig_->objects.front();
  ASSERT_NE(object.views, nullptr);
  ASSERT_NE(object.samples, nullptr);
  const long users = object.views.use_count();
  const auto search = ObjectSearch::create(*installation_, *rig_);
  ASSERT_TRUE(search && *search);
  EXPECT_GT(object.views.use_count(), users);
}

TEST_F(RigTest, WhatNobodyNeedsIsNotMade) {
  Installation marked = *installation_;
  marked.objects.front().description.modalities = {true, false, false, false};
  const auto rig = load_rig(marked, without_cache());
  ASSERT_TRUE(rig);
  EXPECT_EQ(rig->objects.front().views, nullptr);
  EXPECT_EQ(rig->objects.front().samples, nullptr);
}

TEST_F(RigTest, RendererAndObserverShareOneTable) {
  const auto& geometry = *rig_->cameras.front();
  const auto rays = geometry.rays();
  const long users = rays.use_count();
  const auto renderer = make_renderer(*installation_, *rig_, CameraId(0));
  ASSERT_TRUE(renderer);
  EXPECT_GT(rays.use_count(), users);
  EXPECT_EQ(make_scene_depth(*rig_, CameraId(0)).owner, geometry.static_depth());
}

TEST_F(RigTest, WhatDidNotChangeIsTakenFromTheRigBefore) {
  Installation next = *installation_;
  next.cameras[1].calibration.world_from_camera.translation.x() += 0.01;
  std::swap(next.cameras[0], next.cameras[2]);
  const auto rig = load_again(next);
  ASSERT_TRUE(rig);
  EXPECT_EQ(rig->objects.front().views, rig_->objects.front().views);
  EXPECT_EQ(rig->scene, rig_->scene);
  EXPECT_EQ(rig->cameras[0], rig_->cameras[2]);
  EXPECT_NE(rig->cameras[1], rig_->cameras[1]);
}

TEST_F(RigTest, AChangedObjectIsLoadedAnew) {
  Installation next = *installation_;
  ++next.objects.front().content;
  next.objects.front().description.modalities = {true, false, false, false};
  const auto rig = load_again(next);
  ASSERT_TRUE(rig);
  EXPECT_NE(rig->objects.front().mesh, rig_->objects.front().mesh);
  EXPECT_EQ(rig->cameras[1], rig_->cameras[1]);
}

TEST_F(RigTest, StoppedInTheMiddle) {
  std::stop_source stop;
  stop.request_stop();
  RigOptions options = without_cache();
  options.stop = stop.get_token();
  const auto rig = load_rig(*installation_, options);
  ASSERT_FALSE(rig);
  EXPECT_EQ(rig.error().code, ErrorCode::kUnavailable);
  const auto views = load_views(*rig_->objects.front().triangles, rig_->objects.front().mesh,
                                "mesh.obj", {}, stop.get_token());
  ASSERT_FALSE(views);
  EXPECT_EQ(views.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace sightline
