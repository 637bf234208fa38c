// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <utility>

#include "geometry/gltf/checker.hpp"

namespace sightline::geometry {

Status GltfChecker::check_buffer(const Json& buffer, const std::string& name, Json* kept) {
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

Result<uint64_t> GltfChecker::base64_bytes(std::string_view uri, const std::string& name) const {
  const size_t comma = uri.find(";base64,");
  if (comma == std::string::npos) return fault("{}: data that are not base64", name);
  const std::string_view data = uri.substr(comma + 8);
  const bool letters = std::all_of(data.begin(), data.end(), [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' ||
           c == '/' || c == '=';
  });
  const size_t padding = std::min<size_t>(2, data.size() - std::min(data.size(), data.find('=')));
  if (!letters || data.empty() || data.size() % 4 != 0 || data.find('=') < data.size() - padding) {
    return fault("{}: {} letters that are not base64", name, data.size());
  }
  return data.size() / 4 * 3 - padding;
}

Status GltfChecker::check_view(const Json& view, const std::string& name, Json* kept) {
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

Status GltfChecker::check_accessor(const Json& accessor, const std::string& name, Json* kept) {
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

uint64_t GltfChecker::component_size(uint64_t type) {
  if (type == 5120 || type == 5121) return 1;
  if (type == 5122 || type == 5123) return 2;
  return type == 5125 || type == 5126 ? 4 : 0;
}

uint64_t GltfChecker::component_count(const std::string& type) {
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

}  // namespace sightline::geometry
