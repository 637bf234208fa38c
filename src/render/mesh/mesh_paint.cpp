// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/mesh/mesh_paint.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "sightline/geometry/mesh_distance.hpp"

namespace sightline {
namespace {

using Texel = SurfaceTexture::Texel;
using Level = SurfaceTexture::Level;

/// A texture that repeats more often than this has lost its precision.
constexpr float kFarthestPlace = 4096;

Texel texel(int y, int u, int v) {
  return static_cast<Texel>(y) | static_cast<Texel>(u) << 8 | static_cast<Texel>(v) << 16;
}

Level full_size(const I420View& image) {
  Level level{image.width(), image.height(), {}};
  level.texels.reserve(static_cast<size_t>(level.width) * static_cast<size_t>(level.height));
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) {
      level.texels.push_back(
          texel(image.y.row(y)[x], image.u.row(y / 2)[x / 2], image.v.row(y / 2)[x / 2]));
    }
  }
  return level;
}

/// What a texel of the smaller level covers of one axis of the larger: up to three texels, with the
/// shares that make an odd number fit exactly.
struct Cover {
  int first = 0;
  int count = 0;
  std::array<float, 3> share{};
};

std::vector<Cover> covers(int large, int small) {
  std::vector<Cover> out(static_cast<size_t>(small));
  const double scale = static_cast<double>(large) / small;
  for (int i = 0; i < small; ++i) {
    Cover& cover = out[static_cast<size_t>(i)];
    const double from = i * scale, to = (i + 1) * scale;
    cover.first = static_cast<int>(from);
    for (int k = cover.first; k < large && k < to - 1e-9 && cover.count < 3; ++k) {
      const double part = std::min(to, k + 1.0) - std::max(from, static_cast<double>(k));
      cover.share[static_cast<size_t>(cover.count++)] = static_cast<float>(part / scale);
    }
  }
  return out;
}

Level halved(const Level& large) {
  Level small{(large.width + 1) / 2, (large.height + 1) / 2, {}};
  const std::vector<Cover> columns = covers(large.width, small.width);
  const std::vector<Cover> rows = covers(large.height, small.height);
  small.texels.reserve(columns.size() * rows.size());
  for (const Cover& row : rows) {
    for (const Cover& column : columns) {
      Eigen::Array3f sum = Eigen::Array3f::Constant(0.5f);
      for (int j = 0; j < row.count; ++j) {
        const Texel* from = large.texels.data() +
                            static_cast<size_t>(row.first + j) * static_cast<size_t>(large.width);
        for (int i = 0; i < column.count; ++i) {
          const Texel t = from[column.first + i];
          const float share =
              row.share[static_cast<size_t>(j)] * column.share[static_cast<size_t>(i)];
          sum += share * Eigen::Array3f(static_cast<float>(t & 255u),
                                        static_cast<float>(t >> 8 & 255u),
                                        static_cast<float>(t >> 16 & 255u));
        }
      }
      small.texels.push_back(
          texel(static_cast<int>(sum.x()), static_cast<int>(sum.y()), static_cast<int>(sum.z())));
    }
  }
  return small;
}

/// The surface's triangles as a mesh, to look for the nearest.
TriangleMesh triangles_of(const MeshSurface& surface) {
  TriangleMesh mesh;
  for (const SurfaceTriangle& triangle : surface.triangles) {
    const auto first = static_cast<uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), triangle.corners.begin(), triangle.corners.end());
    mesh.faces.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Which triangle of a surface a face is: the one with the same corners, else the one that is
/// nearest to its middle. What lies on another surface, as a label does, is as near to that one's
/// faces as their own triangles are.
class TriangleFinder {
 public:
  explicit TriangleFinder(const MeshSurface& surface) : nearest_(triangles_of(surface)) {
    for (size_t i = 0; i < surface.triangles.size(); ++i) {
      by_corners_.try_emplace(key(surface.triangles[i].corners), i);
    }
  }
  size_t find(const std::array<Eigen::Vector3f, 3>& corners) const {
    const auto same = by_corners_.find(key(corners));
    if (same != by_corners_.end()) return same->second;
    const Eigen::Vector3f middle = (corners[0] + corners[1] + corners[2]) / 3;
    return nearest_.nearest(middle.cast<double>()).face;
  }

 private:
  using Key = std::array<std::array<float, 3>, 3>;
  /// In an order of their own, so that it does not matter which corner is the first.
  static Key key(const std::array<Eigen::Vector3f, 3>& corners) {
    Key out;
    for (size_t i = 0; i < 3; ++i) {  // -0 is 0
      out[i] = {corners[i].x() + 0.0f, corners[i].y() + 0.0f, corners[i].z() + 0.0f};
    }
    std::sort(out.begin(), out.end());
    return out;
  }

  MeshDistance nearest_;
  std::map<Key, size_t> by_corners_;
};

/// Weights of a triangle's corners that make up a point of its plane; they may lie outside 0..1.
Eigen::Vector3d weights_at(const SurfaceTriangle& triangle, const Eigen::Vector3d& point) {
  const Eigen::Vector3d a = triangle.corners[0].cast<double>();
  const Eigen::Vector3d ab = triangle.corners[1].cast<double>() - a;
  const Eigen::Vector3d ac = triangle.corners[2].cast<double>() - a;
  const Eigen::Vector3d ap = point - a;
  const Eigen::Vector3d normal = ab.cross(ac);
  const double area2 = normal.squaredNorm();
  if (!(area2 > 0)) return {1, 0, 0};
  const double b = ap.cross(ac).dot(normal) / area2;
  const double c = ab.cross(ap).dot(normal) / area2;
  return {1 - b - c, b, c};
}

Yuv color_at(const SurfaceTriangle& triangle, const Eigen::Vector3d& weights) {
  Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    rgb += weights[i] * triangle.corner_colors[static_cast<size_t>(i)].cast<double>();
  const auto byte = [](double share) {
    return static_cast<uint8_t>(std::lround(255 * std::clamp(share, 0.0, 1.0)));
  };
  return to_yuv({byte(rgb.x()), byte(rgb.y()), byte(rgb.z())});
}

Eigen::Vector2f place_at(const SurfaceTriangle& triangle, const Eigen::Vector3d& weights) {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  for (int i = 0; i < 3; ++i)
    place += weights[i] * triangle.places[static_cast<size_t>(i)].cast<double>();
  return {static_cast<float>(place.x()), static_cast<float>(1 - place.y())};
}

}  // namespace

SurfaceTexture::SurfaceTexture(const I420View& image) {
  Level level = full_size(image);
  while (std::max(level.width, level.height) > kMaxPixels) level = halved(level);
  levels_.push_back(std::move(level));
  while (std::max(levels_.back().width, levels_.back().height) > 1)
    levels_.push_back(halved(levels_.back()));
}

void paint_mesh(const MeshSurface& surface,
                std::vector<std::shared_ptr<const SurfaceTexture>> textures, RenderMesh& mesh) {
  mesh.paint.clear();
  mesh.textures.clear();
  if (surface.triangles.empty()) return;
  const TriangleFinder finder(surface);
  mesh.paint.resize(mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    std::array<Eigen::Vector3f, 3> corners;
    for (size_t i = 0; i < 3; ++i) corners[i] = mesh.vertex(mesh.faces[f][i]).cast<float>();
    const SurfaceTriangle& triangle = surface.triangles[finder.find(corners)];
    FacePaint& paint = mesh.paint[f];
    const auto texture = static_cast<size_t>(triangle.texture);
    if (triangle.texture >= 0 && texture < textures.size() && textures[texture] != nullptr)
      paint.texture = triangle.texture;
    for (size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d weights = weights_at(triangle, corners[i].cast<double>());
      paint.colors[i] = color_at(triangle, weights);
      paint.places[i].setZero();
      if (paint.texture >= 0) paint.places[i] = place_at(triangle, weights);
    }
    for (const Eigen::Vector2f& place : paint.places) {
      if (!place.allFinite() || place.cwiseAbs().maxCoeff() > kFarthestPlace) paint.texture = -1;
    }
  }
  mesh.textures = std::move(textures);
}

}  // namespace sightline
