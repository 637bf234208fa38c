// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "sightline/geometry/mesh.hpp"

namespace sightline::hidden_surfaces {

/// The rays of an ideal pinhole camera through pixel centers, which have whole coordinates.
struct View {
  int width = 1280, height = 720;
  double focal_px = 1000;

  Eigen::Vector2d project(const Eigen::Vector3d& point) const;
  Eigen::Vector3d ray(double x, double y) const;  ///< with z = 1
};

/// The points p with normal . p = offset.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double offset = 0;

  double side(const Eigen::Vector3d& point) const { return normal.dot(point) - offset; }
  /// 1/z where a ray with z = 1 meets it: linear in the pixel, which all depth comparisons use.
  double inverse_depth(const Eigen::Vector3d& ray) const { return normal.dot(ray) / offset; }
};

/// A triangle in the camera's frame, counter-clockwise seen from outside.
struct Face {
  std::array<Eigen::Vector3d, 3> corner;
  int owner = 0;  ///< 0: object A, whose visibility is wanted; 1: what may hide it

  Plane plane() const;
  bool seen_from_front() const { return plane().offset < 0; }
};

/// Pixels of the image that the scene may cover.
struct Tile {
  int x = 0, y = 0, width = 0, height = 0;
};

/// Closed surfaces wholly in front of the camera.
struct Scene {
  std::string name;
  View view;
  std::vector<Face> faces;

  Tile tile() const;
};

/// For each pixel of a tile the face that is seen there, or -1.
struct Picture {
  explicit Picture(const Tile& where);

  int32_t& at(int x, int y) { return face[index(x, y)]; }
  int32_t at(int x, int y) const { return face[index(x, y)]; }

  Tile tile;
  std::vector<int32_t> face;

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y - tile.y) * static_cast<size_t>(tile.width) +
           static_cast<size_t>(x - tile.x);
  }
};

/// "barn", "torus", "10k", "100k", "pierced", each with something before it; `meshes` is the folder
/// that has barn.3vn.
Scene make_scene(const std::string& name, const std::string& meshes);
/// A torus of about so many faces, so many pixels wide, with a bar through its hole.
Scene make_torus_scene(const std::string& name, size_t faces, double width_px);
/// Two boxes, one through the other.
Scene make_pierced_scene();

/// The face that is nearest at a pixel, by trying all: double precision, no tree. -1: none.
int32_t nearest_face(const Scene& scene, int x, int y);

}  // namespace sightline::hidden_surfaces
