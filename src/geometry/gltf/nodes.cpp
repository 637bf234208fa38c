// SPDX-License-Identifier: Apache-2.0
#include "geometry/gltf/checker.hpp"

namespace sightline::geometry {

namespace {

constexpr int kMaxNodeDepth = 200;  // assimp walks the tree by recursion
constexpr size_t kMaxNodes = 100'000;

}  // namespace

Status GltfChecker::check_node(const Json& node, const std::string& name, Json* kept) {
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

Status GltfChecker::check_scene(const Json& scene, const std::string& name, Json* kept) {
  return copy_nodes(scene, "nodes", name, kept);
}

Status GltfChecker::copy_nodes(const Json& item, const char* key, const std::string& name,
                               Json* kept) const {
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

Status GltfChecker::check_depths() const {
  if (!out_.contains("nodes")) return {};
  const Json& nodes = out_["nodes"];
  if (nodes.size() > kMaxNodes) return fault("{} nodes, the limit is {}", nodes.size(), kMaxNodes);
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

size_t GltfChecker::faces_of_nodes(const Json& roots) const {
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

}  // namespace sightline::geometry
