// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>

#include "mesh_samples.hpp"
#include "sightline/base/files.hpp"
#include "support/matchers.hpp"

namespace sightline {
namespace {

using test::area;
using test::FailsWith;
using test::IsOk;
using test::MatrixNear;
using test::volume;

const std::string kMeshes = SIGHTLINE_SOURCE_DIR "/tests/geometry/meshes/";

TriangleMesh square() {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

TEST(Mesh, BoxIsClosedAndOutward) {
  const TriangleMesh box = make_box({1, 2, 3});
  EXPECT_EQ(box.vertices.size(), 8u);
  EXPECT_EQ(box.faces.size(), 12u);
  EXPECT_TRUE(box.closed);
  EXPECT_NEAR(volume(box), 6, 1e-6);
  EXPECT_THAT(box.max_corner, MatrixNear(Eigen::Vector3f(0.5f, 1, 1.5f), 0));
  EXPECT_THAT(box.center, MatrixNear(Eigen::Vector3f(0, 0, 0), 0));
  EXPECT_NEAR(box.radius, 0.5 * std::sqrt(14.0), 1e-6);
  for (size_t f = 0; f < box.faces.size(); ++f) {
    for (size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3f n = box.normals[box.face_normals[f][i]];
      EXPECT_FLOAT_EQ(n.cwiseAbs().maxCoeff(), 1) << "a box is not smooth";
      EXPECT_GT(n.dot(box.vertices[box.faces[f][i]]), 0);
    }
  }
}

TEST(Mesh, TorusIsClosedSmoothAndOfTheSizeAskedFor) {
  for (size_t faces : {32u, 1000u, 10'000u}) {
    const TriangleMesh torus = make_bumpy_torus(faces, 0.2f);
    EXPECT_NEAR(static_cast<double>(torus.faces.size()), static_cast<double>(faces),
                0.2 * static_cast<double>(faces));
    EXPECT_TRUE(torus.closed);
    EXPECT_GT(volume(torus), 0);
    EXPECT_LE(torus.radius, 0.21f);
    EXPECT_GE(torus.radius, 0.12f);
    if (faces >= 1000) {
      EXPECT_EQ(torus.normals.size(), torus.vertices.size());
    }
  }
}

TEST(Mesh, NormalsAreSmoothBelowTheCreaseAngleOnly) {
  // Two squares folded along x = 1 by 0.5 rad.
  TriangleMesh mesh = square();
  mesh.vertices.insert(mesh.vertices.end(), {{1.8776f, 0, 0.4794f}, {1.8776f, 1, 0.4794f}});
  mesh.faces.insert(mesh.faces.end(), {{1, 4, 5}, {1, 5, 2}});
  MeshOptions options;
  options.crease_angle = 0.6f;
  const auto smooth = finish_mesh(mesh, "test", options);
  ASSERT_THAT(smooth, IsOk());
  EXPECT_EQ(smooth->face_normals[0][1], smooth->face_normals[2][0]);
  options.crease_angle = 0.4f;
  const auto creased = finish_mesh(mesh, "test", options);
  ASSERT_THAT(creased, IsOk());
  EXPECT_NE(creased->face_normals[0][1], creased->face_normals[2][0]);
  EXPECT_FALSE(creased->closed);
}

TEST(Mesh, MergesVerticesAtOnePlaceAndKeepsTheOrder) {
  TriangleMesh mesh;
  mesh.vertices = {{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-0.0f, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.faces = {{1, 2, 3}, {4, 5, 6}};
  const auto welded = finish_mesh(mesh, "test");
  ASSERT_THAT(welded, IsOk());
  EXPECT_EQ(welded->vertices.size(), 4u);  // the unused one is gone too
  EXPECT_EQ(welded->faces[1], (std::array<uint32_t, 3>{0, 2, 3}));
  EXPECT_THAT(welded->max_corner, MatrixNear(Eigen::Vector3f(1, 1, 0), 0));
}

TEST(Mesh, DropsFacesWithoutArea) {
  TriangleMesh mesh = square();
  mesh.vertices.push_back({0.5f, 0, 0});
  mesh.faces.push_back({0, 4, 1});  // on a line
  mesh.faces.push_back({2, 2, 3});
  const auto finished = finish_mesh(mesh, "test");
  ASSERT_THAT(finished, IsOk());
  EXPECT_EQ(finished->faces.size(), 2u);
  mesh.faces = {{0, 4, 1}};
  EXPECT_THAT(finish_mesh(mesh, "test"), FailsWith("test: no face of the mesh has an area"));
}

TEST(Mesh, GivenNormalsAreMadeUnitAndZeroOnesReplaced) {
  TriangleMesh mesh = square();
  mesh.normals = {{0, 0, 5}, {0, 0, 0}};
  mesh.face_normals = {{0, 0, 0}, {1, 1, 0}};
  const auto finished = finish_mesh(mesh, "test");
  ASSERT_THAT(finished, IsOk());
  for (const auto& face : finished->face_normals) {
    for (uint32_t n : face) {
      EXPECT_THAT(finished->normals[n], MatrixNear(Eigen::Vector3f(0, 0, 1), 1e-6));
    }
  }
}

TEST(Mesh, AppliesTheUnit) {
  MeshOptions millimeters;
  millimeters.meters_per_unit = 0.001;
  const auto mesh = finish_mesh(square(), "test", millimeters);
  ASSERT_THAT(mesh, IsOk());
  EXPECT_NEAR(area(*mesh), 1e-6, 1e-12);
  EXPECT_FLOAT_EQ(mesh->max_corner.x(), 0.001f);
}

TEST(Mesh, RefusesWhatCannotBeDrawn) {
  TriangleMesh mesh = square();
  mesh.vertices[2].y() = std::nanf("");
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("m: vertex 2 is not finite"));
  mesh = square();
  mesh.vertices[3].x() = std::numeric_limits<float>::infinity();
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("vertex 3 is not finite"));
  mesh = square();
  mesh.faces[1][2] = 99;
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("m: face 1: vertex index 99 of 4"));
  mesh = square();
  mesh.faces.clear();
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("m: mesh has no faces"));
  mesh = square();
  for (auto& v : mesh.vertices) v *= 5000;
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("is the unit right"));
  for (auto& v : mesh.vertices) v *= 1e-12f;
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("is the unit right"));
  mesh = square();
  mesh.normals = {{0, 0, 1}};
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("2 faces but normals for 0"));
  mesh.face_normals = {{0, 0, 0}, {0, 1, 0}};
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("face 1: normal index 1 of 1"));
  mesh = square();
  mesh.face_colors = {{0, 0, 1}};
  EXPECT_THAT(finish_mesh(mesh, "m"), FailsWith("colors for 1"));
  MeshOptions options;
  options.max_faces = 1;
  EXPECT_THAT(finish_mesh(square(), "m", options), FailsWith("the limit is 1"));
  options = {};
  options.meters_per_unit = 0;
  EXPECT_THAT(finish_mesh(square(), "m", options), FailsWith("unit"));
}

/// A fan of thousands of faces around one vertex must not take the square of their number.
TEST(Mesh, ManyFacesAroundOneVertexAreNoTrap) {
  TriangleMesh fan;
  fan.vertices.push_back({0, 0, 1});
  constexpr uint32_t kFaces = 200'000;
  for (uint32_t i = 0; i < kFaces; ++i) {
    const float a = 6.2831853f * static_cast<float>(i) / static_cast<float>(kFaces);
    fan.vertices.push_back({std::cos(a), std::sin(a), 0});
    fan.faces.push_back({0, i + 1, (i + 1) % kFaces + 1});
  }
  EXPECT_THAT(finish_mesh(fan, "fan"), IsOk());
}

TEST(Mesh3vn, ReadsTheBarn) {
  const auto barn = read_mesh(kMeshes + "barn.3vn");
  ASSERT_THAT(barn, IsOk());
  EXPECT_EQ(barn->vertices.size(), 10u);
  EXPECT_EQ(barn->faces.size(), 5 * 2 + 2 * 3u);
  EXPECT_TRUE(barn->closed);
  EXPECT_NEAR(volume(*barn), 1.25, 1e-6);
  EXPECT_EQ(barn->normals.size(), 7u);
  EXPECT_EQ(barn->face_normals.back()[0], 6u);
}

TEST(Mesh3vn, MayDoWithoutNormalsAndLineBreaks) {
  const auto mesh = parse_3vn("3 0 1 0 0 0 1 0 0 0 1 0 3 0 1 2", "t.3vn");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_THAT(mesh->normals[mesh->face_normals[0][0]], MatrixNear(Eigen::Vector3f(0, 0, 1), 1e-6));
}

/// An L: cutting it as a fan from its first corner would cover the notch.
TEST(Mesh3vn, CutsConcavePolygonsProperly) {
  const auto mesh = parse_3vn(
      "6 1 1\n 0 0 0  2 0 0  2 2 0  1 2 0  1 1 0  0 1 0\n 0 0 1\n 6 0 1 2 3 4 5 0 0 0 0 0 0",
      "l.3vn");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 4u);
  EXPECT_NEAR(area(*mesh), 3, 1e-6);
  for (size_t f = 0; f < 4; ++f) EXPECT_GT(test::area_vector(*mesh, f).z(), 0);
}

TEST(Mesh3vn, NamesFileAndLineOfAFault) {
  const auto barn = read_file(kMeshes + "barn.3vn").value();
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = barn;
    text.replace(text.find(from), from.size(), to);
    return parse_3vn(text, "barn.3vn");
  };
  EXPECT_THAT(with("4   3 4 9 8", "4   3 4 9 99"),
              FailsWith("barn.3vn:12: face 1: vertex index 99 of 10"));
  EXPECT_THAT(with("4 4 4 4\n", "4 4 -4 4\n"),
              FailsWith("barn.3vn:15: face 4: normal index -4 of 7"));
  EXPECT_THAT(with("0 1 0\n", "0 nan 0\n"), FailsWith("barn.3vn:2: vertex 4 is not finite"));
  EXPECT_THAT(with("0 1 0\n", "0 1e99 0\n"), FailsWith("barn.3vn:2: vertex 4 is not finite"));
  EXPECT_THAT(with("-1 0 0\n", "-1 x 0\n"),
              FailsWith("barn.3vn:4: 'x' is not a number (normal 0)"));
  EXPECT_THAT(with("10 7 7", "10 7 8"), FailsWith("barn.3vn:18: file ends where the number of"));
  EXPECT_THAT(with("10 7 7", "10 7 6"), FailsWith("barn.3vn:17: text after the last of 6 faces"));
  EXPECT_THAT(with("10 7 7", "10 7 0"), FailsWith("0 faces"));
  EXPECT_THAT(with("10 7 7", "10 7 4000000000"), FailsWith("more than the file can hold"));
  EXPECT_THAT(with("5   0 4 3", "2   0 4 3"), FailsWith("face 6: 2 corners"));
  EXPECT_THAT(parse_3vn("", "empty.3vn"), FailsWith("empty.3vn:1: file ends"));
}

TEST(MeshFormats, AllDescribeTheSameTetrahedron) {
  for (const auto& [format, text] : test::tetrahedra()) {
    const auto mesh = parse_mesh(text, format, "t." + format);
    ASSERT_THAT(mesh, IsOk()) << format;
    EXPECT_EQ(mesh->vertices.size(), 4u) << format;
    EXPECT_EQ(mesh->faces.size(), 4u) << format;
    EXPECT_TRUE(mesh->closed) << format;
    EXPECT_NEAR(volume(*mesh), 1.0 / 6, 1e-6) << format;
    EXPECT_EQ(mesh->face_normals.size(), 4u) << format;
    EXPECT_TRUE(mesh->face_colors.empty()) << format;
  }
}

TEST(MeshFormats, ObjPolygonsMaterialsAndUnit) {
  const std::filesystem::path folder = testing::TempDir() + "sightline_mesh_test";
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(write_file_atomically(folder / "l.mtl",
                                    "newmtl red\nKd 0.9 0.1 0.2\nnewmtl blue\nKd 0 0 1\n"));
  ASSERT_TRUE(write_file_atomically(folder / "l.obj",
                                    "mtllib l.mtl\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 2 0\nv 1 1 0\n"
                                    "v 0 1 0\nv 3 0 0\nusemtl red\nf 1 2 3 4 5 6\nusemtl blue\n"
                                    "f 2 7 3\n"));
  MeshOptions millimeters;
  millimeters.meters_per_unit = 0.001;
  const auto mesh = read_mesh(folder / "l.obj", millimeters);
  ASSERT_THAT(mesh, IsOk());
  EXPECT_EQ(mesh->faces.size(), 5u);
  EXPECT_NEAR(area(*mesh), 4e-6, 1e-10);
  ASSERT_EQ(mesh->face_colors.size(), 5u);
  EXPECT_THAT(mesh->face_colors[0], MatrixNear(Eigen::Vector3f(0.9f, 0.1f, 0.2f), 1e-6));
  EXPECT_THAT(mesh->face_colors[4], MatrixNear(Eigen::Vector3f(0, 0, 1), 1e-6));
  std::filesystem::remove_all(folder);
}

/// A material library outside the mesh's folder, or one that never ends, is not opened.
TEST(MeshFormats, CompanionFilesStayInTheFolder) {
  const std::filesystem::path folder = testing::TempDir() + "sightline_mesh_inside";
  std::filesystem::create_directories(folder);
  for (const std::string library : {"/dev/zero", "../../../../../../dev/zero", "missing.mtl"}) {
    ASSERT_TRUE(write_file_atomically(
        folder / "t.obj", "mtllib " + library + "\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
    EXPECT_THAT(read_mesh(folder / "t.obj"), IsOk()) << library;
  }
  std::filesystem::remove_all(folder);
}

TEST(MeshFormats, NodeTransformsApplyAndMirrorsKeepFacesOutward) {
  std::string text;
  for (const auto& [format, sample] : test::tetrahedra()) {
    if (format == "gltf") text = sample;
  }
  const std::string node = "\"mesh\":0";
  text.replace(text.find(node), node.size(),
               "\"mesh\":0,\"translation\":[1,2,3],\"scale\":[-2,1,1]");
  const auto mesh = parse_mesh(text, "gltf", "t.gltf");
  ASSERT_THAT(mesh, IsOk());
  EXPECT_NEAR(volume(*mesh), 2.0 / 6, 1e-6);
  EXPECT_THAT(mesh->min_corner, MatrixNear(Eigen::Vector3f(-1, 2, 3), 1e-6));
  EXPECT_THAT(mesh->max_corner, MatrixNear(Eigen::Vector3f(1, 3, 4), 1e-6));
}

TEST(MeshFormats, RefusesUnknownFormatsAndMissingFiles) {
  EXPECT_THAT(parse_mesh("", "blend", "x.blend"), FailsWith("x.blend: 'blend' is no mesh format"));
  EXPECT_THAT(read_mesh("/nonexistent/x.obj"), FailsWith("/nonexistent/x.obj: cannot open"));
  EXPECT_THAT(read_mesh("/"), FailsWith("not a regular file"));
}

TEST(MeshFormats, ReadsTheRecordedObjects) {
  const std::string recordings = SIGHTLINE_SOURCE_DIR "/../shared/recordings/";
  if (!std::filesystem::exists(recordings)) GTEST_SKIP() << "no recordings beside the source";
  const auto carton = read_mesh(recordings + "bench/objects/carton.obj");
  ASSERT_THAT(carton, IsOk());
  EXPECT_TRUE(carton->closed);
  EXPECT_GT(volume(*carton), 0);
  const auto truck = read_mesh(recordings + "toy/objects/truck.obj");
  ASSERT_THAT(truck, IsOk());
  EXPECT_EQ(truck->face_colors.size(), truck->faces.size());
  EXPECT_THAT(read_mesh(recordings + "bench/scene.obj"), IsOk());
}

}  // namespace
}  // namespace sightline
