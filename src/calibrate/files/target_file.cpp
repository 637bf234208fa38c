// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/target_file.hpp"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calibrate/axes_reader.hpp"
#include "calibrate/calibration_reader.hpp"
#include "calibrate/toml_numbers.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/toml_nesting.hpp"

namespace sightline {
namespace {

using namespace calibrate;

constexpr std::array kKeys = {"name",   "type",  "columns",          "rows",     "square",
                              "marker", "gap",   "dictionary",       "first_id", "inverted",
                              "layout", "fixed", "world_from_target"};
constexpr int kMaxSide = 100;
constexpr double kMaxLength = 100;  // [m]

class TargetReader {
 public:
  TargetReader(const toml::table& table, const std::string& file) : table_(table), file_(file) {}

  Result<CalibrationTarget> read() {
    for (const auto& [key, node] : table_) {
      if (std::find(kKeys.begin(), kKeys.end(), key.str()) == kKeys.end()) {
        return make_error(ErrorCode::kInvalidInput, place(file_, key.source()),
                          "unknown key '{}' of a target", key.str());
      }
    }
    CalibrationTarget t;
    SL_ASSIGN(t.kind, kind());
    const bool tags = t.kind == TargetKind::kTagGrid;
    SL_ASSIGN(t.columns, count("columns", tags ? 1 : 3));
    SL_ASSIGN(t.rows, count("rows", tags ? 1 : 3));
    if (!tags) {
      SL_ASSIGN(t.square, length("square"));
    }
    if (t.kind != TargetKind::kChessboard) {
      SL_ASSIGN(t.marker, length("marker"));
      SL_ASSIGN(t.dictionary, text("dictionary"));
    }
    if (tags) {
      SL_ASSIGN(t.gap, length("gap"));
    }
    if (t.kind == TargetKind::kCharuco && t.marker >= t.square) {
      return fault("marker", "a marker of {} m does not fit into a square of {} m", t.marker,
                   t.square);
    }
    if (table_.contains("first_id")) {
      const auto id = table_["first_id"].value_exact<int64_t>();
      if (!id || *id < 0 || *id > 100'000) return fault("first_id", "must be 0 or more");
      t.first_id = static_cast<int>(*id);
    }
    if (table_.contains("inverted")) {
      const auto inverted = table_["inverted"].value_exact<bool>();
      if (!inverted) return fault("inverted", "must be true or false");
      t.inverted = *inverted;
    }
    if (table_.contains("fixed")) {
      const auto fixed = table_["fixed"].value_exact<bool>();
      if (!fixed) return fault("fixed", "must be true or false");
      t.fixed = *fixed;
    }
    SL_RETURN_IF_ERROR(read_place(t));
    SL_ASSIGN(t.layout, layout());
    if (table_.contains("name")) {
      SL_ASSIGN(t.name, text("name"));
    }
    return t;
  }

 private:
  template <typename... Args>
  Error fault(const char* key, fmt::format_string<Args...> format, Args&&... args) const {
    const toml::node* node = table_.get(key);
    const auto region = node != nullptr ? node->source() : table_.source();
    return make_error(ErrorCode::kInvalidInput, place(file_, region), "'{}': {}", key,
                      fmt::format(format, std::forward<Args>(args)...));
  }

  Status read_place(CalibrationTarget& t) const {
    const toml::node* node = table_.get("world_from_target");
    if (node == nullptr) return {};
    if (!t.fixed) {
      return fault("world_from_target",
                   "its place is known, so it must not be moved: fixed = true");
    }
    SL_ASSIGN(t.world_from_target, pose_of(*node, "world_from_target", file_));
    return {};
  }

  Result<std::string> text(const char* key) const {
    const auto value = table_[key].value_exact<std::string>();
    if (!value || value->empty()) return fault(key, "a text is needed here");
    return *value;
  }

  Result<TargetKind> kind() const {
    SL_ASSIGN(const std::string name, text("type"));
    if (name == "chessboard") return TargetKind::kChessboard;
    if (name == "charuco") return TargetKind::kCharuco;
    if (name == "tag_grid") return TargetKind::kTagGrid;
    return fault("type", "'{}' is not known: chessboard, charuco, tag_grid", name);
  }

  Result<CharucoLayout> layout() const {
    if (!table_.contains("layout")) return CharucoLayout::kAny;
    SL_ASSIGN(const std::string name, text("layout"));
    if (name == "any") return CharucoLayout::kAny;
    if (name == "dark_first") return CharucoLayout::kDarkFirst;
    if (name == "marker_first") return CharucoLayout::kMarkerFirst;
    return fault("layout", "'{}' is not known: any, dark_first, marker_first", name);
  }

  Result<int> count(const char* key, int least) const {
    const auto value = table_[key].value_exact<int64_t>();
    if (!value || *value < least || *value > kMaxSide) {
      return fault(key, "a whole number from {} to {} is needed here", least, kMaxSide);
    }
    return static_cast<int>(*value);
  }

  Result<double> length(const char* key) const {
    const auto value = table_[key].value<double>();
    if (!value || !(*value > 0) || *value > kMaxLength) {
      return fault(key, "a length in meters, more than 0 and at most {}, is needed here",
                   kMaxLength);
    }
    return *value;
  }

  const toml::table& table_;
  const std::string& file_;
};

}  // namespace

Result<CalibrationTarget> parse_target(std::string_view text, const std::string& where) try {
  SL_RETURN_IF_ERROR(check_toml_nesting(text, where));
  const toml::table root = toml::parse(text, where);
  const toml::table* board = root["board"].as_table();
  if (board == nullptr) return TargetReader(root, where).read();
  SL_ASSIGN(CalibrationTarget target, TargetReader(*board, where).read());
  target.name = root["name"].value_or(std::string("board"));
  return target;
} catch (const toml::parse_error& e) {
  return make_error(ErrorCode::kInvalidInput, place(where, e.source()), "{}", e.description());
} catch (const std::exception& e) {
  return make_error(ErrorCode::kInvalidInput, where, "cannot parse: {}", e.what());
}

Result<CalibrationTarget> read_target(const std::filesystem::path& path) {
  SL_ASSIGN(const std::string text, read_file(path, size_t{1} << 20));
  return parse_target(text, path.string());
}

std::string format_target(const CalibrationTarget& t) {
  constexpr std::array kKinds = {"chessboard", "charuco", "tag_grid"};
  constexpr std::array kLayouts = {"any", "dark_first", "marker_first"};
  std::string text = fmt::format(
      "# calibration target; lengths in meters\nname = \"{}\"\ntype = \"{}\"\ncolumns = {}\n"
      "rows = {}\n",
      t.name, kKinds[static_cast<size_t>(t.kind)], t.columns, t.rows);
  if (t.kind != TargetKind::kTagGrid) text += fmt::format("square = {}\n", t.square);
  if (t.kind != TargetKind::kChessboard) {
    text += fmt::format("marker = {}\ndictionary = \"{}\"\n", t.marker, t.dictionary);
  }
  if (t.kind == TargetKind::kTagGrid) {
    text += fmt::format("gap = {}\nfirst_id = {}\n", t.gap, t.first_id);
  }
  if (t.kind == TargetKind::kCharuco) {
    text += fmt::format("inverted = {}\nlayout = \"{}\"\n", t.inverted,
                        kLayouts[static_cast<size_t>(t.layout)]);
  }
  if (t.fixed) text += "fixed = true\n";
  // On one line: corners.csv has it line by line.
  if (t.world_from_target) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> m = t.world_from_target->matrix();
    text += fmt::format("world_from_target = {}\n", list_text(m.data(), 16));
  }
  return text;
}

}  // namespace sightline
