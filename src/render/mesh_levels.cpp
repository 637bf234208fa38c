// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/mesh_levels.hpp"

#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "sightline/geometry/mesh.hpp"
#include "surface_distance.hpp"

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

/// The mesh with about half its faces; nothing if it cannot be had.
std::optional<RenderMesh> halve(const RenderMesh& mesh, const RenderMesh& full) {
  std::vector<float> points(3 * mesh.vertex_count());
  for (size_t v = 0; v < mesh.vertex_count(); ++v) {
    points[3 * v] = mesh.x[v];
    points[3 * v + 1] = mesh.y[v];
    points[3 * v + 2] = mesh.z[v];
  }
  std::vector<unsigned> corners(3 * mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f)
    std::ranges::copy(mesh.faces[f], corners.begin() + static_cast<ptrdiff_t>(3 * f));
  std::vector<unsigned> kept(corners.size());
  kept.resize(meshopt_simplify(kept.data(), corners.data(), corners.size(), points.data(),
                               mesh.vertex_count(), 3 * sizeof(float), corners.size() / 2 / 3 * 3,
                               0.05f, 0, nullptr));
  if (kept.empty() ||
      static_cast<double>(kept.size()) > kWorthwhile * static_cast<double>(corners.size()))
    return std::nullopt;
  TriangleMesh coarse;
  const std::vector<float> luminance = vertex_luminance(mesh);
  for (uint32_t v = 0; v < mesh.vertex_count(); ++v)
    coarse.vertices.emplace_back(mesh.x[v], mesh.y[v], mesh.z[v]);
  for (size_t i = 0; i < kept.size(); i += 3) {
    coarse.faces.push_back({kept[i], kept[i + 1], kept[i + 2]});
    const float grey = (luminance[kept[i]] + luminance[kept[i + 1]] + luminance[kept[i + 2]]) / 3;
    coarse.face_colors.emplace_back(Eigen::Vector3f::Constant(grey));
  }
  auto finished = finish_mesh(std::move(coarse), "simplified mesh");
  if (!finished) return std::nullopt;
  RenderMesh made = make_render_mesh(*finished);
  made.cull_back_faces = mesh.cull_back_faces && balanced(made);
  keep_true_creases(full, made);
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

MeshLevels::MeshLevels(std::shared_ptr<const RenderMesh> mesh) {
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

const RenderMesh& MeshLevels::choose(const RayTable& rays, const Rigid3& camera_from_object,
                                     double error_px) const {
  const RenderMesh& full = *levels_.front().mesh;
  const Eigen::Vector3d center = camera_from_object * full.center.cast<double>();
  const double nearest = center.z() - double{full.radius};
  if (!(nearest > 0) || error_px <= 0) return full;
  // A shift across the line of sight moves the pixel by focal / z, one along it by as much times
  // the ray's slope. The lens adds at most its curvature to that, which is little over one object.
  const CameraModel::Parameters& lens = rays.model().parameters();
  const double slope = (center.head<2>().norm() + double{full.radius}) / nearest;
  const double px_per_meter =
      1.1 * std::max(lens.fx, lens.fy) * std::sqrt(1 + slope * slope) / nearest;
  size_t level = levels_.size() - 1;
  while (level > 0 && levels_[level].error * px_per_meter > error_px) --level;
  return *levels_[level].mesh;
}

}  // namespace sightline
