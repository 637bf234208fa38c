// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline::calibrate {

/// A YAML file (yaml-cpp bounds its depth); errors name file and line.
Result<YAML::Node> parse_yaml(const std::string& text, const std::string& where);

/// Reads entries of one table of a YAML file.
class YamlTable {
 public:
  YamlTable(YAML::Node node, std::string where)
      : node_(std::move(node)), where_(std::move(where)) {}

  bool has(const char* key) const { return node_.IsMap() && node_[key].IsDefined(); }
  /// Numbers of a list, flat or of rows, or of a matrix table with `data`; `count` 0: any.
  Result<std::vector<double>> numbers(const char* key, size_t count) const;
  Result<std::string> text(const char* key) const;
  Result<int> whole(const char* key) const;
  /// 4x4, row by row.
  Result<Rigid3> pose(const char* key) const;

  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, place(), format, std::forward<Args>(args)...);
  }

 private:
  std::string place() const;

  YAML::Node node_;
  std::string where_;
};

}  // namespace sightline::calibrate
