// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/mesh_edges.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <utility>
#include <vector>

namespace sightline {
namespace {

constexpr double kCrease = 0.5;  // [rad]
constexpr float kSide = 0.2f;    // [m]

/// A box of `steps` x `steps` squares a side, each corner of them off by `noise` [m] at random.
TriangleMesh scanned_box(int steps, float noise) {
  TriangleMesh mesh;
  for (int side = 0; side < 6; ++side) {
    const int axis = side / 2;
    const float sign = side % 2 == 0 ? 1.0f : -1.0f;
    const auto corner = [&](int u, int v) {
      Eigen::Vector3f at;
      // Whole numbers: the same from either side.
      at[axis] = sign * static_cast<float>(steps);
      at[(axis + 1) % 3] = static_cast<float>(2 * u - steps);
      at[(axis + 2) % 3] = sign * static_cast<float>(2 * v - steps);
      mesh.vertices.emplace_back(kSide / 2 / static_cast<float>(steps) * at);
      return static_cast<uint32_t>(mesh.vertices.size() - 1);
    };
    for (int u = 0; u < steps; ++u) {
      for (int v = 0; v < steps; ++v) {
        const uint32_t a = corner(u, v), b = corner(u + 1, v), c = corner(u + 1, v + 1),
                       d = corner(u, v + 1);
        mesh.faces.insert(mesh.faces.end(), {{a, b, c}, {a, c, d}});
      }
    }
  }
  TriangleMesh out = finish_mesh(std::move(mesh), "box").value();
  std::mt19937 random(7);
  std::normal_distribution<float> off(0, noise);
  for (Eigen::Vector3f& v : out.vertices)
    if (noise > 0) v += Eigen::Vector3f(off(random), off(random), off(random));
  return out;
}

/// How far a point is from the nearest of a box's twelve edges, and the axis of that.
std::pair<float, int> nearest_edge(const Eigen::Vector3f& point) {
  std::pair<float, int> best{1e9f, 0};
  for (int axis = 0; axis < 3; ++axis) {
    const float a = std::abs(point[(axis + 1) % 3]) - kSide / 2;
    const float b = std::abs(point[(axis + 2) % 3]) - kSide / 2;
    best = std::min(best, {std::hypot(a, b), axis});
  }
  return best;
}

struct Judged {
  double length = 0, right = 0, straight = 0;  // in all, near a true edge, and along it
};

Judged judge(const TriangleMesh& mesh) {
  Judged out;
  for (const MeshEdge& edge : feature_edges(mesh, kCrease)) {
    const Eigen::Vector3f a = mesh.vertices[edge.start], b = mesh.vertices[edge.end];
    const double length = static_cast<double>((b - a).norm());
    EXPECT_NEAR(edge.tangent.norm(), 1, 1e-5);
    EXPECT_GT(edge.tangent.dot(b - a), 0);
    const auto [off, axis] = nearest_edge((a + b) / 2);
    out.length += length;
    if (off > 0.04f * mesh.radius) continue;
    out.right += length;
    if (std::abs(edge.tangent[axis]) > 0.95f) out.straight += length;
  }
  return out;
}

TEST(FeatureEdges, OfABoxAreTwelve) {
  const TriangleMesh box = make_box({1, 2, 3});
  const auto edges = feature_edges(box, kCrease);
  EXPECT_EQ(edges.size(), 12u);
  for (const MeshEdge& edge : edges) {
    EXPECT_NE(edge.first_face, edge.second_face);
    EXPECT_FLOAT_EQ(edge.tangent.cwiseAbs().maxCoeff(), 1);
  }
  EXPECT_TRUE(feature_edges(box, 1.6).empty()) << "right angles";
}

TEST(FeatureEdges, BordersAndEdgesOfThreeFacesShow) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0.2f, 0, 1}};
  mesh.faces = {{0, 1, 2}, {1, 0, 3}};
  EXPECT_EQ(feature_edges(mesh, kCrease).size(), 4u);
  mesh.faces.push_back({0, 1, 4});
  EXPECT_EQ(feature_edges(mesh, kCrease).size(), 7u);
}

TEST(FeatureEdges, SmallFacesMakeNoLines) {
  const TriangleMesh fine = scanned_box(40, 0);
  const Judged judged = judge(fine);
  EXPECT_NEAR(judged.length, 12 * static_cast<double>(kSide), 1e-4);
  EXPECT_NEAR(judged.straight, judged.length, 1e-4);
}

// Noise that bends a third of all edges more than a crease is.
TEST(FeatureEdges, OfANoisyScanAreThoseOfTheShape) {
  const TriangleMesh scan = scanned_box(60, 0.0006f);
  const TriangleMesh few = scanned_box(20, 0.0018f);  // faces too large for means
  const Judged noise = judge(few), judged = judge(scan);
  EXPECT_LT(noise.right, 0.5 * noise.length) << "no noise to speak of";
  EXPECT_GT(judged.right, 0.97 * judged.length);
  EXPECT_GT(judged.straight, 0.9 * judged.length);
  EXPECT_GT(judged.length, 12 * static_cast<double>(kSide)) << "each edge shows";
}

// Where faces are no smaller than what a mean reaches over, they are the shape.
TEST(FeatureEdges, OfACoarseModelAreAllItsCreases) {
  const TriangleMesh torus = make_bumpy_torus(1500, 0.1f);
  std::map<std::pair<uint32_t, uint32_t>, std::vector<Eigen::Vector3f>> normals;
  for (const auto& f : torus.faces) {
    const Eigen::Vector3f& p = torus.vertices[f[0]];
    const Eigen::Vector3f normal =
        (torus.vertices[f[1]] - p).cross(torus.vertices[f[2]] - p).normalized();
    for (size_t i = 0; i < 3; ++i) normals[std::minmax({f[i], f[(i + 1) % 3]})].push_back(normal);
  }
  const double angle = 0.2;  // less than the way around the tube takes
  const auto creases = std::count_if(normals.begin(), normals.end(), [&](const auto& edge) {
    return edge.second[0].dot(edge.second[1]) < std::cos(angle);
  });
  EXPECT_GT(creases, 500);
  EXPECT_EQ(feature_edges(torus, angle).size(), static_cast<size_t>(creases));
}

TEST(FeatureEdges, ANoisyRoundScanHasNone) {
  TriangleMesh torus = make_bumpy_torus(40'000, 0.1f);
  const auto smooth = feature_edges(torus, kCrease).size();
  std::mt19937 random(7);
  std::normal_distribution<float> off(0, 0.0003f);
  for (Eigen::Vector3f& v : torus.vertices)
    v += Eigen::Vector3f(off(random), off(random), off(random));
  EXPECT_LT(feature_edges(torus, kCrease).size(), smooth + torus.faces.size() / 200);
}

}  // namespace
}  // namespace sightline
