// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>

#include "geometry/mesh_readers.hpp"
#include "sightline/base/files.hpp"

namespace sightline {

using namespace geometry;

namespace {

constexpr size_t kMaxMeshBytes = size_t{1} << 30;
constexpr std::array kImported = {"obj", "ply", "stl", "gltf", "glb", "off"};

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

Result<TriangleMesh> parse(std::string_view content, const std::string& format,
                           const std::string& where, const std::filesystem::path& directory,
                           const MeshOptions& options) {
  if (format == "3vn") return parse_3vn(content, where, options);
  if (std::find(kImported.begin(), kImported.end(), format) == kImported.end()) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "'{}' is no mesh format; known are obj, ply, stl, gltf, glb, off and 3vn",
                      format);
  }
  return import_mesh(content, format, where, directory, options);
}

std::string format_of(const std::filesystem::path& path) {
  std::string format = lower(path.extension().string());
  if (!format.empty()) format.erase(0, 1);
  return format;
}

std::filesystem::path folder_of(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

}  // namespace

Result<TriangleMesh> parse_mesh(std::string_view content, const std::string& format,
                                const std::string& where, const MeshOptions& options) {
  return parse(content, lower(format), where, {}, options);
}

Result<TriangleMesh> read_mesh(const std::filesystem::path& path, const MeshOptions& options) {
  SL_ASSIGN(const std::string content, read_file(path, kMaxMeshBytes));
  return parse(content, format_of(path), path.string(), folder_of(path), options);
}

Result<MeshSurface> read_mesh_surface(const std::filesystem::path& path,
                                      const MeshOptions& options) {
  const std::string format = format_of(path);
  if (format == "3vn" || format == "stl" || format == "off") return MeshSurface();
  SL_ASSIGN(const std::string content, read_file(path, kMaxMeshBytes));
  // Refuses what is no mesh, and says so.
  SL_RETURN_IF_ERROR([&]() -> Status {
    SL_ASSIGN([[maybe_unused]] const TriangleMesh mesh,
              parse(content, format, path.string(), folder_of(path), options));
    return {};
  }());
  return import_surface(content, format, path.string(), folder_of(path), options);
}

}  // namespace sightline
