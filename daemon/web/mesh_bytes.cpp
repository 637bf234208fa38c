// SPDX-License-Identifier: Apache-2.0
#include "web/mesh_bytes.hpp"

#include <bit>
#include <cmath>
#include <cstring>

namespace sightline {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

class Writer {
 public:
  template <typename Number>
  void add(Number value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    out_.append(bytes, sizeof value);
  }
  void add(const Eigen::Vector3f& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  void align() { out_.resize((out_.size() + 3) / 4 * 4, '\0'); }
  std::string take() { return std::move(out_); }

 private:
  std::string out_{"SLM1"};
};

}  // namespace

const RenderMesh& shown_level(const LevelOfDetail& levels) {
  for (const auto& level : levels.levels()) {
    if (level.mesh->faces.size() <= kShownFaces) return *level.mesh;
  }
  return *levels.levels().back().mesh;
}

std::string mesh_bytes(std::span<const RenderMesh* const> meshes) {
  size_t vertices = 0, faces = 0;
  Eigen::Vector3f low = Eigen::Vector3f::Zero(), high = Eigen::Vector3f::Zero();
  for (const RenderMesh* mesh : meshes) {
    low = vertices == 0 ? mesh->min_corner : low.cwiseMin(mesh->min_corner).eval();
    high = vertices == 0 ? mesh->max_corner : high.cwiseMax(mesh->max_corner).eval();
    vertices += mesh->vertex_count();
    faces += mesh->faces.size();
  }
  Writer out;
  out.add(static_cast<uint32_t>(vertices));
  out.add(static_cast<uint32_t>(faces));
  out.add(low);
  out.add(high);
  const auto share = [](float value, float from, float to) {
    return static_cast<uint16_t>(to > from ? std::lround((value - from) / (to - from) * 65535) : 0);
  };
  for (const RenderMesh* mesh : meshes) {
    for (size_t i = 0; i < mesh->vertex_count(); ++i) {
      out.add(share(mesh->x[i], low.x(), high.x()));
      out.add(share(mesh->y[i], low.y(), high.y()));
      out.add(share(mesh->z[i], low.z(), high.z()));
    }
  }
  out.align();
  uint32_t first = 0;
  for (const RenderMesh* mesh : meshes) {
    for (const auto& face : mesh->faces) {
      for (const uint32_t v : face) {
        if (vertices <= 65536) {
          out.add(static_cast<uint16_t>(first + v));
        } else {
          out.add(first + v);
        }
      }
    }
    first += static_cast<uint32_t>(mesh->vertex_count());
  }
  return out.take();
}

}  // namespace sightline
