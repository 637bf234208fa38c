// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace sightline::geometry {

/// Words of a text between white space, with the line each stands in.
class TextScanner {
 public:
  explicit TextScanner(std::string_view text) : text_(text) {}

  /// The next word; empty at the end.
  std::string_view next();
  /// The next word of this line; empty at its end.
  std::string_view next_in_line();
  /// Goes behind the end of this line.
  void skip_line();
  bool at_end() const { return at_ >= text_.size(); }
  /// Line of the word returned last, from 1.
  size_t line() const { return line_; }
  size_t offset() const { return at_; }

 private:
  std::string_view text_;
  size_t at_ = 0;
  size_t line_ = 1;
  size_t lines_passed_ = 0;
};

/// Whole numbers without sign, and numbers with or without fraction and exponent (also "nan" and
/// "inf", for the caller to refuse by name). Empty where the word is anything else.
std::optional<uint64_t> parse_unsigned(std::string_view word);
std::optional<double> parse_number(std::string_view word);

/// The start of a word with unprintable bytes replaced, fit for an error text.
std::string printable(std::string_view word);

}  // namespace sightline::geometry
