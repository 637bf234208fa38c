// SPDX-License-Identifier: Apache-2.0
#include "observe/track/silhouettes/picture_check.hpp"

#include <gtest/gtest.h>

#include <random>

#include "sightline/image/image.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/lens_camera.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

constexpr PixelLevels kObject{120, 90, 170}, kRoom{130, 128, 128}, kHand{150, 110, 150};

// A carton about the origin, its sides multiplied.
TriangleMesh carton(const Eigen::Vector3f& factors) {
  TriangleMesh mesh = test::make_carton();
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex = vertex.cwiseProduct(factors);
  mesh.min_corner = mesh.min_corner.cwiseProduct(factors);
  mesh.max_corner = mesh.max_corner.cwiseProduct(factors);
  mesh.radius = 0.5f * (mesh.max_corner - mesh.min_corner).norm();
  return mesh;
}

std::shared_ptr<const RenderMesh> renderable(const Eigen::Vector3f& factors) {
  return std::make_shared<const RenderMesh>(make_render_mesh(carton(factors)));
}

// What is really there is drawn; a mesh that may be another is looked for.
class Scene {
 public:
  explicit Scene(const Eigen::Vector3f& factors) {
    object_.silhouette = mesh_depth_renderer_factory(renderable(factors));
    object_.views = ViewpointModel::build(carton(factors), object_.silhouette).value();
    check_.emplace(tracker_, object_);
    fill(0, 0, 640, 480, kRoom);
  }
  static Rigid3 pose() {
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(0.5, Eigen::Vector3d(0.3, 0.9, 0.2).normalized()));
    return Rigid3(turn, Eigen::Vector3d(0.03, 0.01, 0.7));
  }
  void draw(const Eigen::Vector3f& factors, const Rigid3& at) {
    const auto renderer = mesh_depth_renderer_factory(renderable(factors))(tracker_.camera->model);
    const DepthTile tile = renderer->render(at);
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x) {
        if (tile.at(x, y) > 0) set(x, y, kObject);
      }
    }
  }
  void fill(int left, int top, int right, int bottom, const PixelLevels& levels) {
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) set(x, y, levels);
    }
  }
  std::optional<PictureAgreement> examine(const Occluders& occluders = {}) {
    return check_->examine(ColorReader(image_.view()), pose(), occluders);
  }
  bool must_show(const Rigid3& at, const Occluders& occluders = {}) {
    return check_->must_show(ColorReader(image_.view()), at, occluders);
  }

 private:
  void set(int x, int y, const PixelLevels& levels) {
    const MutableI420View view = image_.mutable_view();
    view.y.row(y)[x] = static_cast<uint8_t>(std::clamp(levels.y + noise_(random_), 16.0, 235.0));
    view.u.row(y / 2)[x / 2] = levels.u;
    view.v.row(y / 2)[x / 2] = levels.v;
  }

  std::mt19937 random_{7};
  std::normal_distribution<double> noise_{0, 6};
  TrackerCamera tracker_{std::make_shared<const CalibratedCamera>(test::lens_camera()), {}, {}};
  TrackedObject object_;
  Image image_{640, 480};
  std::optional<PictureCheck> check_;
};

const Eigen::Vector3f kWhole(1, 1, 1);

TEST(PictureCheck, TheWholeObjectAndNothingElseIsExplained) {
  Scene scene(kWhole);
  scene.draw(kWhole, Scene::pose());
  const auto found = scene.examine();
  ASSERT_TRUE(found);
  EXPECT_LT(found->unexplained, 0.02);
  EXPECT_LT(found->missing, 0.02);
}

TEST(PictureCheck, APartLeavesTheRestUnexplained) {
  Scene scene(Eigen::Vector3f(1, 0.5f, 1));  // half of what is there
  scene.draw(kWhole, Scene::pose());
  const auto found = scene.examine();
  ASSERT_TRUE(found);
  EXPECT_GT(found->unexplained, 0.3);
  EXPECT_LT(found->missing, 0.02);
}

TEST(PictureCheck, WhatIsLargerThanTheObjectMissesAPart) {
  Scene scene(Eigen::Vector3f(1, 1.7f, 1));
  scene.draw(kWhole, Scene::pose());
  const auto found = scene.examine();
  ASSERT_TRUE(found);
  EXPECT_LT(found->unexplained, 0.02);
  EXPECT_GT(found->missing, 0.1);
}

TEST(PictureCheck, AHandOfAnotherColorIsNoEvidence) {
  Scene scene(kWhole);
  scene.draw(kWhole, Scene::pose());
  scene.fill(300, 190, 350, 330, kHand);
  const auto found = scene.examine();
  ASSERT_TRUE(found);
  EXPECT_LT(found->unexplained + found->missing, 0.1);
}

TEST(PictureCheck, AnotherObjectBesideItIsNoEvidence) {
  Scene scene(kWhole);
  scene.draw(kWhole, Scene::pose());
  Rigid3 beside = Scene::pose();
  beside.translation.x() += 0.1;
  scene.draw(kWhole, beside);
  const auto alone = scene.examine();
  ASSERT_TRUE(alone);
  EXPECT_GT(alone->unexplained, 0.15) << "it touches and has the same color";
  const OccludingSphere other{beside.translation, 0.07};
  Occluders occluders;
  occluders.spheres = {&other, 1};
  const auto known = scene.examine(occluders);
  ASSERT_TRUE(known);
  EXPECT_LT(known->unexplained, 0.05);
}

TEST(PictureCheck, TheColorsOfTheRoomSayNothing) {
  Scene scene(kWhole);
  scene.fill(0, 0, 640, 480, kObject);
  EXPECT_FALSE(scene.examine());
}

TEST(PictureCheck, AnObjectMustShowUnlessOutOfTheImageOrHidden) {
  Scene scene(kWhole);
  EXPECT_TRUE(scene.must_show(Scene::pose()));
  Rigid3 beside = Scene::pose(), behind = Scene::pose();
  beside.translation.x() = 0.36;  // its middle is at the border
  behind.translation.z() = -0.7;
  EXPECT_FALSE(scene.must_show(beside));
  EXPECT_FALSE(scene.must_show(behind));
  const OccludingSphere wall{{0.015, 0.005, 0.4}, 0.08};
  Occluders occluders;
  occluders.spheres = {&wall, 1};
  EXPECT_FALSE(scene.must_show(Scene::pose(), occluders));
}

}  // namespace
}  // namespace sightline::observe
