// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/mesh/level_of_detail.hpp"

#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <tuple>

#include "render/mesh/surface_distance.hpp"
#include "sightline/base/check.hpp"
#include "sightline/geometry/mesh.hpp"

namespace sightline {
namespace {

/// So many vertices of the full mesh are measured against a coarser level: every n-th.
constexpr size_t kMeasured = 20'000;
/// A level that is not this much smaller than the one before is not worth its memory.
constexpr double kWorthwhile = 0.8;

using Position = std::array<float, 3>;
Position position(const RenderMesh& mesh, uint32_t v) { return {mesh.x[v], mesh.y[v], mesh.z[v]}; }

/// Brightness of each vertex: the mean of its faces. Coarser faces take theirs from it.
std::vector<float> vertex_luminance(const RenderMesh& mesh) {
  std::vector<float> sum(mesh.vertex_count(), 0), count(mesh.vertex_count(), 0);
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const uint32_t v : mesh.faces[f]) {
      sum[v] += mesh.luminance[f];
      count[v] += 1;
    }
  }
  for (size_t v = 0; v < sum.size(); ++v) sum[v] /= std::max(count[v], 1.0f);
  return sum;
}

/// A crease of the coarser mesh is one of the full mesh's: flatter faces bend more at each edge.
void keep_true_creases(const RenderMesh& full, RenderMesh& coarse) {
  std::set<Position> on_creases;
  for (const FeatureEdge& edge : full.feature_edges) {
    on_creases.insert(position(full, edge.start));
    on_creases.insert(position(full, edge.end));
  }
  std::erase_if(coarse.feature_edges, [&](const FeatureEdge& edge) {
    return !on_creases.contains(position(coarse, edge.start)) ||
           !on_creases.contains(position(coarse, edge.end));
  });
}

/// Whether each edge is passed as often one way as the other. A closed mesh may grow fins when
/// edges collapse: they have two sides, and back faces may still be left out.
bool balanced(const RenderMesh& mesh) {
  std::vector<std::array<uint32_t, 3>> edges;  // low, high, direction
  edges.reserve(3 * mesh.faces.size());
  for (const auto& f : mesh.faces) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = f[k], b = f[(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1u : 0u});
    }
  }
  std::ranges::sort(edges);
  for (size_t i = 0; i < edges.size();) {
    size_t end = i;
    size_t forward = 0;
    for (; end < edges.size() && edges[end][0] == edges[i][0] && edges[end][1] == edges[i][1];
         ++end)
      forward += edges[end][2];
    if (2 * forward != end - i) return false;
    i = end;
  }
  return true;
}

/// Vertices of a mesh split where its texture is cut, for collapsing edges must keep such cuts.
struct SplitVertices {
  std::vector<uint32_t> vertex;                 ///< of the mesh, for each split one
  std::vector<unsigned> corners;                ///< into the split ones, three a face
  std::vector<std::array<uint32_t, 2>> corner;  ///< of each split one: a face and its corner
};

SplitVertices split_vertices(const RenderMesh& mesh) {
  using Key = std::tuple<uint32_t, int32_t, float, float>;
  struct Corner {
    Key key;
    uint32_t face, slot;
  };
  std::vector<Corner> all;
  all.reserve(3 * mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (uint32_t k = 0; k < 3; ++k) {
      Key key{mesh.faces[f][k], -1, 0.0f, 0.0f};
      if (!mesh.paint.empty() && mesh.paint[f].texture >= 0) {
        const Eigen::Vector2f& place = mesh.paint[f].places[k];
        key = {mesh.faces[f][k], mesh.paint[f].texture, place.x(), place.y()};
      }
      all.push_back({key, f, k});
    }
  }
  std::ranges::sort(all, {}, [](const Corner& c) { return std::tuple(c.key, c.face, c.slot); });
  SplitVertices split;
  split.corners.resize(all.size());
  for (size_t i = 0; i < all.size(); ++i) {
    if (i == 0 || all[i].key != all[i - 1].key) {
      split.vertex.push_back(std::get<0>(all[i].key));
      split.corner.push_back({all[i].face, all[i].slot});
    }
    split.corners[3 * all[i].face + all[i].slot] = static_cast<unsigned>(split.vertex.size() - 1);
  }
  return split;
}

/// The different normals that the corners at each vertex have.
std::vector<std::vector<uint32_t>> normals_at_vertices(const RenderMesh& mesh) {
  std::vector<std::vector<uint32_t>> out(mesh.vertex_count());
  for (size_t f = 0; f < mesh.face_corner_normals.size(); ++f) {
    for (size_t k = 0; k < 3; ++k) {
      auto& here = out[mesh.faces[f][k]];
      const uint32_t normal = mesh.face_corner_normals[f][k];
      if (std::ranges::find(here, normal) == here.end()) here.push_back(normal);
    }
  }
  return out;
}

/// The one of them that looks most as the face does.
uint32_t closest_normal(const RenderMesh& mesh, const std::vector<uint32_t>& candidates,
                        const Eigen::Vector3f& face_normal) {
  return *std::ranges::max_element(
      candidates, {}, [&](uint32_t n) { return mesh.corner_normals[n].dot(face_normal); });
}

/// Paint of coarser faces, from the corners of the finer mesh that theirs are. `made` has lost the
/// faces of `kept` that have no area; the order is the same.
void carry_paint(const RenderMesh& mesh, const SplitVertices& split,
                 const std::vector<unsigned>& kept, RenderMesh& made) {
  made.textures = mesh.textures;
  made.paint.reserve(made.faces.size());
  size_t at = 0;
  for (const auto& face : made.faces) {
    const auto is_here = [&] {
      for (size_t k = 0; k < 3; ++k) {
        if (position(made, face[k]) != position(mesh, split.vertex[kept[at + k]])) return false;
      }
      return true;
    };
    while (at < kept.size() && !is_here()) at += 3;
    SL_CHECK(at < kept.size(), "each coarser face is one that was kept");
    FacePaint paint;
    paint.texture = mesh.paint[split.corner[kept[at]][0]].texture;
    for (size_t k = 0; k < 3; ++k) {
      const auto [from, slot] = split.corner[kept[at + k]];
      paint.places[k] = mesh.paint[from].places[slot];
      paint.colors[k] = mesh.paint[from].colors[slot];
      if (mesh.paint[from].texture != paint.texture) paint.texture = -1;
    }
    made.paint.push_back(paint);
    at += 3;
  }
}

/// The mesh with about half its faces; nothing if it cannot be had.
std::optional<RenderMesh> halve(const RenderMesh& mesh, const RenderMesh& full) {
  const SplitVertices split = split_vertices(mesh);
  std::vector<float> points;
  points.reserve(3 * split.vertex.size());
  for (const uint32_t v : split.vertex)
    points.insert(points.end(), {mesh.x[v], mesh.y[v], mesh.z[v]});
  const std::vector<unsigned>& corners = split.corners;
  std::vector<unsigned> kept(corners.size());
  kept.resize(meshopt_simplify(kept.data(), corners.data(), corners.size(), points.data(),
                               split.vertex.size(), 3 * sizeof(float), corners.size() / 2 / 3 * 3,
                               0.05f, 0, nullptr));
  if (kept.empty() ||
      static_cast<double>(kept.size()) > kWorthwhile * static_cast<double>(corners.size()))
    return std::nullopt;
  TriangleMesh coarse;
  const std::vector<float> luminance = vertex_luminance(mesh);
  const auto normals = normals_at_vertices(mesh);
  coarse.normals = mesh.corner_normals;
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v)
    coarse.vertices.emplace_back(mesh.x[v], mesh.y[v], mesh.z[v]);
  for (size_t i = 0; i < kept.size(); i += 3) {
    const std::array<uint32_t, 3> f = {split.vertex[kept[i]], split.vertex[kept[i + 1]],
                                       split.vertex[kept[i + 2]]};
    coarse.faces.push_back(f);
    const float gray = (luminance[f[0]] + luminance[f[1]] + luminance[f[2]]) / 3;
    coarse.face_colors.emplace_back(Eigen::Vector3f::Constant(gray));
    if (mesh.face_corner_normals.empty()) continue;
    const Eigen::Vector3f& p = coarse.vertices[f[0]];
    const Eigen::Vector3f across = (coarse.vertices[f[1]] - p).cross(coarse.vertices[f[2]] - p);
    std::array<uint32_t, 3> corner_normals{};
    for (size_t k = 0; k < 3; ++k) corner_normals[k] = closest_normal(mesh, normals[f[k]], across);
    coarse.face_normals.push_back(corner_normals);
  }
  auto finished = finish_mesh(std::move(coarse), "simplified mesh");
  if (!finished) return std::nullopt;
  RenderMeshOptions options;
  options.crease_angle = mesh.crease_angle;
  RenderMesh made = make_render_mesh(*finished, options);
  made.cull_back_faces = mesh.cull_back_faces && balanced(made);
  keep_true_creases(full, made);
  if (!mesh.paint.empty()) carry_paint(mesh, split, kept, made);
  return made;
}

double error_of(const RenderMesh& coarse, const RenderMesh& full) {
  const SurfaceDistance distance(coarse);
  const size_t step = std::max<size_t>(full.vertex_count() / kMeasured, 1);
  double worst = 0;
  for (size_t v = 0; v < full.vertex_count(); v += step)
    worst = std::max(worst, distance(full.vertex(static_cast<uint32_t>(v))));
  return worst;
}

}  // namespace

LevelOfDetail::LevelOfDetail(std::shared_ptr<const RenderMesh> mesh) {
  levels_.push_back({std::move(mesh), 0});
  const RenderMesh& full = *levels_.front().mesh;
  while (levels_.back().mesh->faces.size() >= kSmallest) {
    auto coarse = halve(*levels_.back().mesh, full);
    if (!coarse) break;
    const double error = std::max(error_of(*coarse, full), levels_.back().error);
    if (error > 0.02 * double{full.radius}) break;
    levels_.push_back({std::make_shared<const RenderMesh>(*std::move(coarse)), error});
  }
}

const RenderMesh& LevelOfDetail::choose(const CameraModel& camera, const Rigid3& camera_from_object,
                                        double error_px) const {
  const RenderMesh& full = *levels_.front().mesh;
  const Eigen::Vector3d center = camera_from_object * full.center.cast<double>();
  const double nearest = center.z() - double{full.radius};
  if (!(nearest > 0) || error_px <= 0) return full;
  // A shift across the line of sight moves the pixel by focal / z, one along it by as much times
  // the ray's slope. The lens adds at most its curvature to that, which is little over one object.
  const CameraModel::Parameters& lens = camera.parameters();
  const double slope = (center.head<2>().norm() + double{full.radius}) / nearest;
  const double px_per_meter =
      1.1 * std::max(lens.fx, lens.fy) * std::sqrt(1 + slope * slope) / nearest;
  size_t level = levels_.size() - 1;
  while (level > 0 && levels_[level].error * px_per_meter > error_px) --level;
  return *levels_[level].mesh;
}

}  // namespace sightline
