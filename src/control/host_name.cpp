// SPDX-License-Identifier: Apache-2.0
#include "control/host_name.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <string>

namespace sightline::control {
namespace {

// What follows the name: nothing, or ":" and a port.
bool is_port(std::string_view text) {
  if (text.empty()) return true;
  if (text.front() != ':' || text.size() < 2) return false;
  text.remove_prefix(1);
  uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc() && end == text.data() + text.size();
}

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool same_name(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](char x, char y) { return lower(x) == lower(y); });
}

bool is_localhost(std::string_view name) { return same_name(name, "localhost"); }

bool is_own_name(std::string_view name) {
  char own[256] = {};
  if (::gethostname(own, sizeof own - 1) != 0 || own[0] == '\0') return false;
  return same_name(name, own) || same_name(name, std::string(own) + ".local");
}

// inet_pton() takes four decimal numbers and nothing else, unlike inet_aton().
bool is_v4_loopback(std::string_view name) {
  in_addr address{};
  return inet_pton(AF_INET, std::string(name).c_str(), &address) == 1 &&
         ntohl(address.s_addr) >> 24 == 127;
}

bool is_v6_loopback(std::string_view name) {
  in6_addr address{};
  return inet_pton(AF_INET6, std::string(name).c_str(), &address) == 1 &&
         std::memcmp(&address, &in6addr_loopback, sizeof address) == 0;
}

}  // namespace

bool names_loopback(std::string_view host) {
  if (host.find('\0') != std::string_view::npos) return false;  // nothing hides behind the end
  if (host.starts_with('[')) {
    const size_t end = host.find(']');
    return end != std::string_view::npos && is_v6_loopback(host.substr(1, end - 1)) &&
           is_port(host.substr(end + 1));
  }
  const std::string_view name = host.substr(0, host.find(':'));
  return (is_localhost(name) || is_v4_loopback(name)) && is_port(host.substr(name.size()));
}

bool names_this(std::string_view host, const std::vector<std::string>& names) {
  if (host.find('\0') != std::string_view::npos) return false;
  if (host.starts_with('[')) {
    const size_t end = host.find(']');
    in6_addr address{};
    return end != std::string_view::npos && is_port(host.substr(end + 1)) &&
           inet_pton(AF_INET6, std::string(host.substr(1, end - 1)).c_str(), &address) == 1;
  }
  const std::string_view name = host.substr(0, host.find(':'));
  if (!is_port(host.substr(name.size()))) return false;
  in_addr address{};
  return inet_pton(AF_INET, std::string(name).c_str(), &address) == 1 || is_own_name(name) ||
         std::ranges::any_of(names, [&](const std::string& one) { return same_name(one, name); });
}

}  // namespace sightline::control
