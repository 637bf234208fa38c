// SPDX-License-Identifier: Apache-2.0
#include "config/names.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <string>

namespace sightline::config {
namespace {

constexpr size_t kLongestName = 64;

bool is_letter_or_digit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

}  // namespace

std::string_view camera_name_fault(std::string_view name) {
  if (name.empty() || name.size() > kLongestName) return "a camera's name has 1 to 64 characters";
  const bool good =
      is_letter_or_digit(name[0]) && std::all_of(name.begin(), name.end(), [](char c) {
        return is_letter_or_digit(c) || c == '-' || c == '_' || c == '.';
      });
  if (!good)
    return "a camera's name is made of letters, digits, '-', '_' and '.', and starts with "
           "a letter or digit";
  return {};
}

std::string_view object_name_fault(std::string_view name) {
  if (name.empty() || name.size() > kLongestName) return "an object's name has 1 to 64 bytes";
  const bool good = std::all_of(name.begin(), name.end(), [](char c) {
    return static_cast<unsigned char>(c) >= 0x20 && c != 0x7f && c != ',' && c != '"' && c != '\'';
  });
  if (!good) return "an object's name has no commas, quotes or control characters";
  return {};
}

std::optional<double> meters_per_unit(std::string_view unit) {
  if (unit == "m") return 1.0;
  if (unit == "cm") return 0.01;
  if (unit == "mm") return 0.001;
  if (unit == "in") return 0.0254;
  return std::nullopt;
}

std::filesystem::path resolve(const std::filesystem::path& file, const std::string& name) {
  return (file.parent_path() / name).lexically_normal();
}

bool is_numeric_address(const std::string& address) {
  in6_addr buffer{};
  return inet_pton(AF_INET, address.c_str(), &buffer) == 1 ||
         inet_pton(AF_INET6, address.c_str(), &buffer) == 1;
}

bool is_loopback_address(const std::string& address) {
  return is_numeric_address(address) && (address == "::1" || address.starts_with("127."));
}

}  // namespace sightline::config
