// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <string_view>

#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/mesh_edges.hpp"

/// The first byte chooses the format, so that one corpus serves all readers.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static constexpr const char* kFormats[] = {"3vn", "obj", "off", "ply", "stl", "gltf", "glb"};
  if (size == 0) return 0;
  const char* format = kFormats[data[0] % std::size(kFormats)];
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  sightline::MeshOptions options;
  options.max_faces = 10'000;
  const auto mesh = sightline::parse_mesh(text, format, "fuzz", options);
  if (!mesh) return 0;
  for (const auto& face : mesh->faces) {
    for (uint32_t v : face) {
      if (v >= mesh->vertices.size() || !mesh->vertices[v].allFinite()) std::abort();
    }
  }
  for (const auto& face : mesh->face_normals) {
    for (uint32_t n : face) {
      if (n >= mesh->normals.size() || !mesh->normals[n].allFinite()) std::abort();
    }
  }
  for (const sightline::MeshEdge& edge : sightline::feature_edges(*mesh, 0.5)) {
    if (std::max(edge.start, edge.end) >= mesh->vertices.size()) std::abort();
    if (std::max(edge.first_face, edge.second_face) >= mesh->faces.size()) std::abort();
  }
  return 0;
}
