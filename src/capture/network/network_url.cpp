// SPDX-License-Identifier: Apache-2.0
#include "capture/network/network_url.hpp"

#include <algorithm>
#include <array>
#include <charconv>

#include "sightline/capture/network/network_source.hpp"

namespace sightline::capture {
namespace {

constexpr std::array<std::string_view, 4> kSchemes{"rtsp", "rtsps", "http", "https"};

bool has_control_or_space(std::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) <= ' ' || c == 0x7f; });
}

// "%41" to "A"; anything else as it stands.
std::string percent_decoded(std::string_view text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    unsigned value = 0;
    if (text[i] == '%' && i + 2 < text.size()) {
      const char* end = text.data() + i + 3;
      if (std::from_chars(text.data() + i + 1, end, value, 16).ptr == end) {
        out += static_cast<char>(value);
        i += 2;
        continue;
      }
    }
    out += text[i];
  }
  return out;
}

}  // namespace

Result<NetworkUrl> parse_network_url(const std::string& url, const std::string& where) {
  const auto refuse = [&](std::string_view why) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "{}; expected rtsp://HOST[:PORT]/PATH or http://HOST[:PORT]/PATH", why);
  };
  const size_t scheme_end = url.find("://");
  NetworkUrl parsed;
  if (scheme_end != std::string::npos) parsed.scheme = url.substr(0, scheme_end);
  if (std::find(kSchemes.begin(), kSchemes.end(), parsed.scheme) == kSchemes.end()) {
    return refuse("no address of a network camera");
  }
  if (has_control_or_space(url)) return refuse("an address has no spaces (write %20)");
  const std::string_view rest = std::string_view(url).substr(scheme_end + 3);
  const size_t authority_end = std::min(rest.find_first_of("/?#"), rest.size());
  std::string_view authority = rest.substr(0, authority_end);
  const std::string_view path = rest.substr(authority_end);
  if (const size_t at = authority.rfind('@'); at != std::string_view::npos) {
    const std::string_view person = authority.substr(0, at);
    const size_t colon = std::min(person.find(':'), person.size());
    parsed.user = percent_decoded(person.substr(0, colon));
    if (colon < person.size()) parsed.password = percent_decoded(person.substr(colon + 1));
    authority.remove_prefix(at + 1);
  }
  if (authority.empty() || authority.front() == ':') return refuse("the address names no host");
  const std::string front = parsed.scheme + "://" + std::string(authority);
  parsed.location = front + std::string(path);
  const size_t query = path.find_first_of("?#");
  parsed.shown = front + std::string(path.substr(0, query));
  if (query != std::string_view::npos) parsed.shown += "?...";
  return parsed;
}

}  // namespace sightline::capture

namespace sightline {

using namespace capture;

Status check_network_url(const std::string& url) {
  SL_RETURN_IF_ERROR(parse_network_url(url, ""));
  return {};
}

std::string url_for_messages(const std::string& url) {
  const auto parsed = parse_network_url(url, "");
  return parsed ? parsed->shown : "(no address)";
}

}  // namespace sightline
