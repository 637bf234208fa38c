// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <vector>

#include "geometry/mesh_check.hpp"
#include "geometry/mesh_readers.hpp"
#include "geometry/text_scanner.hpp"

namespace sightline::geometry {
namespace {

/// Rewrites the file as OBJ: assimp's own OFF loader drops faces of more than nine corners.
class OffChecker {
 public:
  OffChecker(std::string_view text, const std::string& where)
      : scanner_(text), where_(where), size_(text.size()) {}

  Result<CheckedMesh> check() {
    if (!next_line() || words_[0] != "OFF") {
      return fault("file does not begin with OFF; variants (COFF, NOFF, binary) are not read");
    }
    words_.erase(words_.begin());
    if (words_.empty() && !next_line()) return fault("file ends before the counts");
    SL_ASSIGN(const uint64_t vertices, count(0, "vertices"));
    SL_ASSIGN(const uint64_t faces, count(1, "faces"));
    for (uint64_t i = 0; i < vertices; ++i) SL_RETURN_IF_ERROR(check_vertex(i));
    for (uint64_t i = 0; i < faces; ++i) SL_RETURN_IF_ERROR(check_face(i, vertices));
    if (next_line()) return fault("text after the last of {} faces", faces);
    return CheckedMesh{std::move(kept_), "obj", static_cast<size_t>(faces)};
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return line_error(where_, scanner_.line(), format, std::forward<Args>(args)...);
  }

  /// Words of the next line that has any, comments left out.
  bool next_line() {
    words_.clear();
    while (words_.empty()) {
      std::string_view word = scanner_.next();
      if (word.empty()) return false;
      for (; !word.empty() && word.front() != '#'; word = scanner_.next_in_line()) {
        words_.push_back(word);
      }
      if (!word.empty()) scanner_.skip_line();
    }
    return true;
  }

  Result<uint64_t> count(size_t index, const char* what) const {
    const auto value = index < words_.size() ? parse_unsigned(words_[index]) : std::nullopt;
    if (!value) return fault("the number of {} is missing", what);
    if (*value == 0 || *value > size_ / 2) {
      return fault("{} {}, but the file has {} bytes", *value, what, size_);
    }
    return *value;
  }

  Status check_vertex(uint64_t vertex) {
    if (!next_line()) return fault("file ends at vertex {}", vertex);
    if (words_.size() < 3) return fault("vertex {} has {} numbers", vertex, words_.size());
    kept_ += "v ";
    for (size_t i = 0; i < 3; ++i) {
      const auto value = parse_number(words_[i]);
      if (!value) return fault("vertex {}: '{}' is not a number", vertex, printable(words_[i]));
      if (!std::isfinite(static_cast<float>(*value)))
        return fault("vertex {} is not finite", vertex);
      (kept_ += words_[i]) += i < 2 ? ' ' : '\n';
    }
    return {};
  }

  Status check_face(uint64_t face, uint64_t vertices) {
    if (!next_line()) return fault("file ends at face {}", face);
    const auto corners = parse_unsigned(words_[0]);
    if (!corners || *corners < 3 || *corners > kMaxCorners || *corners >= words_.size()) {
      return fault("face {}: {} indices for {} corners, allowed are 3 to {}", face,
                   words_.size() - 1, printable(words_[0]), kMaxCorners);
    }
    kept_ += 'f';
    for (size_t i = 1; i <= *corners; ++i) {
      const auto index = parse_unsigned(words_[i]);
      if (!index || *index >= vertices) {
        return fault("face {}: vertex index {} of {}", face, printable(words_[i]), vertices);
      }
      kept_ += fmt::format(" {}", *index + 1);
    }
    kept_ += '\n';
    return {};
  }

  TextScanner scanner_;
  const std::string& where_;
  size_t size_;
  std::vector<std::string_view> words_;
  std::string kept_;
};

}  // namespace

Result<CheckedMesh> check_off(std::string_view text, const std::string& where) {
  return OffChecker(text, where).check();
}

}  // namespace sightline::geometry
