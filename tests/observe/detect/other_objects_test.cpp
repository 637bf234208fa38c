// SPDX-License-Identifier: Apache-2.0
// What a search knows of other objects: places that are taken, and rivals that may be their twins.
#include <gtest/gtest.h>

#include "observe/detect/judge/rival_places.hpp"
#include "observe/detect/judge/taken_places.hpp"
#include "observe/shape/placed_mask.hpp"
#include "support/ray_mesh.hpp"
#include "support/scene_shapes.hpp"
#include "support/search_scene.hpp"

namespace sightline::observe {
namespace {

using test::turned;
using test::views_of;

// Three cameras around the place, and views of a creature.
struct OtherObjects : testing::Test {
  static void SetUpTestSuite() {
    rig = new test::SceneRig(test::search_scene(test::make_creature(2000),
                                                test::resting(turned(0.8, {1, 2, 3}, {0, 0, 0}))));
    views = views_of(test::make_creature(2000));
  }
  static void TearDownTestSuite() {
    delete rig;
    views.reset();
  }

  OtherObjects() {
    for (const CalibratedCamera& camera : rig->cameras()) {
      cameras.emplace_back();
      cameras.back().camera = &camera;
      cameras.back().camera_from_world = camera.world_from_camera.inverse();
    }
  }

  static test::SceneRig* rig;
  static std::shared_ptr<const ViewpointModel> views;
  std::vector<SearchCamera> cameras;
};

test::SceneRig* OtherObjects::rig = nullptr;
std::shared_ptr<const ViewpointModel> OtherObjects::views;

TEST_F(OtherObjects, TakeTheirPlaceInAnyOrientation) {
  const Rigid3 here = turned(0.8, {1, 2, 3}, {0.02, 0, 0});
  TakenPlaces taken;
  EXPECT_FALSE(taken.take(*views, here, cameras)) << "nothing else is known";
  taken.set({{views.get(), here}});
  EXPECT_TRUE(taken.take(*views, here, cameras));
  const Eigen::Vector3d place = here * views->center();
  for (int i = 0; i < 12; ++i) {
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(0.5 * i, Eigen::Vector3d(1, i, 2).normalized()));
    const Rigid3 other(turn * here.rotation, place - turn * here.rotation * views->center());
    EXPECT_TRUE(taken.take(*views, other, cameras)) << i;
  }
}

TEST_F(OtherObjects, LeaveRoomBesideThem) {
  const Rigid3 here = turned(0.8, {1, 2, 3}, {0, 0, 0});
  TakenPlaces taken;
  taken.set({{views.get(), here}});
  for (int axis = 0; axis < 3; ++axis) {
    Rigid3 beside = here;
    beside.translation += 1.05 * views->radius() * Eigen::Vector3d::Unit(axis);
    EXPECT_FALSE(taken.take(*views, beside, cameras)) << axis;
  }
}

// As in a box that is open above: the small one's silhouette lies within the large one's.
TEST_F(OtherObjects, LeaveRoomWithin) {
  TriangleMesh large = test::make_carton();
  for (Eigen::Vector3f& vertex : large.vertices) vertex *= 2.5F;
  const auto box = views_of(large);
  TakenPlaces taken;
  taken.set({{box.get(), Rigid3()}});
  EXPECT_FALSE(taken.take(*views, turned(0.3, {0, 0, 1}, {0.01, 0, 0}), cameras));
}

// Against rays: pixels that hit both over pixels that hit either.
TEST_F(OtherObjects, SilhouettesOverlapAsTheirPixelsDo) {
  const test::RayMesh shape(test::make_creature(2000));
  const Rigid3 here = turned(0.8, {1, 2, 3}, {0, 0, 0});
  for (const double shift : {0.0, 0.01, 0.03, 0.06}) {
    const Rigid3 there = turned(1.1, {1, 2, 3}, {shift, 0.5 * shift, 0});
    const CalibratedCamera& camera = rig->cameras().front();
    const Rigid3 camera_from_world = camera.world_from_camera.inverse();
    int both = 0, either = 0;
    for (int y = 0; y < camera.model.height(); y += 2) {
      for (int x = 0; x < camera.model.width(); x += 2) {
        const auto ray = camera.model.unproject({double(x), double(y)});
        if (!ray) continue;
        const auto hits = [&](const Rigid3& pose) {
          const Rigid3 from_camera = (camera_from_world * pose).inverse();
          const Eigen::Vector3d direction = from_camera.rotation * *ray;
          return shape.cast(from_camera.translation.cast<float>(), direction.cast<float>())
              .has_value();
        };
        const bool one = hits(here), two = hits(there);
        both += one && two ? 1 : 0;
        either += one || two ? 1 : 0;
      }
    }
    const auto a = place_mask(*views, camera.model, camera_from_world * here);
    const auto b = place_mask(*views, camera.model, camera_from_world * there);
    ASSERT_TRUE(a && b);
    EXPECT_NEAR(silhouette_overlap(*views, *a, *views, *b), 1.0 * both / either, 0.06) << shift;
  }
}

TEST(RivalPlaces, ThoseOfTwinsAreNone) {
  for (const size_t alike : {0, 1, 2, 3}) {
    RivalPlaces rivals(0.1, alike);
    EXPECT_EQ(rivals.strongest(), 0);
    rivals.add({0, 0, 0}, 0.5);
    rivals.add({1, 0, 0}, 0.7);
    rivals.add({0.05, 0, 0}, 0.6);  // at the place of the first
    rivals.add({0, 1, 0}, 0.4);
    const double expected[] = {0.7, 0.6, 0.4, 0};
    EXPECT_EQ(rivals.strongest(), expected[alike]) << alike;
  }
}

}  // namespace
}  // namespace sightline::observe
