// SPDX-License-Identifier: Apache-2.0
#include "calibrate/toml_numbers.hpp"

#include <cmath>

namespace sightline::calibrate {

std::string place(const std::string& file, const toml::source_region& region) {
  return fmt::format("{}:{}:{}", file, region.begin.line, region.begin.column);
}

const char* kind_of(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::string:
      return "text";
    case toml::node_type::integer:
      return "a whole number";
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "true or false";
    case toml::node_type::array:
      return "a list";
    case toml::node_type::table:
      return "a table";
    default:
      return "a date or time";
  }
}

Result<double> number_of(const toml::node& node, const char* key, const std::string& file) {
  double value = 0;
  if (const auto* whole = node.as_integer()) {
    value = static_cast<double>(whole->get());
  } else if (const auto* real = node.as_floating_point()) {
    value = real->get();
  } else {
    return make_error(ErrorCode::kInvalidInput, place(file, node.source()),
                      "'{}' must hold numbers, here is {}", key, kind_of(node));
  }
  if (std::isfinite(value)) return value;
  return make_error(ErrorCode::kInvalidInput, place(file, node.source()), "'{}' is not finite",
                    key);
}

Result<std::vector<double>> numbers_of(const toml::node& node, const char* key,
                                       const std::string& file) {
  const toml::array* list = node.as_array();
  if (list == nullptr) {
    return make_error(ErrorCode::kInvalidInput, place(file, node.source()),
                      "'{}' must be a list of numbers, it is {}", key, kind_of(node));
  }
  std::vector<double> out;
  for (const toml::node& element : *list) {
    SL_ASSIGN(const double value, number_of(element, key, file));
    out.push_back(value);
  }
  return out;
}

Result<Rigid3> pose_of(const toml::node& node, const char* key, const std::string& file) {
  const toml::array* rows = node.as_array();
  std::vector<double> all;
  if (rows != nullptr && !rows->empty() && rows->get(0)->is_array()) {
    for (const toml::node& row : *rows) {
      SL_ASSIGN(const std::vector<double> four, numbers_of(row, key, file));
      if (four.size() != 4) {
        return make_error(ErrorCode::kInvalidInput, place(file, row.source()),
                          "a row of '{}' has 4 numbers, this one {}", key, four.size());
      }
      all.insert(all.end(), four.begin(), four.end());
    }
  } else {
    SL_ASSIGN(all, numbers_of(node, key, file));
  }
  if (all.size() != 16) {
    return make_error(ErrorCode::kInvalidInput, place(file, node.source()),
                      "'{}' is 4 rows of 4 numbers, here are {} numbers", key, all.size());
  }
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(all.data());
  return Rigid3::from_matrix(matrix, place(file, node.source()));
}

}  // namespace sightline::calibrate
