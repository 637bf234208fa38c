// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/toml_nesting.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace sightline {
namespace {

// Reads just enough TOML to know what is inside quotes and comments. Where the text is malformed
// the parser stops at that place, whatever is counted behind it.
class NestingScanner {
 public:
  explicit NestingScanner(std::string_view text) : text_(text) {}

  // Position where the limit is exceeded, or npos.
  size_t find_excess() {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '"' || c == '\'') {
        skip_string(c);
        continue;
      }
      if (c == '#') {
        at_ = std::min(text_.find('\n', at_), text_.size());
        continue;
      }
      if (!count(c)) return at_;
      ++at_;
    }
    return std::string_view::npos;
  }

 private:
  bool count(char c) {
    switch (c) {
      case '[':
      case '{':
        names_ = 1;
        return ++brackets_ <= kMaxTomlNesting;
      case ']':
      case '}':
        if (brackets_ > 0) --brackets_;
        names_ = 1;
        return true;
      case '.':
        return ++names_ <= kMaxTomlNesting;
      case '=':
      case ',':
      case '\n':
        names_ = 1;
        return true;
      default:
        return true;
    }
  }

  void skip_string(char quote) {
    const std::string_view triple = quote == '"' ? "\"\"\"" : "'''";
    const bool multiline = text_.substr(at_).starts_with(triple);
    at_ += multiline ? 3 : 1;
    for (; at_ < text_.size(); ++at_) {
      if (text_[at_] == '\\' && quote == '"') {
        ++at_;
      } else if (multiline ? text_.substr(at_).starts_with(triple) : text_[at_] == quote) {
        at_ += multiline ? 3 : 1;
        // Up to two quotes may stand before the three that close.
        for (int extra = 0; multiline && extra < 2 && at_ < text_.size() && text_[at_] == quote;) {
          ++at_, ++extra;
        }
        return;
      } else if (!multiline && text_[at_] == '\n') {
        return;
      }
    }
  }

  std::string_view text_;
  size_t at_ = 0;
  size_t brackets_ = 0;
  size_t names_ = 1;
};

}  // namespace

Status check_toml_nesting(std::string_view text, const std::string& where) {
  const size_t at = NestingScanner(text).find_excess();
  if (at == std::string_view::npos) return {};
  const std::string_view before = text.substr(0, at);
  const auto line = std::count(before.begin(), before.end(), '\n') + 1;
  const size_t start = before.rfind('\n') + 1;  // npos + 1 is 0
  return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}:{}", where, line, at - start + 1),
                    "nested more than {} levels deep, refused", kMaxTomlNesting);
}

}  // namespace sightline
