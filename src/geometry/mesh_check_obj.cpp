// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <set>
#include <vector>

#include "geometry/mesh_check.hpp"
#include "geometry/mesh_readers.hpp"
#include "geometry/text_scanner.hpp"

namespace sightline::geometry {
namespace {

/// Vertices (v), texture coordinates (vt) or normals (vn) of the file.
struct Element {
  const char* name;
  uint64_t count = 0;
  uint64_t largest = 0;  ///< index used by a face; faces may come before what they use
  size_t line = 0;       ///< of that face
  size_t face = 0;
};

/// assimp makes a mesh at every change of material and looks through all materials for each: 60,000
/// of them take it a third of a minute. So faces are handed over by material, and there may be so
/// many materials (a modeller's file has tens).
constexpr size_t kMaxMaterials = 4096;
constexpr size_t kMaxLibraries = 64;

/// Keeps faces by material, in the order in which the materials are first used.
class FacesByMaterial {
 public:
  /// False where that is one material too many.
  bool use(std::string_view name) {
    const auto known = groups_.find(name);
    if (known != groups_.end()) {
      current_ = known->second;
      return true;
    }
    if (groups_.size() == kMaxMaterials) return false;
    lists_.push_back({std::string(name), {}});
    current_ = &lists_.back();
    groups_.emplace(name, current_);
    return true;
  }

  std::string& faces() { return current_->faces; }

  std::string text() const {
    std::string out;
    for (const List& list : lists_) {
      if (list.faces.empty()) continue;
      if (!list.material.empty()) ((out += "usemtl ") += list.material) += '\n';
      out += list.faces;
    }
    return out;
  }

 private:
  struct List {
    std::string material;  ///< empty before the first usemtl
    std::string faces;
  };
  std::deque<List> lists_{List{}};
  std::map<std::string, List*, std::less<>> groups_;
  List* current_ = &lists_.front();
};

class ObjChecker {
 public:
  ObjChecker(std::string_view text, const std::string& where) : scanner_(text), where_(where) {}

  Result<CheckedMesh> check() {
    while (!scanner_.at_end()) {
      SL_RETURN_IF_ERROR(read_line());
      if (!words_.empty()) SL_RETURN_IF_ERROR(check_statement());
    }
    for (const Element& e : elements_) {
      if (e.largest > e.count) {
        return line_error(where_, e.line, "face {}: {} index {} of {}", e.face, e.name, e.largest,
                          e.count);
      }
    }
    return CheckedMesh{kept_ + by_material_.text(), {}, faces_};
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return line_error(where_, line_, format, std::forward<Args>(args)...);
  }

  /// Words of one statement, without comment, lines ending in '\' joined.
  Status read_line() {
    words_.clear();
    bool first = true;
    for (;;) {
      std::string_view word = scanner_.next_in_line();
      if (first) line_ = scanner_.line();
      first = false;
      const bool continued = !word.empty() && word.back() == '\\';
      if (continued) word.remove_suffix(1);
      if (word.empty() && !continued) break;
      if (!word.empty() && word.front() == '#') break;
      if (!word.empty()) words_.push_back(word);
      if (continued) scanner_.skip_line();
    }
    scanner_.skip_line();
    return {};
  }

  Status check_statement() {
    const std::string_view kind = words_[0];
    if (kind == "v") {
      ++elements_[0].count;
      SL_RETURN_IF_ERROR(check_numbers("vertex", elements_[0].count, 3, 7));
    } else if (kind == "vt") {
      ++elements_[1].count;
      SL_RETURN_IF_ERROR(check_numbers("texture coordinate", elements_[1].count, 1, 3));
    } else if (kind == "vn") {
      ++elements_[2].count;
      SL_RETURN_IF_ERROR(check_numbers("normal", elements_[2].count, 3, 3));
    } else if (kind == "f") {
      return check_face();
    } else if (kind == "usemtl") {
      return use_material();
    } else if (kind == "mtllib") {
      return add_library();
    } else {
      return {};  // names, groups, lines, points, curves: nothing of the surface
    }
    for (std::string_view word : words_) {
      if (word.front() == '.') kept_ += '0';  // assimp takes ".5" for no number
      (kept_ += word) += ' ';
    }
    kept_.back() = '\n';
    return {};
  }

  /// All after the first word; names may have spaces.
  std::string name_in_statement() const {
    std::string name;
    for (size_t i = 1; i < words_.size(); ++i) (name += i == 1 ? "" : " ") += words_[i];
    return name;
  }

  Status use_material() {
    const std::string name = name_in_statement();
    if (name.empty() || by_material_.use(name)) return {};
    return fault("more than {} materials; join some", kMaxMaterials);
  }

  Status add_library() {
    const std::string name = name_in_statement();
    if (name.empty() || !libraries_.insert(name).second) return {};
    if (libraries_.size() > kMaxLibraries) {
      return fault("more than {} material libraries; join some", kMaxLibraries);
    }
    ((kept_ += "mtllib ") += name) += '\n';
    return {};
  }

  Status check_numbers(const char* what, uint64_t number, size_t min, size_t max) {
    if (words_.size() - 1 < min || words_.size() - 1 > max) {
      return fault("{} {} has {} numbers", what, number, words_.size() - 1);
    }
    for (size_t i = 1; i < words_.size(); ++i) {
      const auto value = parse_number(words_[i]);
      if (!value) return fault("{} {}: '{}' is not a number", what, number, printable(words_[i]));
      if (!std::isfinite(static_cast<float>(*value))) {
        return fault("{} {} is not finite", what, number);
      }
    }
    return {};
  }

  Status check_face() {
    ++faces_;
    const size_t corners = words_.size() - 1;
    if (corners < 3 || corners > kMaxCorners) {
      return fault("face {}: {} corners, allowed are 3 to {}", faces_, corners, kMaxCorners);
    }
    std::string& kept = by_material_.faces();
    kept += 'f';
    for (size_t i = 1; i < words_.size(); ++i) SL_RETURN_IF_ERROR(check_corner(words_[i], kept));
    kept += '\n';
    return {};
  }

  /// "v", "v/vt", "v//vn" or "v/vt/vn"; negative indices count back from the latest. Left in `kept`
  /// counting from the first, for faces change places.
  Status check_corner(const std::string_view corner, std::string& kept) {
    std::string_view rest = corner;
    for (size_t part = 0; part < 3; ++part) {
      kept += part == 0 ? ' ' : '/';
      const size_t end = rest.find('/');
      const std::string_view index = rest.substr(0, end);
      if (!index.empty()) {
        SL_ASSIGN(const uint64_t from_first, check_index(index, &elements_[part]));
        fmt::format_to(std::back_inserter(kept), "{}", from_first);
      } else if (part != 1) {
        return fault("face {}: '{}' is not a corner", faces_, printable(corner));
      }
      if (end == std::string_view::npos) return {};
      rest.remove_prefix(end + 1);
    }
    return fault("face {}: '{}' is not a corner", faces_, printable(corner));
  }

  Result<uint64_t> check_index(std::string_view word, Element* element) {
    const bool negative = word.front() == '-';
    const auto value = parse_unsigned(negative ? word.substr(1) : word);
    if (!value || *value == 0 || *value > INT32_MAX) {
      return fault("face {}: '{}' is not a {} index (the first is 1)", faces_, printable(word),
                   element->name);
    }
    if (negative && *value > element->count) {
      return fault("face {}: {} index {} of {} so far", faces_, element->name, printable(word),
                   element->count);
    }
    if (!negative && *value > element->largest) {
      element->largest = *value;
      element->line = line_;
      element->face = faces_;
    }
    return negative ? element->count + 1 - *value : *value;
  }

  TextScanner scanner_;
  const std::string& where_;
  size_t line_ = 1;
  size_t faces_ = 0;
  std::vector<std::string_view> words_;
  std::array<Element, 3> elements_{{{"vertex"}, {"texture coordinate"}, {"normal"}}};
  std::string kept_;  ///< all but the faces
  FacesByMaterial by_material_;
  std::set<std::string> libraries_;
};

}  // namespace

Result<CheckedMesh> check_obj(std::string_view text, const std::string& where) {
  return ObjChecker(text, where).check();
}

}  // namespace sightline::geometry
