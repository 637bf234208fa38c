// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>
#include <string>

#include "render/gpu/egl_device.hpp"

namespace sightline {

bool has_extension(const char* list, std::string_view name) {
  if (list == nullptr || name.empty()) return false;
  std::string_view rest = list;
  while (!rest.empty()) {
    const size_t end = std::min(rest.find(' '), rest.size());
    if (rest.substr(0, end) == name) return true;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return false;
}

bool is_software_renderer(std::string_view renderer) {
  std::string lower(renderer);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
  constexpr std::array<std::string_view, 5> kNames = {"llvmpipe", "softpipe", "swrast",
                                                      "swiftshader", "software"};
  return std::ranges::any_of(
      kNames, [&](std::string_view name) { return lower.find(name) != std::string::npos; });
}

}  // namespace sightline
