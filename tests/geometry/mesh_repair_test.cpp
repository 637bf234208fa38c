// SPDX-License-Identifier: Apache-2.0
#include "geometry/repair/mesh_repair.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "mesh_samples.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using namespace geometry;
using test::area_vector;
using test::IsOk;
using test::volume;

std::string as_obj(const TriangleMesh& mesh) {
  std::string out;
  for (const Eigen::Vector3f& v : mesh.vertices)
    out += fmt::format("v {:.9g} {:.9g} {:.9g}\n", v.x(), v.y(), v.z());
  for (const auto& f : mesh.faces) out += fmt::format("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1);
  return out;
}

TriangleMesh read(const TriangleMesh& mesh) {
  auto out = parse_mesh(as_obj(mesh), "obj", "test");
  EXPECT_THAT(out, IsOk());
  return out ? *std::move(out) : TriangleMesh();
}

TriangleMesh torus() { return make_bumpy_torus(2000, 0.1f); }

void expect_like_torus(const TriangleMesh& mesh) {
  const TriangleMesh right = torus();
  EXPECT_TRUE(mesh.closed);
  EXPECT_EQ(mesh.vertices.size(), right.vertices.size());
  EXPECT_EQ(mesh.faces.size(), right.faces.size());
  EXPECT_NEAR(volume(mesh), volume(right), 1e-3 * volume(right));
}

/// An open box of side 1 about the origin: no lid.
TriangleMesh open_box() {
  TriangleMesh box = make_box({1, 1, 1});
  std::erase_if(box.faces, [&](const auto& f) {
    return box.vertices[f[0]].z() > 0 && box.vertices[f[1]].z() > 0 && box.vertices[f[2]].z() > 0;
  });
  return box;
}

bool outward(const TriangleMesh& mesh, size_t face) {
  const auto& f = mesh.faces[face];
  const Eigen::Vector3f sum = mesh.vertices[f[0]] + mesh.vertices[f[1]] + mesh.vertices[f[2]];
  return area_vector(mesh, face).dot(sum.cast<double>()) > 0;
}

TEST(MeshRepair, LeavesWhatIsRightAlone) {
  expect_like_torus(read(torus()));
  TriangleMesh mesh = torus();
  repair_mesh(&mesh);
  EXPECT_EQ(mesh.faces, torus().faces);
  EXPECT_EQ(mesh.face_normals, torus().face_normals);
  EXPECT_EQ(read(open_box()).faces.size(), 10u);
}

TEST(MeshRepair, FacesThatRunEitherWayRunOutward) {
  TriangleMesh mesh = torus();
  std::mt19937 random(7);
  for (auto& face : mesh.faces) {
    if (random() % 2 == 0) std::swap(face[0], face[1]);
  }
  EXPECT_FALSE(finish_mesh(mesh, "as it is").value().closed);
  expect_like_torus(read(mesh));
}

TEST(MeshRepair, AnInsideOutMeshIsTurned) {
  TriangleMesh mesh = torus();
  for (auto& face : mesh.faces) std::swap(face[1], face[2]);
  expect_like_torus(read(mesh));
}

TEST(MeshRepair, EachPartHasItsOwnOutside) {
  TriangleMesh mesh = torus(), other = torus();
  const auto count = static_cast<uint32_t>(mesh.vertices.size());
  for (Eigen::Vector3f& v : other.vertices)
    mesh.vertices.emplace_back(v + Eigen::Vector3f(1, 0, 0));
  for (auto& f : other.faces) mesh.faces.push_back({f[0] + count, f[2] + count, f[1] + count});
  EXPECT_NEAR(volume(read(mesh)), 2 * volume(torus()), 1e-3 * volume(torus()));
}

// Every triangle brings its own corners, and they are rounded differently.
TEST(MeshRepair, CornersThatNearlyMeetAreOne) {
  const TriangleMesh right = torus();
  TriangleMesh mesh;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> off(-2e-7f, 2e-7f);
  for (const auto& face : right.faces) {
    const auto first = static_cast<uint32_t>(mesh.vertices.size());
    for (const uint32_t v : face) {
      mesh.vertices.emplace_back(right.vertices[v] +
                                 Eigen::Vector3f(off(random), off(random), off(random)));
    }
    mesh.faces.push_back({first, first + 1, first + 2});
  }
  EXPECT_FALSE(finish_mesh(mesh, "as it is").value().closed);
  expect_like_torus(read(mesh));
}

// A tenth of a millimeter on something of 20 cm is a part, as a label on a box is.
TEST(MeshRepair, WhatIsApartStaysApart) {
  TriangleMesh mesh = make_box({0.2f, 0.2f, 0.2f});
  const auto count = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(),
                       {{0.1001f, -0.1f, -0.1f}, {0.1001f, 0.1f, -0.1f}, {0.1001f, 0.1f, 0.1f}});
  mesh.faces.push_back({count, count + 1, count + 2});
  EXPECT_EQ(read(mesh).vertices.size(), 11u);
}

TEST(MeshRepair, ASheetModeledFromBothSidesIsOneSheet) {
  TriangleMesh mesh = open_box();
  const size_t count = mesh.faces.size();
  for (size_t f = 0; f < count; ++f)
    mesh.faces.push_back({mesh.faces[f][1], mesh.faces[f][0], mesh.faces[f][2]});
  const TriangleMesh read_back = read(mesh);
  EXPECT_EQ(read_back.faces.size(), count);
  EXPECT_FALSE(read_back.closed);
}

TEST(MeshRepair, AnOpenShapeHasAnOutsideToo) {
  TriangleMesh mesh = make_box({1, 1, 1});
  mesh.faces.pop_back();  // half of a side
  mesh.faces.pop_back();
  for (size_t f = 1; f < mesh.faces.size(); ++f) std::swap(mesh.faces[f][1], mesh.faces[f][2]);
  const TriangleMesh box = read(mesh);
  for (size_t f = 0; f < box.faces.size(); ++f) EXPECT_TRUE(outward(box, f)) << f;
}

TEST(MeshRepair, AFlatSheetKeepsTheDirectionOfMostOfIt) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {3, 0, 0}, {3, 1, 0}};
  mesh.faces = {{0, 2, 1}, {0, 3, 2}, {1, 4, 5}, {1, 5, 2}};
  const TriangleMesh sheet = read(mesh);
  for (size_t f = 0; f < sheet.faces.size(); ++f) EXPECT_GT(area_vector(sheet, f).z(), 0) << f;
}

TEST(MeshRepair, WhatHasOneSideStaysAsItIs) {
  TriangleMesh mesh;
  constexpr uint32_t kSteps = 12;
  for (uint32_t i = 0; i < kSteps; ++i) {
    const double turn = 2 * M_PI * i / kSteps;
    for (const double side : {-0.3, 0.3}) {
      const double out = 1 + side * std::cos(turn / 2);
      mesh.vertices.emplace_back(
          Eigen::Vector3d(out * std::cos(turn), out * std::sin(turn), side * std::sin(turn / 2))
              .cast<float>());
    }
  }
  for (uint32_t i = 0; i < kSteps; ++i) {
    const uint32_t a = 2 * i, b = a + 1;
    const bool last = i + 1 == kSteps;
    const uint32_t c = last ? 1 : a + 2, d = last ? 0 : a + 3;
    mesh.faces.insert(mesh.faces.end(), {{a, c, b}, {b, c, d}});
  }
  const TriangleMesh strip = read(mesh);
  ASSERT_EQ(strip.faces.size(), mesh.faces.size());
  for (size_t f = 0; f < strip.faces.size(); ++f)
    EXPECT_GT(area_vector(strip, f).dot(area_vector(mesh, f)), 0) << f;
}

TEST(MeshRepair, NormalsOfReversedFacesLookOutward) {
  TriangleMesh mesh = torus();
  for (auto& face : mesh.faces) std::swap(face[1], face[2]);
  for (auto& face : mesh.face_normals) std::swap(face[1], face[2]);
  for (Eigen::Vector3f& normal : mesh.normals) normal = -normal;
  const size_t faces = mesh.faces.size();
  repair_mesh(&mesh);
  ASSERT_EQ(mesh.face_normals.size(), faces);
  for (size_t f = 0; f < faces; ++f) {
    for (const uint32_t n : mesh.face_normals[f])
      EXPECT_GT(mesh.normals[n].cast<double>().dot(area_vector(mesh, f)), 0) << f;
  }
}

TEST(MeshRepair, ASurfaceIsTurnedWithWhatIsPaintedOnIt) {
  MeshSurface surface;
  const TriangleMesh box = make_box({1, 1, 1});
  for (size_t f = 0; f < box.faces.size(); ++f) {
    SurfaceTriangle triangle;
    for (size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3f& corner = box.vertices[box.faces[f][f % 2 == 0 ? i : 2 - i]];
      triangle.corners[i] = corner;
      triangle.places[i] = corner.head<2>();
      triangle.corner_colors[i] = corner;
    }
    surface.triangles.push_back(triangle);
  }
  surface.triangles.push_back(surface.triangles[3]);  // twice
  repair_surface(&surface);
  ASSERT_EQ(surface.triangles.size(), box.faces.size());
  for (const SurfaceTriangle& triangle : surface.triangles) {
    const auto& c = triangle.corners;
    EXPECT_GT((c[1] - c[0]).cross(c[2] - c[0]).dot(c[0] + c[1] + c[2]), 0);
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(triangle.places[i], Eigen::Vector2f(c[i].head<2>()));
      EXPECT_EQ(triangle.corner_colors[i], c[i]);
    }
  }
}

// What finish_mesh() refuses, and crowds of vertices, come through.
TEST(MeshRepair, AnythingComesThrough) {
  TriangleMesh mesh;
  EXPECT_TRUE(find_mesh_repair(mesh.vertices, mesh.faces).faces.empty());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float most = std::numeric_limits<float>::max();
  mesh.vertices = {{0, 0, nan}, {most, -most, 0}, {1e-38f, 0, 0}};
  mesh.faces = {{0, 1, 2}, {0, 0, 0}, {1, 2, 2}};
  EXPECT_EQ(find_mesh_repair(mesh.vertices, mesh.faces).faces.size(), 3u);
  mesh.vertices[0].setZero();
  EXPECT_EQ(find_mesh_repair(mesh.vertices, mesh.faces).vertices[2], 0u);
  mesh.vertices.assign(3, {1, 2, 3});
  EXPECT_EQ(find_mesh_repair(mesh.vertices, mesh.faces).faces.size(), 3u);
  mesh.vertices = {{1, 1, 1}};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> close(0, 2e-4f);
  for (int i = 0; i < 100'000; ++i)
    mesh.vertices.emplace_back(close(random), close(random), close(random));
  mesh.faces = {{0, 1, 2}};
  EXPECT_EQ(find_mesh_repair(mesh.vertices, mesh.faces).vertices.size(), mesh.vertices.size());
}

}  // namespace
}  // namespace sightline
