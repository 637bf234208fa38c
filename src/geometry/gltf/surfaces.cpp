// SPDX-License-Identifier: Apache-2.0
#include "geometry/gltf/checker.hpp"

namespace sightline::geometry {

Status GltfChecker::check_image(const Json& image, const std::string& name, Json* kept) {
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

Status GltfChecker::check_texture(const Json& texture, const std::string& name, Json* kept) {
  if (!texture.contains("source")) return {};
  SL_ASSIGN(const uint64_t source, index_into(texture, "source", "images", name));
  (*kept)["source"] = source;
  return {};
}

Status GltfChecker::copy_base_texture(const Json& pbr, const std::string& name, Json* kept) const {
  if (!pbr.contains("baseColorTexture")) return {};
  const Json& texture = pbr["baseColorTexture"];
  if (!texture.is_object()) return fault("{}: 'baseColorTexture' must be an object", name);
  SL_ASSIGN(const uint64_t index, index_into(texture, "index", "textures", name));
  SL_ASSIGN(const uint64_t places, whole_or(texture, "texCoord", 0, name));
  if (places != 0 || texture.contains("extensions")) return {};
  (*kept)["baseColorTexture"] = {{"index", index}};
  return {};
}

Status GltfChecker::check_material(const Json& material, const std::string& name, Json* kept) {
  (*kept)["name"] = name;
  const Json pbr = material.value("pbrMetallicRoughness", Json::object());
  if (!pbr.is_object()) return fault("{}: 'pbrMetallicRoughness' must be an object", name);
  Json color = Json::object();
  SL_RETURN_IF_ERROR(copy_numbers(pbr, "baseColorFactor", 4, name, &color));
  SL_RETURN_IF_ERROR(copy_base_texture(pbr, name, &color));
  (*kept)["pbrMetallicRoughness"] = std::move(color);
  return {};
}

Status GltfChecker::check_mesh(const Json& mesh, const std::string& name, Json* kept) {
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

Status GltfChecker::check_primitive(const Json& primitive, const std::string& name, Json* kept) {
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

Status GltfChecker::copy_surface(const Json& attributes, uint64_t count, const std::string& name,
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

Status GltfChecker::check_vectors(const Accessor& a, const char* what, uint64_t count,
                                  const std::string& name) const {
  if (a.type == "VEC3" && a.component == 5126 && a.count == count) return {};
  return fault("{}: {} must be {} vectors of three floats", name, what, count);
}

}  // namespace sightline::geometry
