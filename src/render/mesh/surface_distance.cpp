// SPDX-License-Identifier: Apache-2.0
#include "render/mesh/surface_distance.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

constexpr int kMaxCells = 48;  ///< along the longest side

}  // namespace

double distance_to_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                            const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return ap.norm();
  const Eigen::Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return bp.norm();
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return (ap - ab * (d1 / (d1 - d3))).norm();
  const Eigen::Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return cp.norm();
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return (ap - ac * (d2 / (d2 - d6))).norm();
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6)
    return (bp - (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))).norm();
  const double sum = va + vb + vc;
  return (ap - ab * (vb / sum) - ac * (vc / sum)).norm();
}

SurfaceDistance::SurfaceDistance(const RenderMesh& mesh)
    : mesh_(mesh), low_(mesh.min_corner.cast<double>()) {
  const Eigen::Vector3d size = (mesh.max_corner - mesh.min_corner).cast<double>();
  cell_size_ = std::max(size.maxCoeff() / kMaxCells, 1e-12);
  for (size_t k = 0; k < 3; ++k)
    count_[k] = static_cast<int>(size[static_cast<Eigen::Index>(k)] / cell_size_) + 1;
  cells_.resize(static_cast<size_t>(count_[0]) * static_cast<size_t>(count_[1]) *
                static_cast<size_t>(count_[2]));
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const Eigen::Vector3d a = mesh.vertex(mesh.faces[f][0]);
    const Eigen::Vector3d b = mesh.vertex(mesh.faces[f][1]);
    const Eigen::Vector3d c = mesh.vertex(mesh.faces[f][2]);
    const Cell from = cell_of(a.cwiseMin(b).cwiseMin(c));
    const Cell to = cell_of(a.cwiseMax(b).cwiseMax(c));
    for (int z = from[2]; z <= to[2]; ++z) {
      for (int y = from[1]; y <= to[1]; ++y) {
        for (int x = from[0]; x <= to[0]; ++x) cells_[index_of({x, y, z})].push_back(f);
      }
    }
  }
}

SurfaceDistance::Cell SurfaceDistance::cell_of(const Eigen::Vector3d& point) const {
  Cell cell{};
  for (size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    cell[k] =
        std::clamp(static_cast<int>((point[axis] - low_[axis]) / cell_size_), 0, count_[k] - 1);
  }
  return cell;
}

size_t SurfaceDistance::index_of(const Cell& cell) const {
  const auto at = [&](size_t k) { return static_cast<size_t>(cell[k]); };
  return (at(2) * static_cast<size_t>(count_[1]) + at(1)) * static_cast<size_t>(count_[0]) + at(0);
}

double SurfaceDistance::nearest_in(const Cell& cell, const Eigen::Vector3d& point) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const uint32_t f : cells_[index_of(cell)]) {
    const auto& face = mesh_.faces[f];
    nearest = std::min(nearest, distance_to_triangle(point, mesh_.vertex(face[0]),
                                                     mesh_.vertex(face[1]), mesh_.vertex(face[2])));
  }
  return nearest;
}

/// Shells of cells around the point's, until no further one can hold anything nearer.
double SurfaceDistance::operator()(const Eigen::Vector3d& point) const {
  const Cell middle = cell_of(point);
  double nearest = std::numeric_limits<double>::infinity();
  const int max = *std::ranges::max_element(count_);
  for (int shell = 0; shell <= max && nearest > (shell - 1) * cell_size_; ++shell) {
    const auto low = [&](size_t k) { return std::max(middle[k] - shell, 0); };
    const auto high = [&](size_t k) { return std::min(middle[k] + shell, count_[k] - 1); };
    for (int z = low(2); z <= high(2); ++z) {
      for (int y = low(1); y <= high(1); ++y) {
        const bool rim = std::abs(z - middle[2]) == shell || std::abs(y - middle[1]) == shell;
        for (int x = low(0); x <= high(0); ++x) {
          if (rim || std::abs(x - middle[0]) == shell)
            nearest = std::min(nearest, nearest_in({x, y, z}, point));
        }
      }
    }
  }
  return nearest;
}

}  // namespace sightline
