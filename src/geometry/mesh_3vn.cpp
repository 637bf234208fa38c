// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cmath>
#include <optional>

#include "geometry/mesh_readers.hpp"
#include "geometry/text_scanner.hpp"

namespace sightline {

using namespace geometry;

namespace {

class Reader3vn {
 public:
  Reader3vn(std::string_view text, const std::string& where, const MeshOptions& options)
      : scanner_(text), where_(where), options_(options), size_(text.size()) {}

  Result<PolygonMesh> read() {
    SL_ASSIGN(const size_t vertices, count("number of vertices"));
    SL_ASSIGN(const size_t normals, count("number of normals"));
    SL_ASSIGN(const size_t faces, count("number of faces"));
    if (faces == 0 || vertices == 0)
      return fault("mesh has {} vertices and {} faces", vertices, faces);
    if (faces > options_.max_faces) {
      return fault("mesh has {} faces, the limit is {}", faces, options_.max_faces);
    }
    PolygonMesh mesh;
    SL_RETURN_IF_ERROR(read_vectors(vertices, "vertex", &mesh.vertices));
    SL_RETURN_IF_ERROR(read_vectors(normals, "normal", &mesh.normals));
    for (size_t f = 0; f < faces; ++f) SL_RETURN_IF_ERROR(read_face(f, &mesh));
    if (!scanner_.next().empty()) {
      return fault("text after the last of {} faces; are the counts in the first line right?",
                   faces);
    }
    return mesh;
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}", where_, scanner_.line()),
                      format, std::forward<Args>(args)...);
  }

  Error wrong_word(std::string_view word, const std::string& wanted) const {
    if (word.empty()) return fault("file ends where {} was expected", wanted);
    return fault("'{}' is not {}", printable(word), wanted);
  }

  Result<size_t> count(const std::string& what) {
    const std::string_view word = scanner_.next();
    const auto value = parse_unsigned(word);
    if (!value) return wrong_word(word, "the " + what);
    // Each thing counted takes at least two bytes of text, so this bounds what is allocated.
    if (*value > size_ / 2) {
      return fault("{} is {}, more than the file can hold", what, printable(word));
    }
    return static_cast<size_t>(*value);
  }

  Status read_vectors(size_t count, const char* what, std::vector<Eigen::Vector3f>* out) {
    out->reserve(count);
    for (size_t i = 0; i < count; ++i) {
      Eigen::Vector3f v;
      for (int axis = 0; axis < 3; ++axis) {
        const std::string_view word = scanner_.next();
        const auto value = parse_number(word);
        if (!value) return wrong_word(word, fmt::format("a number ({} {})", what, i));
        v(axis) = static_cast<float>(*value);
        if (!std::isfinite(v(axis))) return fault("{} {} is not finite", what, i);
      }
      out->push_back(v);
    }
    return {};
  }

  Status read_face(size_t face, PolygonMesh* mesh) {
    const std::string_view word = scanner_.next();
    const auto corners = parse_unsigned(word);
    if (!corners) return wrong_word(word, fmt::format("the number of corners of face {}", face));
    if (*corners < 3 || *corners > kMaxCorners) {
      return fault("face {}: {} corners, allowed are 3 to {}", face, *corners, kMaxCorners);
    }
    const auto n = static_cast<uint32_t>(*corners);
    SL_RETURN_IF_ERROR(
        read_indices(face, n, "vertex", mesh->vertices.size(), &mesh->corner_vertices));
    if (!mesh->normals.empty()) {
      SL_RETURN_IF_ERROR(
          read_indices(face, n, "normal", mesh->normals.size(), &mesh->corner_normals));
    }
    mesh->corner_counts.push_back(n);
    return {};
  }

  Status read_indices(size_t face, uint32_t n, const char* what, size_t limit,
                      std::vector<uint32_t>* out) {
    for (uint32_t i = 0; i < n; ++i) {
      const std::string_view word = scanner_.next();
      const auto index = parse_unsigned(word);
      if (!index && !parse_number(word)) {
        return wrong_word(word, fmt::format("a {} index of face {}", what, face));
      }
      if (!index || *index >= limit) {
        return fault("face {}: {} index {} of {} (the first is 0)", face, what, printable(word),
                     limit);
      }
      out->push_back(static_cast<uint32_t>(*index));
    }
    return {};
  }

  TextScanner scanner_;
  const std::string& where_;
  const MeshOptions& options_;
  size_t size_;
};

}  // namespace

Result<TriangleMesh> parse_3vn(std::string_view text, const std::string& where,
                               const MeshOptions& options) {
  SL_ASSIGN(const PolygonMesh polygons, Reader3vn(text, where, options).read());
  return triangulate_polygons(polygons, where, options);
}

}  // namespace sightline
