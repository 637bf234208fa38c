// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"

namespace sightline::geometry {

/// What a checker leaves for assimp, which reads broken files by dropping, clamping or crashing.
struct CheckedMesh {
  std::optional<std::string> content;  ///< to be read instead of the file: only what is understood
  std::string format;                  ///< of that content, where it differs from the file's
  std::optional<size_t> faces;         ///< polygons that must come out, where they can be counted
};

/// Each walks the whole file by its format's grammar and refuses, by line or element, numbers that
/// are not finite, indices out of range, counts the file cannot hold, and polygons too large.
Result<CheckedMesh> check_obj(std::string_view text, const std::string& where);
Result<CheckedMesh> check_off(std::string_view text, const std::string& where);
Result<CheckedMesh> check_ply(std::string_view content, const std::string& where);
Result<CheckedMesh> check_stl(std::string_view content, const std::string& where);
/// glTF 2 and GLB: buffers, views, accessors, primitives and the tree of nodes. Leaves geometry and
/// colors, of materials, vertices and base color textures; skins, animations and extensions are
/// taken out.
Result<CheckedMesh> check_gltf(std::string_view text, const std::string& where);
Result<CheckedMesh> check_glb(std::string_view content, const std::string& where);

/// An error of line `line` of the file.
template <typename... Args>
Error line_error(const std::string& where, size_t line, fmt::format_string<Args...> format,
                 Args&&... args) {
  return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}", where, line), format,
                    std::forward<Args>(args)...);
}

}  // namespace sightline::geometry
