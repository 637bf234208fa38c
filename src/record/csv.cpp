// SPDX-License-Identifier: Apache-2.0
#include "csv.hpp"

namespace sightline {

std::optional<CsvLines::Line> CsvLines::next() {
  if (rest_.empty()) return std::nullopt;
  const size_t end = rest_.find('\n');
  Line line{rest_.substr(0, end), ++number_, end != std::string_view::npos};
  rest_.remove_prefix(line.ended ? end + 1 : rest_.size());
  if (line.text.ends_with('\r')) line.text.remove_suffix(1);
  return line;
}

void split_fields(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  for (;;) {
    const size_t comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

std::string line_of(const std::string& where, size_t number) {
  return fmt::format("{}:{}", where, number);
}

Result<Time> parse_time(std::string_view field, const char* column, const std::string& where,
                        size_t line) {
  SL_ASSIGN(const int64_t ns, parse_whole<int64_t>(field, column, where, line, 0, kMaxTimeNs));
  return time_from_ns(ns);
}

Result<double> parse_finite(std::string_view field, const char* column, const std::string& where,
                            size_t line) {
  double value = 0;
  const char* end = field.data() + field.size();
  const auto [stop, fault] = std::from_chars(field.data(), end, value);
  if (field.empty() || fault != std::errc() || stop != end || !std::isfinite(value)) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                      "column {} is '{}', expected a finite number", column, field.substr(0, 40));
  }
  return value;
}

Status check_header(const std::optional<CsvLines::Line>& line, std::string_view header,
                    const std::string& where) {
  if (line && line->text == header) return {};
  return make_error(ErrorCode::kInvalidInput, line_of(where, 1),
                    "first line is '{}', expected '{}'", line ? line->text.substr(0, 100) : "",
                    header);
}

Status check_field_count(size_t found, size_t expected, std::string_view header,
                         const std::string& where, size_t line) {
  if (found == expected) return {};
  return make_error(ErrorCode::kInvalidInput, line_of(where, line), "{} columns, expected {}: {}",
                    found, expected, header);
}

}  // namespace sightline
