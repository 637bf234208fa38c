// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"

namespace sightline {

/// Lines of a CSV file without quoting, as this project writes them.
class CsvLines {
 public:
  /// NULs at the end are ignored: file systems leave them after a power cut.
  explicit CsvLines(std::string_view text)
      : rest_(text.substr(0, text.find_last_not_of('\0') + 1)) {}

  struct Line {
    std::string_view text;  ///< without line end
    size_t number = 0;      ///< from 1
    bool ended = false;     ///< false: the file stops inside this line
  };
  std::optional<Line> next();

 private:
  std::string_view rest_;
  size_t number_ = 0;
};

/// Splits at commas, into `fields` (which is emptied first).
void split_fields(std::string_view line, std::vector<std::string_view>& fields);

/// "FILE:LINE", for errors.
std::string line_of(const std::string& where, size_t number);

/// Latest time a file may hold [ns]: 126 years; sums and differences of such times do not overflow.
inline constexpr int64_t kMaxTimeNs = 4'000'000'000'000'000'000;

/// One field as a whole number in [minimum, maximum].
template <std::integral T>
Result<T> parse_whole(std::string_view field, const char* column, const std::string& where,
                      size_t line, T minimum, T maximum = std::numeric_limits<T>::max()) {
  T value{};
  const char* end = field.data() + field.size();
  const auto [stop, fault] = std::from_chars(field.data(), end, value);
  if (field.empty() || fault != std::errc() || stop != end || value < minimum || value > maximum) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                      "column {} is '{}', expected a whole number from {} to {}", column,
                      field.substr(0, 40), minimum, maximum);
  }
  return value;
}

/// One field as a time in nanoseconds.
Result<Time> parse_time(std::string_view field, const char* column, const std::string& where,
                        size_t line);

/// One field as a finite number.
Result<double> parse_finite(std::string_view field, const char* column, const std::string& where,
                            size_t line);

/// Refuses a first line other than `header`.
Status check_header(const std::optional<CsvLines::Line>& line, std::string_view header,
                    const std::string& where);

/// Refuses a row with another number of fields than the header has.
Status check_field_count(size_t found, size_t expected, std::string_view header,
                         const std::string& where, size_t line);

}  // namespace sightline
