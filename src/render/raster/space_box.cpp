// SPDX-License-Identifier: Apache-2.0
#include "render/raster/space_box.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "sightline/render/raster/backend.hpp"

namespace sightline {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

/// A growing interval in the plane, of rays or of pixels.
struct Extent {
  Eigen::Vector2d low{kInf, kInf}, high{-kInf, -kInf};
  void add(const Eigen::Vector2d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  bool empty() const { return !(low.x() <= high.x()); }
};

using Corners = std::array<Eigen::Vector3d, 8>;

Corners corners_in_camera(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                          const Rigid3& camera_from_object) {
  Corners corners;
  const Eigen::Matrix3d rotation = camera_from_object.rotation_matrix();
  for (size_t i = 0; i < 8; ++i) {
    const Eigen::Vector3d p((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                            (i & 4) != 0 ? high.z() : low.z());
    corners[i] = rotation * p + camera_from_object.translation;
  }
  return corners;
}

/// Calls `visit(i, j)` for the twelve edges.
template <typename Visit>
void for_each_edge(Visit visit) {
  for (size_t i = 0; i < 8; ++i) {
    for (const size_t bit : {size_t{1}, size_t{2}, size_t{4}}) {
      if ((i & bit) == 0) visit(i, i | bit);
    }
  }
}

/// Rays of the part of the box in front of the near plane: its corners, and where edges cross the
/// plane.
Extent ray_extent(const Corners& corners) {
  Extent extent;
  const auto add = [&](const Eigen::Vector3d& p) { extent.add(p.head<2>() / p.z()); };
  for (const Eigen::Vector3d& p : corners) {
    if (p.z() >= kNearPlane) add(p);
  }
  for_each_edge([&](size_t i, size_t j) {
    const Eigen::Vector3d& p = corners[i];
    const Eigen::Vector3d& q = corners[j];
    if ((p.z() >= kNearPlane) == (q.z() >= kNearPlane)) return;
    const double t = (kNearPlane - p.z()) / (q.z() - p.z());
    Eigen::Vector3d cut = p + t * (q - p);
    cut.z() = kNearPlane;
    add(cut);
  });
  return extent;
}

/// Pixels of a box that lies wholly inside the lens: its outline is made of box edges, and each
/// piece of an edge bends by a bounded amount. Empty optional if a corner lies outside.
std::optional<Extent> pixel_extent(const RayTable& rays, const Corners& corners) {
  constexpr int kPieces = 8;
  double largest = 0;
  for (const Eigen::Vector3d& p : corners) {
    if (p.z() < kNearPlane) return std::nullopt;
    largest = std::max(largest, p.head<2>().norm() / p.z());
  }
  if (!(largest <= rays.project_limit())) return std::nullopt;
  Extent extent;
  double longest = 0;
  bool complete = true;
  for_each_edge([&](size_t i, size_t j) {
    const Eigen::Vector2d a = corners[i].head<2>() / corners[i].z();
    const Eigen::Vector2d b = corners[j].head<2>() / corners[j].z();
    longest = std::max(longest, (b - a).norm());
    for (int k = 0; k <= kPieces; ++k) {
      const auto pixel = rays.project(a + (b - a) * k / kPieces);
      if (pixel) extent.add(*pixel);
      complete = complete && pixel.has_value();
    }
  });
  if (!complete) return std::nullopt;
  const double piece = longest / kPieces;
  const double bend = rays.curvature_bound(0, largest) * piece * piece / 8 + 0.01;
  extent.low.array() -= bend;
  extent.high.array() += bend;
  return extent;
}

/// Pixels of all blocks of the frame whose rays meet the extent.
Extent block_extent(const RayTable& rays, const Extent& requested) {
  constexpr int kBlock = RayTable::kBlock;
  Extent extent;
  for (int row = 0; row < rays.block_rows(); ++row) {
    for (int column = 0; column < rays.block_columns(); ++column) {
      const RayTable::RayBounds& b = rays.block(column, row);
      if (b.empty() || double{b.min_x} > requested.high.x() ||
          double{b.max_x} < requested.low.x() || double{b.min_y} > requested.high.y() ||
          double{b.max_y} < requested.low.y())
        continue;
      extent.add(Eigen::Vector2d(column * kBlock, row * kBlock));
      extent.add(Eigen::Vector2d(column * kBlock + kBlock - 1, row * kBlock + kBlock - 1));
    }
  }
  return extent;
}

}  // namespace

TileRect project_box(const RayTable& rays, const Eigen::Vector3d& min_corner,
                     const Eigen::Vector3d& max_corner, const Rigid3& camera_from_object,
                     int margin_px) {
  const Corners corners = corners_in_camera(min_corner, max_corner, camera_from_object);
  const Extent seen = ray_extent(corners);
  if (seen.empty() || rays.frame_bounds().empty()) return {};
  const auto exact = pixel_extent(rays, corners);
  const Extent pixels = exact ? *exact : block_extent(rays, seen);
  if (pixels.empty()) return {};
  const double margin = margin_px;
  const auto span = [margin](double low, double high, int size, int& at, int& length) {
    const double first = std::max(0.0, std::ceil(low - margin));
    const double last = std::min(size - 1.0, std::floor(high + margin));
    if (!(first <= last)) return false;
    at = static_cast<int>(first) & ~1;
    length = (static_cast<int>(last) + 2 - at) & ~1;
    return true;
  };
  TileRect rect;
  if (!span(pixels.low.x(), pixels.high.x(), rays.even_width(), rect.x, rect.width) ||
      !span(pixels.low.y(), pixels.high.y(), rays.even_height(), rect.y, rect.height))
    return {};
  return rect;
}

}  // namespace sightline
