// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "mesh_check.hpp"

namespace sightline {
namespace {

using Json = nlohmann::json;

constexpr int kMaxNesting = 32;     // of brackets in the text
constexpr int kMaxNodeDepth = 200;  // assimp walks the tree by recursion
constexpr size_t kMaxNodes = 100'000;

int nesting_of(std::string_view text) {
  int depth = 0;
  int deepest = 0;
  bool quoted = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '\\') ++i;
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    if (c == '{' || c == '[') deepest = std::max(deepest, ++depth);
    if (c == '}' || c == ']') --depth;
  }
  return deepest;
}

/// Only what is checked here is copied into the document that assimp reads.
class GltfChecker {
 public:
  GltfChecker(const Json& in, bool has_chunk, size_t chunk_bytes, const std::string& where)
      : in_(in), has_chunk_(has_chunk), chunk_bytes_(chunk_bytes), where_(where) {}

  struct Checked {
    Json document;
    size_t faces = 0;
  };

  Result<Checked> check() {
    SL_RETURN_IF_ERROR(check_asset());
    SL_RETURN_IF_ERROR(each("buffers", &GltfChecker::check_buffer));
    SL_RETURN_IF_ERROR(each("bufferViews", &GltfChecker::check_view));
    SL_RETURN_IF_ERROR(each("accessors", &GltfChecker::check_accessor));
    if (!in_.value("images", Json::array()).empty())
      SL_RETURN_IF_ERROR(each("images", &GltfChecker::check_image));
    if (!in_.value("textures", Json::array()).empty())
      SL_RETURN_IF_ERROR(each("textures", &GltfChecker::check_texture));
    SL_RETURN_IF_ERROR(each("materials", &GltfChecker::check_material));
    SL_RETURN_IF_ERROR(each("meshes", &GltfChecker::check_mesh));
    SL_RETURN_IF_ERROR(each("nodes", &GltfChecker::check_node));
    SL_RETURN_IF_ERROR(each("scenes", &GltfChecker::check_scene));
    SL_RETURN_IF_ERROR(check_depths());
    if (!out_.contains("scenes")) return fault("document without scene");
    uint64_t scene = 0;
    if (in_.contains("scene")) {
      SL_ASSIGN(scene, index_into(in_, "scene", "scenes", "document"));
    }
    out_["scene"] = scene;
    const size_t faces = faces_of_nodes(out_["scenes"][scene].value("nodes", Json::array()));
    return Checked{std::move(out_), faces};
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, where_, format, std::forward<Args>(args)...);
  }

  using Check = Status (GltfChecker::*)(const Json& item, const std::string& name, Json* kept);

  /// Runs a check over a list of the document, which may be absent.
  Status each(const char* list, Check check_item) {
    if (!in_.contains(list)) return {};
    const Json& items = in_[list];
    if (!items.is_array() || items.empty()) return fault("'{}' must be a list", list);
    for (size_t i = 0; i < items.size(); ++i) {
      const std::string name = fmt::format("{}[{}]", list, i);
      if (!items[i].is_object()) return fault("{} must be an object", name);
      Json kept = Json::object();
      SL_RETURN_IF_ERROR((this->*check_item)(items[i], name, &kept));
      out_[list].push_back(std::move(kept));
    }
    return {};
  }

  Result<uint64_t> whole(const Json& item, const char* key, const std::string& name) const {
    const auto found = item.find(key);
    if (found == item.end() || !found->is_number_unsigned() ||
        found->get<uint64_t>() > UINT32_MAX) {
      return fault("{}: '{}' must be a whole number", name, key);
    }
    return found->get<uint64_t>();
  }

  Result<uint64_t> whole_or(const Json& item, const char* key, uint64_t otherwise,
                            const std::string& name) const {
    if (!item.contains(key)) return otherwise;
    return whole(item, key, name);
  }

  /// An index into a list that has been read already.
  Result<uint64_t> index_into(const Json& item, const char* key, const char* list,
                              const std::string& name) const {
    SL_ASSIGN(const uint64_t index, whole(item, key, name));
    const size_t count = in_.contains(list) ? in_[list].size() : 0;
    if (index >= count) return fault("{}: {} index {} of {}", name, list, index, count);
    return index;
  }

  Status copy_numbers(const Json& item, const char* key, size_t count, const std::string& name,
                      Json* kept) const {
    if (!item.contains(key)) return {};
    const Json& list = item[key];
    bool good = list.is_array() && list.size() == count;
    for (size_t i = 0; good && i < count; ++i) {
      good = list[i].is_number() && std::abs(list[i].get<double>()) < 1e30;
    }
    if (!good) return fault("{}: '{}' must be {} finite numbers", name, key, count);
    (*kept)[key] = list;
    return {};
  }

  Status check_asset() {
    const Json asset = in_.value("asset", Json::object());
    const Json version = asset.is_object() ? asset.value("version", Json()) : Json();
    if (!version.is_string() || version.get<std::string>().rfind("2.", 0) != 0) {
      return fault("not glTF version 2; export the model anew");
    }
    out_["asset"] = {{"version", "2.0"}};
    for (const Json& name : in_.value("extensionsRequired", Json::array())) {
      const std::string text = name.is_string() ? name.get<std::string>() : "?";
      if (text.rfind("KHR_materials_", 0) != 0 && text != "KHR_texture_transform") {
        return fault("needs the extension {}, which is not read; export without it", text);
      }
    }
    return {};
  }

  Status check_buffer(const Json& buffer, const std::string& name, Json* kept) {
    SL_ASSIGN(const uint64_t bytes, whole(buffer, "byteLength", name));
    (*kept)["byteLength"] = bytes;
    buffer_bytes_.push_back(bytes);
    if (!buffer.contains("uri")) {
      if (!has_chunk_ || buffer_bytes_.size() > 1) return fault("{} without 'uri'", name);
      if (bytes > chunk_bytes_) return fault("{}: {} bytes of {}", name, bytes, chunk_bytes_);
      return {};
    }
    if (!buffer["uri"].is_string()) return fault("{}: 'uri' must be text", name);
    const std::string uri = buffer["uri"].get<std::string>();
    (*kept)["uri"] = uri;
    if (uri.rfind("data:", 0) != 0)
      return {};  // a file of the folder; its size is checked on reading
    SL_ASSIGN(const uint64_t held, base64_bytes(uri, name));
    if (held != bytes) return fault("{}: {} bytes of base64 are not {}", name, held, bytes);
    return {};
  }

  /// How many bytes a data URI holds.
  Result<uint64_t> base64_bytes(std::string_view uri, const std::string& name) const {
    const size_t comma = uri.find(";base64,");
    if (comma == std::string::npos) return fault("{}: data that are not base64", name);
    const std::string_view data = uri.substr(comma + 8);
    const bool letters = std::all_of(data.begin(), data.end(), [](char c) {
      return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ||
             c == '+' || c == '/' || c == '=';
    });
    const size_t padding = std::min<size_t>(2, data.size() - std::min(data.size(), data.find('=')));
    if (!letters || data.empty() || data.size() % 4 != 0 ||
        data.find('=') < data.size() - padding) {
      return fault("{}: {} letters that are not base64", name, data.size());
    }
    return data.size() / 4 * 3 - padding;
  }

  Status check_view(const Json& view, const std::string& name, Json* kept) {
    SL_ASSIGN(const uint64_t buffer, index_into(view, "buffer", "buffers", name));
    SL_ASSIGN(const uint64_t offset, whole_or(view, "byteOffset", 0, name));
    SL_ASSIGN(const uint64_t bytes, whole(view, "byteLength", name));
    SL_ASSIGN(const uint64_t stride, whole_or(view, "byteStride", 0, name));
    if (bytes == 0 || offset + bytes > buffer_bytes_[buffer]) {
      return fault("{}: bytes {} to {} of {}", name, offset, offset + bytes, buffer_bytes_[buffer]);
    }
    if (stride > 252 || stride % 4 != 0) return fault("{}: byteStride {}", name, stride);
    *kept = {{"buffer", buffer}, {"byteOffset", offset}, {"byteLength", bytes}};
    if (stride != 0) (*kept)["byteStride"] = stride;
    views_.push_back({bytes, stride});
    return {};
  }

  Status check_accessor(const Json& accessor, const std::string& name, Json* kept) {
    Accessor a;
    SL_ASSIGN(const uint64_t view, index_into(accessor, "bufferView", "bufferViews", name));
    SL_ASSIGN(const uint64_t offset, whole_or(accessor, "byteOffset", 0, name));
    SL_ASSIGN(a.count, whole(accessor, "count", name));
    SL_ASSIGN(a.component, whole(accessor, "componentType", name));
    const Json type = accessor.value("type", Json());
    a.type = type.is_string() ? type.get<std::string>() : "";
    const uint64_t component_bytes = component_size(a.component);
    const uint64_t components = component_count(a.type);
    if (component_bytes == 0 || components == 0) return fault("{}: unknown type", name);
    if (accessor.contains("sparse")) return fault("{}: sparse accessors are not read", name);
    const uint64_t element = component_bytes * components;
    const uint64_t stride = views_[view].stride != 0 ? views_[view].stride : element;
    if (a.count == 0 || stride < element ||
        offset + stride * (a.count - 1) + element > views_[view].bytes) {
      return fault("{}: {} elements do not fit its buffer view", name, a.count);
    }
    *kept = {{"bufferView", view},
             {"byteOffset", offset},
             {"count", a.count},
             {"componentType", a.component},
             {"type", a.type}};
    if (accessor.value("normalized", Json(false)) == Json(true)) (*kept)["normalized"] = true;
    accessors_.push_back(std::move(a));
    return {};
  }

  static uint64_t component_size(uint64_t type) {
    if (type == 5120 || type == 5121) return 1;
    if (type == 5122 || type == 5123) return 2;
    return type == 5125 || type == 5126 ? 4 : 0;
  }

  /// Matrices occur only in skins and animations, which are not read, yet may be listed.
  static uint64_t component_count(const std::string& type) {
    static constexpr std::array<std::pair<const char*, uint64_t>, 7> kTypes = {{{"SCALAR", 1},
                                                                                {"VEC2", 2},
                                                                                {"VEC3", 3},
                                                                                {"VEC4", 4},
                                                                                {"MAT2", 4},
                                                                                {"MAT3", 9},
                                                                                {"MAT4", 16}}};
    for (const auto& [name, count] : kTypes) {
      if (type == name) return count;
    }
    return 0;
  }

  /// A picture in the folder, in a data URI or in a buffer view; assimp hands its bytes on unread.
  /// One of another kind is no reason to refuse the mesh: it is named so that it will not be found.
  Status check_image(const Json& image, const std::string& name, Json* kept) {
    const Json uri = image.value("uri", Json());
    const Json type = image.value("mimeType", Json());
    if (uri.is_string()) {
      const std::string text = uri.get<std::string>();
      if (text.rfind("data:", 0) != 0 || base64_bytes(text, name)) (*kept)["uri"] = text;
    } else if (type == "image/png" || type == "image/jpeg") {
      SL_ASSIGN(const uint64_t view, index_into(image, "bufferView", "bufferViews", name));
      *kept = {{"bufferView", view}, {"mimeType", type}};
    }
    if (kept->empty()) (*kept)["uri"] = name + " is of a kind that is not read";
    return {};
  }

  /// Its filters and edges are not asked for. Without a source of a known kind it shows nothing.
  Status check_texture(const Json& texture, const std::string& name, Json* kept) {
    if (!texture.contains("source")) return {};
    SL_ASSIGN(const uint64_t source, index_into(texture, "source", "images", name));
    (*kept)["source"] = source;
    return {};
  }

  /// By the first set of places, as they are: one that is moved by an extension is left out.
  Status copy_base_texture(const Json& pbr, const std::string& name, Json* kept) const {
    if (!pbr.contains("baseColorTexture")) return {};
    const Json& texture = pbr["baseColorTexture"];
    if (!texture.is_object()) return fault("{}: 'baseColorTexture' must be an object", name);
    SL_ASSIGN(const uint64_t index, index_into(texture, "index", "textures", name));
    SL_ASSIGN(const uint64_t places, whole_or(texture, "texCoord", 0, name));
    if (places != 0 || texture.contains("extensions")) return {};
    (*kept)["baseColorTexture"] = {{"index", index}};
    return {};
  }

  Status check_material(const Json& material, const std::string& name, Json* kept) {
    (*kept)["name"] = name;
    const Json pbr = material.value("pbrMetallicRoughness", Json::object());
    if (!pbr.is_object()) return fault("{}: 'pbrMetallicRoughness' must be an object", name);
    Json color = Json::object();
    SL_RETURN_IF_ERROR(copy_numbers(pbr, "baseColorFactor", 4, name, &color));
    SL_RETURN_IF_ERROR(copy_base_texture(pbr, name, &color));
    (*kept)["pbrMetallicRoughness"] = std::move(color);
    return {};
  }

  Status check_mesh(const Json& mesh, const std::string& name, Json* kept) {
    const Json primitives = mesh.value("primitives", Json());
    if (!primitives.is_array() || primitives.empty()) return fault("{} without primitives", name);
    mesh_faces_.push_back(0);
    for (const Json& primitive : primitives) {
      Json out = Json::object();
      SL_RETURN_IF_ERROR(check_primitive(primitive, name, &out));
      (*kept)["primitives"].push_back(std::move(out));
    }
    return {};
  }

  Status check_primitive(const Json& primitive, const std::string& name, Json* kept) {
    if (!primitive.is_object() || !primitive.value("attributes", Json()).is_object()) {
      return fault("{}: primitive without attributes", name);
    }
    if (primitive.value("extensions", Json::object()).contains("KHR_draco_mesh_compression")) {
      return fault("{} is compressed by Draco, which is not read; export without it", name);
    }
    SL_ASSIGN(const uint64_t mode, whole_or(primitive, "mode", 4, name));
    if (mode > 6) return fault("{}: mode {}", name, mode);
    (*kept)["mode"] = mode;
    const Json& attributes = primitive["attributes"];
    SL_ASSIGN(const uint64_t position, index_into(attributes, "POSITION", "accessors", name));
    (*kept)["attributes"]["POSITION"] = position;
    SL_RETURN_IF_ERROR(
        check_vectors(accessors_[position], "POSITION", accessors_[position].count, name));
    if (attributes.contains("NORMAL")) {
      SL_ASSIGN(const uint64_t normal, index_into(attributes, "NORMAL", "accessors", name));
      SL_RETURN_IF_ERROR(
          check_vectors(accessors_[normal], "NORMAL", accessors_[position].count, name));
      (*kept)["attributes"]["NORMAL"] = normal;
    }
    SL_RETURN_IF_ERROR(copy_surface(attributes, accessors_[position].count, name, kept));
    uint64_t corners = accessors_[position].count;
    if (primitive.contains("indices")) {
      SL_ASSIGN(const uint64_t indices, index_into(primitive, "indices", "accessors", name));
      const Accessor& a = accessors_[indices];
      const bool good = a.component == 5121 || a.component == 5123 || a.component == 5125;
      if (a.type != "SCALAR" || !good) return fault("{}: indices of the wrong type", name);
      (*kept)["indices"] = indices;
      corners = a.count;
    }
    if (mode == 4) mesh_faces_.back() += corners / 3;
    if (mode > 4 && corners > 2) mesh_faces_.back() += corners - 2;
    if (primitive.contains("material")) {
      SL_ASSIGN(const uint64_t material, index_into(primitive, "material", "materials", name));
      (*kept)["material"] = material;
    }
    return {};
  }

  /// Places in the texture and colours of the vertices, of the kinds that are read.
  Status copy_surface(const Json& attributes, uint64_t count, const std::string& name,
                      Json* kept) const {
    for (const char* const what : {"TEXCOORD_0", "COLOR_0"}) {
      if (!attributes.contains(what)) continue;
      SL_ASSIGN(const uint64_t index, index_into(attributes, what, "accessors", name));
      const Accessor& a = accessors_[index];
      if (a.count != count) return fault("{}: {} {} for {} vertices", name, a.count, what, count);
      const bool is_place = std::string_view(what) == "TEXCOORD_0";
      const bool known = is_place ? a.type == "VEC2" : a.type == "VEC4" || a.type == "VEC3";
      if (known && a.component == 5126) (*kept)["attributes"][what] = index;
    }
    return {};
  }

  struct Accessor {
    uint64_t count = 0;
    uint64_t component = 0;
    std::string type;
  };

  Status check_vectors(const Accessor& a, const char* what, uint64_t count,
                       const std::string& name) const {
    if (a.type == "VEC3" && a.component == 5126 && a.count == count) return {};
    return fault("{}: {} must be {} vectors of three floats", name, what, count);
  }

  Status check_node(const Json& node, const std::string& name, Json* kept) {
    if (node.contains("mesh")) {
      SL_ASSIGN(const uint64_t mesh, index_into(node, "mesh", "meshes", name));
      (*kept)["mesh"] = mesh;
    }
    SL_RETURN_IF_ERROR(copy_numbers(node, "matrix", 16, name, kept));
    SL_RETURN_IF_ERROR(copy_numbers(node, "translation", 3, name, kept));
    SL_RETURN_IF_ERROR(copy_numbers(node, "rotation", 4, name, kept));
    SL_RETURN_IF_ERROR(copy_numbers(node, "scale", 3, name, kept));
    return copy_nodes(node, "children", name, kept);
  }

  Status check_scene(const Json& scene, const std::string& name, Json* kept) {
    return copy_nodes(scene, "nodes", name, kept);
  }

  Status copy_nodes(const Json& item, const char* key, const std::string& name, Json* kept) const {
    if (!item.contains(key)) return {};
    const Json& list = item[key];
    const size_t count = in_.contains("nodes") ? in_["nodes"].size() : 0;
    if (!list.is_array() || list.empty()) return fault("{}: '{}' must be a list", name, key);
    for (const Json& index : list) {
      if (!index.is_number_unsigned() || index.get<uint64_t>() >= count) {
        return fault("{}: node index {} of {}", name, index.dump(), count);
      }
    }
    (*kept)[key] = list;
    return {};
  }

  /// The nodes form trees: each has one parent at most, and no chain of them is too long. With one
  /// parent each, climbing ends at a root or runs in a circle, which the depth limit ends.
  Status check_depths() const {
    if (!out_.contains("nodes")) return {};
    const Json& nodes = out_["nodes"];
    if (nodes.size() > kMaxNodes)
      return fault("{} nodes, the limit is {}", nodes.size(), kMaxNodes);
    constexpr size_t kRoot = SIZE_MAX;
    std::vector<size_t> parent(nodes.size(), kRoot);
    for (size_t i = 0; i < nodes.size(); ++i) {
      for (const Json& child : nodes[i].value("children", Json::array())) {
        size_t& of = parent[child.get<size_t>()];
        if (of != kRoot) return fault("nodes[{}] has two parents", child.get<size_t>());
        of = i;
      }
    }
    for (const Json& scene : out_.value("scenes", Json::array())) {
      std::vector<bool> listed(nodes.size(), false);
      for (const Json& root : scene.value("nodes", Json::array())) {
        const auto index = root.get<size_t>();
        if (listed[index] || parent[index] != kRoot) return fault("nodes[{}] is no root", index);
        listed[index] = true;
      }
    }
    for (size_t i = 0; i < nodes.size(); ++i) {
      int depth = 0;
      for (size_t at = i; parent[at] != kRoot; at = parent[at]) {
        if (++depth > kMaxNodeDepth) return fault("nodes[{}] is in a circle or too deep", i);
      }
    }
    return {};
  }

  /// Triangles of the trees under these nodes; assimp drops those with an index out of range.
  size_t faces_of_nodes(const Json& roots) const {
    size_t faces = 0;
    std::vector<size_t> stack = roots.get<std::vector<size_t>>();
    while (!stack.empty()) {
      const Json& node = out_["nodes"][stack.back()];
      stack.pop_back();
      if (node.contains("mesh")) faces += mesh_faces_[node["mesh"].get<size_t>()];
      for (const Json& child : node.value("children", Json::array())) {
        stack.push_back(child.get<size_t>());
      }
    }
    return faces;
  }

  struct View {
    uint64_t bytes = 0;
    uint64_t stride = 0;
  };

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

Result<CheckedMesh> checked_document(std::string_view text, bool has_chunk, size_t chunk_bytes,
                                     const std::string& where) {
  if (nesting_of(text) > kMaxNesting) {
    return make_error(ErrorCode::kInvalidInput, where, "JSON nested too deeply");
  }
  const Json document = Json::parse(text, nullptr, false);
  if (!document.is_object())
    return make_error(ErrorCode::kInvalidInput, where, "not a glTF document");
  SL_ASSIGN(const auto kept, GltfChecker(document, has_chunk, chunk_bytes, where).check());
  return CheckedMesh{kept.document.dump(), {}, kept.faces};
}

uint32_t word_at(std::string_view content, size_t at) {
  uint32_t word = 0;
  std::memcpy(&word, content.data() + at, sizeof word);
  return word;
}

void append_word(uint32_t word, std::string* out) {
  out->append(reinterpret_cast<const char*>(&word), sizeof word);
}

constexpr uint32_t kGlbMagic = 0x46546C67;
constexpr uint32_t kJsonChunk = 0x4E4F534A;
constexpr uint32_t kBinaryChunk = 0x004E4942;

}  // namespace

Result<CheckedMesh> check_gltf(std::string_view text, const std::string& where) {
  return checked_document(text, false, 0, where);
}

Result<CheckedMesh> check_glb(std::string_view content, const std::string& where) {
  const auto damaged = [&where] {
    return make_error(ErrorCode::kInvalidInput, where, "not a binary glTF 2 file, or cut short");
  };
  if (content.size() < 20 || word_at(content, 0) != kGlbMagic || word_at(content, 4) != 2 ||
      word_at(content, 8) != content.size() || word_at(content, 16) != kJsonChunk) {
    return damaged();
  }
  const size_t json_bytes = word_at(content, 12);
  if (json_bytes > content.size() - 20) return damaged();
  std::string_view rest = content.substr(20 + json_bytes);
  std::string_view binary;
  if (rest.size() >= 8 && word_at(rest, 4) == kBinaryChunk) {
    if (word_at(rest, 0) > rest.size() - 8) return damaged();
    binary = rest.substr(8, word_at(rest, 0));
  }
  SL_ASSIGN(const CheckedMesh checked, checked_document(content.substr(20, json_bytes),
                                                        !binary.empty(), binary.size(), where));
  std::string document = *checked.content;
  while (document.size() % 4 != 0) document += ' ';
  std::string padded(binary);
  while (padded.size() % 4 != 0) padded += '\0';
  std::string out;
  append_word(kGlbMagic, &out);
  append_word(2, &out);
  const size_t binary_total = padded.empty() ? 0 : 8 + padded.size();
  append_word(static_cast<uint32_t>(20 + document.size() + binary_total), &out);
  append_word(static_cast<uint32_t>(document.size()), &out);
  append_word(kJsonChunk, &out);
  out += document;
  if (!padded.empty()) {
    append_word(static_cast<uint32_t>(padded.size()), &out);
    append_word(kBinaryChunk, &out);
    out += padded;
  }
  return CheckedMesh{std::move(out), {}, checked.faces};
}

}  // namespace sightline
