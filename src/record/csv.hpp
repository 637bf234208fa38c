// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::record {

/// Lines of a CSV file without quoting, as this project writes them. NULs at the end are ignored:
/// file systems leave them after a power cut.
class CsvLines {
 public:
  /// `text` must live longer.
  CsvLines(std::string_view text, std::string where)
      : where_(std::move(where)), rest_(text.substr(0, text.find_last_not_of('\0') + 1)) {}
  /// A regular file of any length, read a piece at a time.
  static Result<CsvLines> open(const std::filesystem::path& path);

  struct Line {
    std::string_view text;  ///< without line end; valid until the next call
    size_t number = 0;      ///< from 1
    bool ended = false;     ///< false: the file stops inside this line
  };
  /// Empty at the end. Fails where the file cannot be read, or has a line or a stretch of zeros
  /// that no recording has.
  Result<std::optional<Line>> next();

  /// Name of the file, for errors.
  const std::string& where() const { return where_; }

 private:
  /// Appends the next piece of the file to what is left of the buffer.
  Status fill();
  Error too_long() const;

  std::string where_;
  UniqueFd file_;             ///< closed: everything is in rest_
  std::vector<char> buffer_;  ///< stays in place when this moves, unlike a short string
  size_t zeros_ = 0;          ///< read, and left out unless more than zeros follows
  std::string_view rest_;     ///< into buffer_, or the text
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

/// Takes the first line and refuses any other than `header`.
Status check_header(CsvLines& lines, std::string_view header);

/// Refuses a row with another number of fields than the header has.
Status check_field_count(size_t found, size_t expected, std::string_view header,
                         const std::string& where, size_t line);

/// One field as a camera of the recording: its place in `cameras`.
Result<size_t> parse_camera(std::string_view field, std::span<const std::string> cameras,
                            const std::string& where, size_t line);

}  // namespace sightline::record
