// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/axes/axis_source.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "capture/axes/axis_sources.hpp"

namespace sightline {
namespace {

constexpr uint16_t kViscaPort = 52381, kOnvifPort = 80;

std::optional<int> whole(std::string_view text, int least, int most) {
  int value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, fault] = std::from_chars(text.data(), end, value);
  if (text.empty() || fault != std::errc() || stop != end || value < least || value > most) {
    return std::nullopt;
  }
  return value;
}

// A name would have to be looked up, which may take as long as it likes.
bool is_address(const std::string& host) {
  std::array<uint8_t, sizeof(in6_addr)> bytes{};
  return inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

// "HOST:PORT", "HOST" or (`bare_port`) "PORT"; an IPv6 address stands in brackets.
bool read_address(std::string_view text, bool bare_port, AxisSourceOptions& out) {
  const size_t bracket = text.starts_with('[') ? text.find(']') : 0;
  if (bracket == std::string_view::npos) return false;
  const size_t colon = text.find(':', bracket);
  std::string_view host = text.substr(0, colon);
  std::string_view port = colon == std::string_view::npos ? "" : text.substr(colon + 1);
  if (bare_port && colon == std::string_view::npos) std::swap(host, port);
  if (bracket > 0) host = text.substr(1, bracket - 1);
  if (colon != std::string_view::npos && host.empty()) return false;
  out.host = host;
  if (!host.empty() && !is_address(out.host)) return false;
  if (port.empty()) return !bare_port && !host.empty() && colon == std::string_view::npos;
  const auto number = whole(port, 1, 65535);
  out.port = static_cast<uint16_t>(number.value_or(0));
  return number.has_value();
}

// "[ADDRESS:]PORT[/ID]"
bool read_listener(std::string_view rest, int most, AxisSourceOptions& out) {
  if (const size_t slash = rest.find('/'); slash != std::string_view::npos) {
    const auto device = whole(rest.substr(slash + 1), 0, most);
    if (!device) return false;
    out.device = *device;
    rest = rest.substr(0, slash);
  }
  return read_address(rest, true, out);
}

// "ADDRESS[:PORT][/PROFILE]"
bool read_onvif(std::string_view rest, AxisSourceOptions& out) {
  if (const size_t slash = rest.find('/'); slash != std::string_view::npos) {
    out.profile = rest.substr(slash + 1);
    const bool good = std::ranges::all_of(out.profile, [](unsigned char c) {
      return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.';
    });
    if (out.profile.empty() || out.profile.size() > 64 || !good) return false;
    rest = rest.substr(0, slash);
  }
  out.port = kOnvifPort;
  return read_address(rest, false, out);
}

bool read_source(std::string_view text, AxisSourceOptions& out) {
  const auto takes = [&text](std::string_view scheme) {
    if (!text.starts_with(scheme)) return false;
    text.remove_prefix(scheme.size());
    return true;
  };
  if (takes("freed:")) {
    out.protocol = AxisProtocol::kFreed;
    return read_listener(text, 255, out);
  }
  if (takes("opentrackio:")) {
    out.protocol = AxisProtocol::kOpenTrackIo;
    return read_listener(text, 999999, out);
  }
  if (takes("onvif:")) {
    out.protocol = AxisProtocol::kOnvif;
    return read_onvif(text, out);
  }
  if (!takes("visca:")) return false;
  out.protocol = AxisProtocol::kVisca;
  out.port = kViscaPort;
  return read_address(text, false, out);
}

}  // namespace

Result<AxisSourceOptions> parse_axis_source(std::string_view text, const std::string& where) {
  AxisSourceOptions out;
  if (read_source(text, out)) return out;
  return make_error(ErrorCode::kInvalidInput, where,
                    "'{}' tells no angles: write \"freed:PORT\" or \"opentrackio:PORT\" (with an "
                    "own ADDRESS: before the port, and \"/ID\" behind to take one camera's only), "
                    "\"visca:ADDRESS[:PORT]\" or \"onvif:ADDRESS[:PORT][/PROFILE]\"; addresses are "
                    "numbers",
                    text.substr(0, 80));
}

Result<std::unique_ptr<AxisSource>> open_axis_source(const AxisSourceOptions& options,
                                                     const std::string& name) {
  switch (options.protocol) {
    case AxisProtocol::kFreed:
      return capture::open_freed(options, name);
    case AxisProtocol::kOpenTrackIo:
      return capture::open_opentrackio(options, name);
    case AxisProtocol::kOnvif:
      return capture::open_onvif(options, name);
    case AxisProtocol::kVisca:
    case AxisProtocol::kNone:
      break;
  }
  return capture::open_visca(options, name);
}

}  // namespace sightline
