// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "capture/network/network_url.hpp"
#include "sightline/capture/network/network_source.hpp"

/// Whatever is given as an address: it is taken apart or refused, and neither the password nor what
/// stands between scheme and @ comes out in a message.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string url(reinterpret_cast<const char*>(data), size);
  const auto parsed = sightline::capture::parse_network_url(url, "camera");
  const std::string shown = sightline::url_for_messages(url);
  if (sightline::check_network_url(url).has_value() != parsed.has_value()) std::abort();
  if (!parsed) {
    if (shown != "(no address)") std::abort();
    return 0;
  }
  if (parsed->shown != shown) std::abort();
  const size_t authority = shown.find("://") + 3;
  const size_t authority_end = std::min(shown.find_first_of("/?#", authority), shown.size());
  if (shown.substr(authority, authority_end - authority).find('@') != std::string::npos)
    std::abort();
  // What is opened is an address again, without a person in it.
  const auto again = sightline::capture::parse_network_url(parsed->location, "camera");
  if (!again || !again->user.empty() || !again->password.empty()) std::abort();
  if (again->location != parsed->location || again->shown != parsed->shown) std::abort();
  return 0;
}
