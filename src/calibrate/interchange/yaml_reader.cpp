// SPDX-License-Identifier: Apache-2.0
#include "calibrate/interchange/yaml_reader.hpp"

#include <cmath>

namespace sightline::calibrate {
namespace {

constexpr size_t kMaxNumbers = 64;

Status append(const YamlTable& table, const YAML::Node& node, const char* key,
              std::vector<double>& out) {
  if (node.IsSequence()) {
    for (const YAML::Node& each : node) SL_RETURN_IF_ERROR(append(table, each, key, out));
    return {};
  }
  double value = 0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value)) {
    return table.fault("'{}' holds something that is no finite number", key);
  }
  if (out.size() >= kMaxNumbers) return table.fault("'{}' has too many numbers", key);
  out.push_back(value);
  return {};
}

}  // namespace

Result<YAML::Node> parse_yaml(const std::string& text, const std::string& where) try {
  YAML::Node root = YAML::Load(text);
  if (!root.IsMap()) return make_error(ErrorCode::kInvalidInput, where, "is not a table of YAML");
  return root;
} catch (const YAML::Exception& error) {
  return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}", where, error.mark.line + 1),
                    "is no YAML: {}", error.msg);
}

std::string YamlTable::place() const {
  const YAML::Mark mark = node_.Mark();
  return mark.is_null() ? where_ : fmt::format("{}:{}", where_, mark.line + 1);
}

Result<std::vector<double>> YamlTable::numbers(const char* key, size_t count) const {
  if (!has(key)) return fault("has no '{}'", key);
  YAML::Node node = node_[key];
  if (node.IsMap()) node.reset(node["data"]);
  std::vector<double> out;
  if (!node.IsDefined() || !node.IsSequence()) return fault("'{}' is not a list of numbers", key);
  SL_RETURN_IF_ERROR(append(*this, node, key, out));
  if (count == 0 || out.size() == count) return out;
  return fault("'{}' has {} numbers, not {}", key, out.size(), count);
}

Result<std::string> YamlTable::text(const char* key) const {
  if (!has(key) || !node_[key].IsScalar()) return fault("has no text '{}'", key);
  return node_[key].Scalar();
}

Result<int> YamlTable::whole(const char* key) const {
  int value = 0;
  if (!has(key) || !YAML::convert<int>::decode(node_[key], value)) {
    return fault("has no whole number '{}'", key);
  }
  return value;
}

Result<Rigid3> YamlTable::pose(const char* key) const {
  SL_ASSIGN(const std::vector<double> values, numbers(key, 16));
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
  return Rigid3::from_matrix(matrix, place() + ": " + key);
}

}  // namespace sightline::calibrate
