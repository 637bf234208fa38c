// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/egl_meshes.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "render/gpu/egl_shaders.hpp"

namespace sightline::egl {
namespace {

/// Objects and their levels of detail; meshes of a reload that are not drawn any more go first.
constexpr size_t kMaxMeshes = 64;

int table_rows(size_t items) {
  return static_cast<int>(std::max<size_t>((items + kTableWidth - 1) / kTableWidth, 1));
}

/// Fills a table of four values an item.
template <typename Value, typename Item>
Texture upload(GLenum internal, GLenum format, GLenum type, size_t count, const Item& item) {
  const int rows = table_rows(count);
  std::vector<std::array<Value, 4>> data(static_cast<size_t>(rows) * kTableWidth);
  for (size_t i = 0; i < count; ++i) data[i] = item(i);
  Texture texture(internal, kTableWidth, rows);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, kTableWidth, rows, format, type, data.data());
  return texture;
}

MeshTextures upload(const RenderMesh& mesh) {
  using Floats = std::array<float, 4>;
  MeshTextures out;
  out.vertices = upload<float>(GL_RGBA32F, GL_RGBA, GL_FLOAT, mesh.vertex_count(), [&](size_t i) {
    return Floats{mesh.x[i], mesh.y[i], mesh.z[i], 0.0f};
  });
  out.faces = upload<uint32_t>(GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT, mesh.faces.size(),
                               [&](size_t i) {
                                 const auto& f = mesh.faces[i];
                                 return std::array<uint32_t, 4>{f[0], f[1], f[2], 0u};
                               });
  out.normals = upload<float>(GL_RGBA32F, GL_RGBA, GL_FLOAT, mesh.faces.size(), [&](size_t i) {
    return Floats{mesh.normal_x[i], mesh.normal_y[i], mesh.normal_z[i], mesh.luminance[i]};
  });
  return out;
}

}  // namespace

Result<std::shared_ptr<const MeshTextures>> MeshStore::get(const RenderMesh& mesh) {
  const std::lock_guard lock(mutex_);
  Entry& entry = entries_[mesh.serial];
  entry.used = ++clock_;
  if (entry.textures != nullptr) return entry.textures;
  GLint max = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max);
  if (table_rows(std::max(mesh.faces.size(), mesh.vertex_count())) > max) {
    entries_.erase(mesh.serial);
    return make_error(ErrorCode::kUnavailable, "egl", "a mesh of {} faces does not fit this GPU",
                      mesh.faces.size());
  }
  auto textures = std::make_shared<const MeshTextures>(upload(mesh));
  // The other contexts of the group may read it from now on.
  glFinish();
  entry.textures = textures;
  if (entries_.size() > kMaxMeshes) drop_oldest();
  return std::shared_ptr<const MeshTextures>(std::move(textures));
}

void MeshStore::drop_oldest() {
  entries_.erase(
      std::ranges::min_element(entries_, {}, [](const auto& entry) { return entry.second.used; }));
}

}  // namespace sightline::egl
