// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <cmath>

#include "geometry/mesh_readers.hpp"

namespace sightline::geometry {
namespace {

/// Around a vertex of more faces than this every corner takes its own face's normal: comparing all
/// pairs would take the square of the number.
constexpr size_t kMaxFacesAround = 256;

struct Corner {
  uint32_t face;
  uint32_t slot;  ///< 0, 1, 2
};

/// Corners by vertex, as one list and where each vertex starts in it.
struct CornersByVertex {
  std::vector<size_t> starts;
  std::vector<Corner> corners;
};

CornersByVertex corners_by_vertex(const TriangleMesh& mesh) {
  CornersByVertex out;
  out.starts.assign(mesh.vertices.size() + 1, 0);
  for (const auto& face : mesh.faces) {
    for (uint32_t v : face) ++out.starts[v + 1];
  }
  for (size_t v = 0; v < mesh.vertices.size(); ++v) out.starts[v + 1] += out.starts[v];
  std::vector<size_t> next(out.starts.begin(), out.starts.end() - 1);
  out.corners.resize(3 * mesh.faces.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (uint32_t s = 0; s < 3; ++s) out.corners[next[mesh.faces[f][s]]++] = {f, s};
  }
  return out;
}

double corner_angle(const TriangleMesh& mesh, const Corner& c) {
  const auto& f = mesh.faces[c.face];
  const Eigen::Vector3d p = mesh.vertices[f[c.slot]].cast<double>();
  const Eigen::Vector3d a = mesh.vertices[f[(c.slot + 1) % 3]].cast<double>() - p;
  const Eigen::Vector3d b = mesh.vertices[f[(c.slot + 2) % 3]].cast<double>() - p;
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

void make_normals(TriangleMesh* mesh, float crease_angle) {
  const double limit = std::cos(static_cast<double>(crease_angle));
  std::vector<Eigen::Vector3d> of_face;
  of_face.reserve(mesh->faces.size());
  for (const auto& f : mesh->faces) {
    const Eigen::Vector3d a = mesh->vertices[f[0]].cast<double>();
    of_face.push_back((mesh->vertices[f[1]].cast<double>() - a)
                          .cross(mesh->vertices[f[2]].cast<double>() - a)
                          .normalized());
  }
  mesh->normals.clear();
  mesh->face_normals.assign(mesh->faces.size(), {});
  const CornersByVertex around = corners_by_vertex(*mesh);
  std::vector<double> weights;
  for (size_t v = 0; v < mesh->vertices.size(); ++v) {
    const Corner* begin = around.corners.data() + around.starts[v];
    const size_t count = around.starts[v + 1] - around.starts[v];
    const bool crowded = count > kMaxFacesAround;
    weights.clear();
    for (size_t i = 0; i < count && !crowded; ++i) {
      weights.push_back(corner_angle(*mesh, begin[i]));
    }
    const size_t first_here = mesh->normals.size();
    for (size_t i = 0; i < count; ++i) {
      const Eigen::Vector3d& own = of_face[begin[i].face];
      Eigen::Vector3d sum = crowded ? own : Eigen::Vector3d::Zero();
      for (size_t k = 0; k < count && !crowded; ++k) {
        const Eigen::Vector3d& other = of_face[begin[k].face];
        if (k == i || own.dot(other) >= limit) sum += weights[k] * other;
      }
      // Corners of one smooth patch add the same faces in the same order: the sums are identical.
      const Eigen::Vector3f normal =
          (sum.norm() > 1e-9 ? sum.normalized() : own).eval().cast<float>();
      size_t index = crowded ? mesh->normals.size() : first_here;
      while (index < mesh->normals.size() && mesh->normals[index] != normal) ++index;
      if (index == mesh->normals.size()) mesh->normals.push_back(normal);
      mesh->face_normals[begin[i].face][begin[i].slot] = static_cast<uint32_t>(index);
    }
  }
}

}  // namespace sightline::geometry
