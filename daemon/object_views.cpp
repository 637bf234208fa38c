// SPDX-License-Identifier: Apache-2.0
#include "object_views.hpp"

#include <cstdlib>
#include <string>

#include "mesh_depth_renderer.hpp"

namespace sightline {
namespace {

// Relative paths are to be ignored, says the XDG base directory specification.
std::filesystem::path absolute_or_none(const std::filesystem::path& path) {
  return path.is_absolute() ? path : std::filesystem::path();
}

std::filesystem::path from_environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::filesystem::path() : absolute_or_none(value);
}

}  // namespace

std::filesystem::path cache_folder() {
  const std::string service = from_environment("CACHE_DIRECTORY").string();
  if (!service.empty()) return service.substr(0, service.find(':'));
  if (const auto user = from_environment("XDG_CACHE_HOME"); !user.empty()) {
    return user / "sightline";
  }
  const auto home = from_environment("HOME");
  return home.empty() ? home : home / ".cache" / "sightline";
}

Result<std::shared_ptr<const ViewpointModel>> load_views(const RigObject& object,
                                                         const std::filesystem::path& cache) {
  auto views = ViewpointModel::load_or_build(*object.triangles,
                                             mesh_depth_renderer_factory(object.mesh), {}, cache);
  if (views) return views;
  return make_error(views.error().code, object.description.mesh.string(), "{}", views.error().text);
}

}  // namespace sightline
