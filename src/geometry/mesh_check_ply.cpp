// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>
#include <vector>

#include "geometry/mesh_check.hpp"
#include "geometry/mesh_readers.hpp"
#include "geometry/text_scanner.hpp"

namespace sightline::geometry {
namespace {

enum class Scalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct ScalarName {
  std::string_view name;
  Scalar scalar;
};
constexpr std::array<ScalarName, 16> kScalars = {{{"char", Scalar::kInt8},
                                                  {"int8", Scalar::kInt8},
                                                  {"uchar", Scalar::kUint8},
                                                  {"uint8", Scalar::kUint8},
                                                  {"short", Scalar::kInt16},
                                                  {"int16", Scalar::kInt16},
                                                  {"ushort", Scalar::kUint16},
                                                  {"uint16", Scalar::kUint16},
                                                  {"int", Scalar::kInt32},
                                                  {"int32", Scalar::kInt32},
                                                  {"uint", Scalar::kUint32},
                                                  {"uint32", Scalar::kUint32},
                                                  {"float", Scalar::kFloat},
                                                  {"float32", Scalar::kFloat},
                                                  {"double", Scalar::kDouble},
                                                  {"float64", Scalar::kDouble}}};

std::optional<Scalar> scalar_of(std::string_view name) {
  for (const ScalarName& s : kScalars) {
    if (s.name == name) return s.scalar;
  }
  return std::nullopt;
}

struct Property {
  std::string_view name;
  Scalar scalar = Scalar::kFloat;
  std::optional<Scalar> list_count;  ///< type of a list's length
};

struct PlyElement {
  std::string_view name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

class PlyChecker {
 public:
  PlyChecker(std::string_view content, const std::string& where)
      : content_(content), scanner_(content), where_(where) {}

  Result<CheckedMesh> check() {
    SL_RETURN_IF_ERROR(read_header());
    SL_RETURN_IF_ERROR(check_header());
    for (const PlyElement& element : elements_) {
      for (uint64_t i = 0; i < element.count; ++i) SL_RETURN_IF_ERROR(check_row(element, i));
    }
    return CheckedMesh{std::nullopt, {}, faces_};
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    std::string where = where_;
    if (!in_binary_) where += fmt::format(":{}", scanner_.line());
    return make_error(ErrorCode::kInvalidInput, where, format, std::forward<Args>(args)...);
  }

  Status read_header() {
    if (scanner_.next() != "ply") return fault("file does not begin with 'ply'");
    scanner_.skip_line();
    for (;;) {
      const std::string_view word = scanner_.next_in_line();
      if (word == "end_header") break;
      if (word == "format") {
        SL_RETURN_IF_ERROR(read_format());
      } else if (word == "element") {
        SL_RETURN_IF_ERROR(read_element());
      } else if (word == "property") {
        SL_RETURN_IF_ERROR(read_property());
      } else if (word != "comment" && word != "obj_info") {
        return fault("'{}' is no PLY header line", printable(word));
      }
      scanner_.skip_line();
      if (scanner_.at_end()) return fault("header without 'end_header'");
    }
    scanner_.skip_line();
    at_ = scanner_.offset();
    in_binary_ = binary_;
    return {};
  }

  Status read_format() {
    const std::string_view format = scanner_.next_in_line();
    binary_ = format != "ascii";
    big_endian_ = format == "binary_big_endian";
    if (binary_ && !big_endian_ && format != "binary_little_endian") {
      return fault("'{}' is no PLY format", printable(format));
    }
    has_format_ = true;
    return {};
  }

  Status read_element() {
    PlyElement element;
    element.name = scanner_.next_in_line();
    const auto count = parse_unsigned(scanner_.next_in_line());
    if (!count || *count > content_.size()) {
      return fault("the number of elements '{}' is missing or more than the file can hold",
                   printable(element.name));
    }
    element.count = *count;
    elements_.push_back(element);
    return {};
  }

  Status read_property() {
    if (elements_.empty()) return fault("property before any element");
    Property property;
    std::string_view type = scanner_.next_in_line();
    if (type == "list") {
      property.list_count = scalar_of(scanner_.next_in_line());
      if (!property.list_count) return fault("unknown type of a list's length");
      type = scanner_.next_in_line();
    }
    const auto scalar = scalar_of(type);
    if (!scalar) return fault("unknown property type '{}'", printable(type));
    property.scalar = *scalar;
    property.name = scanner_.next_in_line();
    elements_.back().properties.push_back(property);
    return {};
  }

  const PlyElement* find(std::string_view name) const {
    const auto found = std::find_if(elements_.begin(), elements_.end(),
                                    [&](const PlyElement& e) { return e.name == name; });
    return found == elements_.end() ? nullptr : &*found;
  }

  static bool is_index_list(const Property& p) {
    return p.list_count && (p.name == "vertex_indices" || p.name == "vertex_index");
  }

  Status check_header() {
    if (!has_format_) return fault("header without 'format'");
    for (size_t i = 0; i < elements_.size(); ++i) {
      if (elements_[i].properties.empty() || find(elements_[i].name) != &elements_[i]) {
        return fault("element '{}' is empty or there twice", printable(elements_[i].name));
      }
    }
    const PlyElement* vertex = find("vertex");
    const PlyElement* face = find("face");
    if (vertex == nullptr || face == nullptr)
      return fault("there must be elements vertex and face");
    for (std::string_view axis : {"x", "y", "z"}) {
      const auto count =
          std::count_if(vertex->properties.begin(), vertex->properties.end(),
                        [&](const Property& p) { return p.name == axis && !p.list_count; });
      if (count != 1) return fault("element vertex needs one property {}", axis);
    }
    if (std::count_if(face->properties.begin(), face->properties.end(), is_index_list) != 1) {
      return fault("element face needs one list vertex_indices");
    }
    vertices_ = vertex->count;
    faces_ = static_cast<size_t>(face->count);
    return {};
  }

  Status check_row(const PlyElement& element, uint64_t row) {
    for (const Property& property : element.properties) {
      if (property.list_count) {
        SL_RETURN_IF_ERROR(check_list(element, property, row));
      } else {
        SL_ASSIGN(const double value, read(property.scalar, element, row));
        if (element.name == "vertex" && !std::isfinite(static_cast<float>(value))) {
          return fault("vertex {}: {} is not finite", row, printable(property.name));
        }
      }
    }
    if (!binary_) {
      if (!scanner_.next_in_line().empty()) {
        return fault("{} {} has more values than properties", printable(element.name), row);
      }
      scanner_.skip_line();
    }
    return {};
  }

  Status check_list(const PlyElement& element, const Property& property, uint64_t row) {
    const bool indices = element.name == "face" && is_index_list(property);
    SL_ASSIGN(const double count, read(*property.list_count, element, row));
    if (!(count >= 0 && count <= static_cast<double>(content_.size()))) {
      return fault("{} {}: list of {} values", printable(element.name), row, count);
    }
    if (indices && (count < 3 || count > static_cast<double>(kMaxCorners))) {
      return fault("face {}: {} corners, allowed are 3 to {}", row, count, kMaxCorners);
    }
    for (double i = 0; i < count; ++i) {
      SL_ASSIGN(const double value, read(property.scalar, element, row));
      const bool in_range = value >= 0 && value < static_cast<double>(vertices_);
      if (indices && (!in_range || value != std::floor(value))) {
        return fault("face {}: vertex index {} of {}", row, value, vertices_);
      }
    }
    return {};
  }

  Result<double> read(Scalar scalar, const PlyElement& element, uint64_t row) {
    if (binary_) return read_binary(scalar, element, row);
    const std::string_view word = scanner_.next_in_line();
    const auto value = parse_number(word);
    if (!value) {
      return fault("{} {}: '{}' is not a number", printable(element.name), row, printable(word));
    }
    return *value;
  }

  Result<double> read_binary(Scalar scalar, const PlyElement& element, uint64_t row) {
    switch (scalar) {
      case Scalar::kInt8:
        return take<int8_t>(element, row);
      case Scalar::kUint8:
        return take<uint8_t>(element, row);
      case Scalar::kInt16:
        return take<int16_t>(element, row);
      case Scalar::kUint16:
        return take<uint16_t>(element, row);
      case Scalar::kInt32:
        return take<int32_t>(element, row);
      case Scalar::kUint32:
        return take<uint32_t>(element, row);
      case Scalar::kFloat:
        return take<float>(element, row);
      case Scalar::kDouble:
        break;
    }
    return take<double>(element, row);
  }

  template <typename T>
  Result<double> take(const PlyElement& element, uint64_t row) {
    std::array<char, sizeof(T)> bytes;
    if (content_.size() - at_ < sizeof(T)) {
      return fault("file ends within {} {} of {}", printable(element.name), row, element.count);
    }
    std::memcpy(bytes.data(), content_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    if (big_endian_ != (std::endian::native == std::endian::big)) {
      std::reverse(bytes.begin(), bytes.end());
    }
    return static_cast<double>(std::bit_cast<T>(bytes));
  }

  std::string_view content_;
  TextScanner scanner_;
  const std::string& where_;
  size_t at_ = 0;
  bool has_format_ = false;
  bool binary_ = false;
  bool big_endian_ = false;
  bool in_binary_ = false;
  uint64_t vertices_ = 0;
  size_t faces_ = 0;
  std::vector<PlyElement> elements_;
};

}  // namespace

Result<CheckedMesh> check_ply(std::string_view content, const std::string& where) {
  return PlyChecker(content, where).check();
}

}  // namespace sightline::geometry
