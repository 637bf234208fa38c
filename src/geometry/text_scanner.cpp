// SPDX-License-Identifier: Apache-2.0
#include "geometry/text_scanner.hpp"

#include <charconv>
#include <limits>

namespace sightline::geometry {
namespace {

bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\f' || c == '\v';
}

}  // namespace

std::string_view TextScanner::next() {
  while (at_ < text_.size() && is_space(text_[at_])) {
    if (text_[at_++] == '\n') ++lines_passed_;
  }
  return next_in_line();
}

std::string_view TextScanner::next_in_line() {
  while (at_ < text_.size() && text_[at_] != '\n' && is_space(text_[at_])) ++at_;
  line_ = lines_passed_ + 1;
  const size_t begin = at_;
  while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
  return text_.substr(begin, at_ - begin);
}

void TextScanner::skip_line() {
  at_ = text_.find('\n', at_);
  if (at_ == std::string_view::npos) {
    at_ = text_.size();
    return;
  }
  ++at_;
  ++lines_passed_;
}

std::optional<uint64_t> parse_unsigned(std::string_view word) {
  uint64_t value = 0;
  const char* end = word.data() + word.size();
  const auto [stop, fault] = std::from_chars(word.data(), end, value);
  if (fault != std::errc() || stop != end) return std::nullopt;
  return value;
}

std::optional<double> parse_number(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0;
  const char* end = word.data() + word.size();
  const auto [stop, fault] = std::from_chars(word.data(), end, value);
  if (stop != end || word.empty()) return std::nullopt;
  if (fault == std::errc::result_out_of_range) {
    // Too small reads as zero, too large as infinity, which is refused by name.
    const bool tiny =
        word.find("e-") != std::string_view::npos || word.find("E-") != std::string_view::npos;
    return tiny ? 0.0 : std::numeric_limits<double>::infinity();
  }
  if (fault != std::errc()) return std::nullopt;
  return value;
}

std::string printable(std::string_view word) {
  constexpr size_t kMaxShown = 40;
  std::string out(word.substr(0, kMaxShown));
  for (char& c : out) {
    if (c < 0x20 || c > 0x7e) c = '?';
  }
  if (word.size() > kMaxShown) out += "...";
  return out;
}

}  // namespace sightline::geometry
