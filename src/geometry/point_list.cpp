// SPDX-License-Identifier: Apache-2.0
#include "sightline/geometry/point_list.hpp"

#include <cmath>

#include "geometry/text_scanner.hpp"
#include "sightline/base/files.hpp"

namespace sightline {

using namespace geometry;

namespace {

constexpr size_t kMaxPoints = 10'000'000;

// The comment cut off, and every separator a blank.
std::string plain_words(std::string_view line) {
  std::string out(line.substr(0, line.find('#')));
  for (char& c : out) {
    if (c == ',' || c == ';') c = ' ';
  }
  return out;
}

Error fault(const std::string& where, size_t line, std::string text) {
  return Error{ErrorCode::kInvalidInput, std::move(text), fmt::format("{}:{}", where, line)};
}

// False: nothing stands in the line.
Result<bool> parse_line(const std::string& words, const std::string& where, size_t line,
                        Eigen::Vector3d& point) {
  TextScanner scanner(words);
  int count = 0;
  for (std::string_view word = scanner.next(); !word.empty(); word = scanner.next(), ++count) {
    const auto number = parse_number(word);
    if (!number) {
      return fault(where, line,
                   fmt::format("'{}' is not a number; a point is three numbers, and a heading must "
                               "start with #",
                               printable(word)));
    }
    if (!std::isfinite(*number)) return fault(where, line, "a coordinate is not finite");
    if (count < 3) point(count) = *number;
  }
  if (count == 0) return false;
  if (count != 3) {
    return fault(where, line, fmt::format("{} numbers where a point has 3 (x y z)", count));
  }
  return true;
}

}  // namespace

Result<PointList> parse_points(std::string_view text, const std::string& where,
                               double meters_per_unit) {
  PointList list;
  size_t line = 0;
  while (!text.empty()) {
    ++line;
    const size_t end = text.find('\n');
    const std::string words = plain_words(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    Eigen::Vector3d point;
    SL_ASSIGN(const bool found, parse_line(words, where, line, point));
    if (!found) continue;
    if (list.points.size() == kMaxPoints) {
      return fault(where, line, fmt::format("more than {} points", kMaxPoints));
    }
    list.points.emplace_back(point * meters_per_unit);
    list.lines.push_back(line);
  }
  if (!list.points.empty()) return list;
  return make_error(ErrorCode::kInvalidInput, where,
                    "holds no points; one line each, three numbers x y z");
}

Result<PointList> read_points(const std::filesystem::path& path, double meters_per_unit) {
  SL_ASSIGN(const std::string text, read_file(path));
  return parse_points(text, path.string(), meters_per_unit);
}

}  // namespace sightline
