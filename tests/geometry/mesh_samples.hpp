// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <utility>
#include <vector>

#include "sightline/geometry/mesh.hpp"

namespace sightline::test {

/// Twice the area of face `f` as a vector along its normal.
inline Eigen::Vector3d area_vector(const TriangleMesh& mesh, size_t f) {
  const auto corner = [&](size_t i) -> Eigen::Vector3d {
    return mesh.vertices[mesh.faces[f][i]].cast<double>();
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0));
}

inline double area(const TriangleMesh& mesh) {
  double sum = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) sum += area_vector(mesh, f).norm() / 2;
  return sum;
}

/// Positive for a closed mesh whose faces turn outward.
inline double volume(const TriangleMesh& mesh) {
  double sum = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    sum += area_vector(mesh, f).dot(mesh.vertices[mesh.faces[f][0]].cast<double>()) / 6;
  }
  return sum;
}

/// The tetrahedron (0,0,0) (1,0,0) (0,1,0) (0,0,1) in every text format: format and content.
inline std::vector<std::pair<std::string, std::string>> tetrahedra() {
  return {
      {"obj",
       "# tetrahedron\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
       "f 1 3 2\nf 1 2 4\nf 2 3 4\nf -4 -1 -2\n"},
      {"off",
       "OFF\n# tetrahedron\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 "
       "2\n"},
      {"ply",
       "ply\nformat ascii 1.0\ncomment tetrahedron\nelement vertex 4\nproperty float x\n"
       "property float y\nproperty float z\nelement face 4\n"
       "property list uchar int vertex_indices\nend_header\n"
       "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"},
      {"stl",
       "solid t\n"
       "facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 "
       "0\nendloop\nendfacet\n"
       "facet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 "
       "1\nendloop\nendfacet\n"
       "facet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 "
       "1\nendloop\nendfacet\n"
       "facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 "
       "0\nendloop\nendfacet\n"
       "endsolid t\n"},
      {"gltf",
       R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3",
"min":[0,0,0],"max":[1,1,1]},
{"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":48},
{"buffer":0,"byteOffset":48,"byteLength":24}],
"buffers":[{"byteLength":72,"uri":"data:application/octet-stream;base64,)"
       "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/"
       "AAACAAEAAAABAAMAAQACAAMAAAADAAIA"
       "\"}]}"},
  };
}

}  // namespace sightline::test
