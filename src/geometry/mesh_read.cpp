// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>

#include "mesh_readers.hpp"
#include "sightline/base/files.hpp"

namespace sightline {
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

}  // namespace

Result<TriangleMesh> parse_mesh(std::string_view content, const std::string& format,
                                const std::string& where, const MeshOptions& options) {
  return parse(content, lower(format), where, {}, options);
}

Result<TriangleMesh> read_mesh(const std::filesystem::path& path, const MeshOptions& options) {
  SL_ASSIGN(const std::string content, read_file(path, kMaxMeshBytes));
  std::string format = lower(path.extension().string());
  if (!format.empty()) format.erase(0, 1);
  const std::filesystem::path directory =
      path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  return parse(content, format, path.string(), directory, options);
}

}  // namespace sightline
