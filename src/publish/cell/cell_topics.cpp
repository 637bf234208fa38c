// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/cell_options.hpp"

#include <algorithm>

namespace sightline {

// Names of objects may hold what separates levels, or stands for several.
std::string topic_level(std::string name) {
  for (char& c : name) {
    if (c == '/' || c == '+' || c == '#') c = '_';
  }
  return name;
}

bool is_page_address(std::string_view text) {
  constexpr size_t kLongest = 256;
  const size_t scheme = text.starts_with("https://") ? 8 : text.starts_with("http://") ? 7 : 0;
  return scheme > 0 && text.size() > scheme && text.size() <= kLongest &&
         std::ranges::all_of(text, [](char c) {
           return c > ' ' && c < 0x7f && c != '"' && c != '\'' && c != '<' && c != '>' && c != '\\';
         });
}

}  // namespace sightline
