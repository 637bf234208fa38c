// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline::geometry {

using Json = nlohmann::json;

/// Checks a glTF document list by list; only what is checked is copied into the document that
/// assimp reads. The order is that of the references: buffers, views, accessors, surfaces, nodes.
class GltfChecker {
 public:
  GltfChecker(const Json& in, bool has_chunk, size_t chunk_bytes, const std::string& where)
      : in_(in), has_chunk_(has_chunk), chunk_bytes_(chunk_bytes), where_(where) {}

  struct Checked {
    Json document;
    size_t faces = 0;
  };

  Result<Checked> check();

 private:
  struct View {
    uint64_t bytes = 0;
    uint64_t stride = 0;
  };
  struct Accessor {
    uint64_t count = 0;
    uint64_t component = 0;
    std::string type;
  };

  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, where_, format, std::forward<Args>(args)...);
  }

  using Check = Status (GltfChecker::*)(const Json& item, const std::string& name, Json* kept);

  /// Runs a check over a list of the document, which may be absent.
  Status each(const char* list, Check check_item);
  Result<uint64_t> whole(const Json& item, const char* key, const std::string& name) const;
  Result<uint64_t> whole_or(const Json& item, const char* key, uint64_t otherwise,
                            const std::string& name) const;
  /// An index into a list that has been read already.
  Result<uint64_t> index_into(const Json& item, const char* key, const char* list,
                              const std::string& name) const;
  Status copy_numbers(const Json& item, const char* key, size_t count, const std::string& name,
                      Json* kept) const;
  Status check_asset();
  Status check_buffer(const Json& buffer, const std::string& name, Json* kept);
  /// How many bytes a data URI holds.
  Result<uint64_t> base64_bytes(std::string_view uri, const std::string& name) const;
  Status check_view(const Json& view, const std::string& name, Json* kept);
  Status check_accessor(const Json& accessor, const std::string& name, Json* kept);
  static uint64_t component_size(uint64_t type);
  /// Matrices occur only in skins and animations, which are not read, yet may be listed.
  static uint64_t component_count(const std::string& type);
  /// An image in the folder, in a data URI or in a buffer view; assimp hands its bytes on unread.
  /// One of another kind is no reason to refuse the mesh: it is named so that it will not be found.
  Status check_image(const Json& image, const std::string& name, Json* kept);
  /// Its filters and edges are not asked for. Without a source of a known kind it shows nothing.
  Status check_texture(const Json& texture, const std::string& name, Json* kept);
  /// By the first set of places, as they are: one that is moved by an extension is left out.
  Status copy_base_texture(const Json& pbr, const std::string& name, Json* kept) const;
  Status check_material(const Json& material, const std::string& name, Json* kept);
  Status check_mesh(const Json& mesh, const std::string& name, Json* kept);
  Status check_primitive(const Json& primitive, const std::string& name, Json* kept);
  /// Places in the texture and colors of the vertices, of the kinds that are read.
  Status copy_surface(const Json& attributes, uint64_t count, const std::string& name,
                      Json* kept) const;

  Status check_vectors(const Accessor& a, const char* what, uint64_t count,
                       const std::string& name) const;
  Status check_node(const Json& node, const std::string& name, Json* kept);
  Status check_scene(const Json& scene, const std::string& name, Json* kept);
  Status copy_nodes(const Json& item, const char* key, const std::string& name, Json* kept) const;
  /// The nodes form trees: each has one parent at most, and no chain of them is too long. With one
  /// parent each, climbing ends at a root or runs in a circle, which the depth limit ends.
  Status check_depths() const;
  /// Triangles of the trees under these nodes; assimp drops those with an index out of range.
  size_t faces_of_nodes(const Json& roots) const;

  const Json& in_;
  bool has_chunk_;
  size_t chunk_bytes_;
  const std::string& where_;
  Json out_ = Json::object();
  std::vector<uint64_t> buffer_bytes_;
  std::vector<View> views_;
  std::vector<Accessor> accessors_;
  std::vector<size_t> mesh_faces_;
};

}  // namespace sightline::geometry
