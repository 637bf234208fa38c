// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstring>

#include "geometry/mesh_check.hpp"
#include "geometry/text_scanner.hpp"

namespace sightline::geometry {
namespace {

constexpr size_t kHeaderBytes = 84;
constexpr size_t kFacetBytes = 50;

/// solid NAME { facet normal N outer loop { vertex V } x3 endloop endfacet } endsolid NAME,
/// repeated.
class StlTextChecker {
 public:
  StlTextChecker(std::string_view text, const std::string& where) : scanner_(text), where_(where) {}

  Result<CheckedMesh> check() {
    for (std::string_view word = scanner_.next(); !word.empty(); word = scanner_.next()) {
      if (word != "solid") return fault("'{}' where 'solid' was expected", printable(word));
      scanner_.skip_line();
      SL_RETURN_IF_ERROR(check_solid());
    }
    return CheckedMesh{std::nullopt, {}, facets_};
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return line_error(where_, scanner_.line(), format, std::forward<Args>(args)...);
  }

  Status check_solid() {
    for (;;) {
      const std::string_view word = scanner_.next();
      if (word == "endsolid") break;
      if (word != "facet") return fault("'{}' where 'facet' was expected", printable(word));
      SL_RETURN_IF_ERROR(expect("normal"));
      SL_RETURN_IF_ERROR(numbers(true));
      SL_RETURN_IF_ERROR(expect("outer"));
      SL_RETURN_IF_ERROR(expect("loop"));
      for (int i = 0; i < 3; ++i) {
        SL_RETURN_IF_ERROR(expect("vertex"));
        SL_RETURN_IF_ERROR(numbers(false));
      }
      SL_RETURN_IF_ERROR(expect("endloop"));
      SL_RETURN_IF_ERROR(expect("endfacet"));
      ++facets_;
    }
    scanner_.skip_line();
    return {};
  }

  Status expect(std::string_view wanted) {
    const std::string_view word = scanner_.next();
    if (word == wanted) return {};
    return fault("facet {}: '{}' where '{}' was expected", facets_, printable(word), wanted);
  }

  /// Three numbers. Normals are made anew, so what a writer put there for a sliver does not matter.
  Status numbers(bool of_normal) {
    for (int i = 0; i < 3; ++i) {
      const std::string_view word = scanner_.next();
      const auto value = parse_number(word);
      if (!value) return fault("facet {}: '{}' is not a number", facets_, printable(word));
      if (!of_normal && !std::isfinite(static_cast<float>(*value))) {
        return fault("facet {}: a vertex is not finite", facets_);
      }
    }
    return {};
  }

  TextScanner scanner_;
  const std::string& where_;
  size_t facets_ = 0;
};

}  // namespace

Result<CheckedMesh> check_stl(std::string_view content, const std::string& where) {
  if (content.size() >= kHeaderBytes) {
    uint32_t facets = 0;
    std::memcpy(&facets, content.data() + kHeaderBytes - sizeof facets, sizeof facets);
    if (content.size() == kHeaderBytes + kFacetBytes * size_t{facets}) {
      return CheckedMesh{std::nullopt, {}, facets};
    }
  }
  if (content.substr(0, 5) == "solid") return StlTextChecker(content, where).check();
  return make_error(
      ErrorCode::kInvalidInput, where,
      "neither text (does not begin with 'solid') nor binary STL (its {} bytes do not "
      "agree with its number of facets; cut short?)",
      content.size());
}

}  // namespace sightline::geometry
