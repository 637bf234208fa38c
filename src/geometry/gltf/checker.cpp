// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "geometry/gltf/checker.hpp"

namespace sightline::geometry {

Result<GltfChecker::Checked> GltfChecker::check() {
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

Status GltfChecker::each(const char* list, Check check_item) {
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

Result<uint64_t> GltfChecker::whole(const Json& item, const char* key,
                                    const std::string& name) const {
  const auto found = item.find(key);
  if (found == item.end() || !found->is_number_unsigned() || found->get<uint64_t>() > UINT32_MAX) {
    return fault("{}: '{}' must be a whole number", name, key);
  }
  return found->get<uint64_t>();
}

Result<uint64_t> GltfChecker::whole_or(const Json& item, const char* key, uint64_t otherwise,
                                       const std::string& name) const {
  if (!item.contains(key)) return otherwise;
  return whole(item, key, name);
}

Result<uint64_t> GltfChecker::index_into(const Json& item, const char* key, const char* list,
                                         const std::string& name) const {
  SL_ASSIGN(const uint64_t index, whole(item, key, name));
  const size_t count = in_.contains(list) ? in_[list].size() : 0;
  if (index >= count) return fault("{}: {} index {} of {}", name, list, index, count);
  return index;
}

Status GltfChecker::copy_numbers(const Json& item, const char* key, size_t count,
                                 const std::string& name, Json* kept) const {
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

Status GltfChecker::check_asset() {
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

}  // namespace sightline::geometry
