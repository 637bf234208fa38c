// SPDX-License-Identifier: Apache-2.0
#include "support/scene_shapes.hpp"

#include <gmock/gmock.h>

#include "sightline/config/object_file.hpp"
#include "support/matchers.hpp"

namespace sightline::test {
namespace {

double volume(const TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& f : mesh.faces) {
    Eigen::Matrix3d corners;
    for (int i = 0; i < 3; ++i) {
      corners.col(i) = mesh.vertices[f[static_cast<size_t>(i)]].cast<double>();
    }
    sum += corners.determinant() / 6;
  }
  return sum;
}

TEST(SceneShapes, AreClosedAndTurnOutward) {
  for (const TriangleMesh& mesh :
       {make_creature(2000), make_truck(), make_bottle(1000), make_bracket(), make_carton()}) {
    EXPECT_TRUE(mesh.closed);
    EXPECT_GT(volume(mesh), 3e-5);
    EXPECT_LT(volume(mesh), 1e-3);
  }
}

TEST(SceneShapes, HaveTheFacesTheyAreAskedFor) {
  for (const size_t faces : {1000u, 15'000u, 100'000u}) {
    EXPECT_NEAR(static_cast<double>(make_creature(faces).faces.size()) / static_cast<double>(faces),
                1.0, 0.15);
  }
}

TEST(SceneShapes, CreatureHasTheSizeItClaims) {
  const TriangleMesh mesh = make_creature(4000);
  const Eigen::Vector3f size = mesh.max_corner - mesh.min_corner;
  EXPECT_THAT(size, MatrixNear(Eigen::Vector3d(0.103, 0.046, 0.072), 1e-3));
}

TEST(SceneShapes, BottleLooksTheSameAtEveryTurn) {
  for (const auto& v : make_bottle(3000).vertices) {
    EXPECT_LT(Eigen::Vector2f(v.x(), v.y()).norm(), 0.035f);
  }
}

TEST(SceneShapes, AreReadBackFromTheirObjectFile) {
  const std::filesystem::path folder = ::testing::TempDir() + "scene_shapes";
  std::filesystem::create_directories(folder);
  const TriangleMesh truck = make_truck();
  const auto file = write_object(folder, "truck", truck, Symmetry::kDiscrete, 2);
  ASSERT_THAT(file, IsOk());
  const auto object = read_object_file(*file);
  ASSERT_THAT(object, IsOk());
  EXPECT_EQ(object->symmetry, Symmetry::kDiscrete);
  EXPECT_EQ(object->symmetry_order, 2);
  const auto mesh = read_mesh(object->mesh);
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), truck.faces.size());
  ASSERT_EQ(mesh->face_colors.size(), truck.faces.size());
  EXPECT_THAT(mesh->max_corner, MatrixNear(truck.max_corner, 1e-6));
}

}  // namespace
}  // namespace sightline::test
