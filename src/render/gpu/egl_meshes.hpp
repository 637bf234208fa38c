// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>

#include "render/gpu/gl_objects.hpp"
#include "sightline/render/mesh/render_mesh.hpp"

namespace sightline::egl {

/// A mesh in textures kTableWidth wide.
struct MeshTextures {
  Texture vertices;  ///< RGBA32F: x, y, z, 0
  Texture faces;     ///< RGBA32UI: three vertices, 0
  Texture normals;   ///< RGBA32F: normal, luminance
};

/// The meshes of one share group, uploaded once for all cameras: a million faces take 50 MB, and
/// they never change. Any thread, with a context of the group current.
class MeshStore {
 public:
  /// Uploads at the first call for a mesh. kUnavailable if it does not fit the GPU. To be released
  /// while a context of the group is current.
  Result<std::shared_ptr<const MeshTextures>> get(const RenderMesh& mesh);

 private:
  struct Entry {
    std::shared_ptr<const MeshTextures> textures;
    uint64_t used = 0;
  };
  void drop_oldest();

  std::mutex mutex_;
  std::map<uint64_t, Entry> entries_;  ///< by RenderMesh::serial
  uint64_t clock_ = 0;
};

}  // namespace sightline::egl
