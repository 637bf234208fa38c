// SPDX-License-Identifier: Apache-2.0
#include "sightline/capture/axes/axis_source.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "capture/axes/axis_sources.hpp"

namespace sightline {
namespace {

constexpr uint16_t kViscaPort = 52381, kOnvifPort = 80;
constexpr int kMostViscaCameras = 7;  // on a line
constexpr size_t kLongestPath = 255;
constexpr double kArcSeconds = 3600;

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

bool fits_group(const AxisSourceOptions& options) {
  const std::string& name = options.interface;
  return capture::is_multicast(options.host) && !name.empty() && name.size() < IF_NAMESIZE &&
         std::ranges::none_of(name, [](unsigned char c) { return c == '/' || c <= ' '; });
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
  const size_t percent = host.find('%');  // the interface of a group
  if (percent != std::string_view::npos) out.interface = host.substr(percent + 1);
  out.host = host.substr(0, percent);
  if (!out.host.empty() && !is_address(out.host)) return false;
  if (percent != std::string_view::npos && !fits_group(out)) return false;
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

// One camera: nobody is asked through a group.
bool read_peer(std::string_view text, AxisSourceOptions& out) {
  return read_address(text, false, out) && !capture::is_multicast(out.host);
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
  return read_peer(rest, out);
}

// "/dev/TTY[#CAMERA]"
bool read_line(std::string_view rest, AxisSourceOptions& out) {
  out.device = 1;
  if (const size_t mark = rest.find('#'); mark != std::string_view::npos) {
    const auto camera = whole(rest.substr(mark + 1), 1, kMostViscaCameras);
    if (!camera) return false;
    out.device = *camera;
    rest = rest.substr(0, mark);
  }
  out.line = rest;
  return rest.size() > 1 && rest.starts_with('/') && rest.size() <= kLongestPath;
}

// "", or ":" and what V4l2Options::device takes
bool read_v4l2(std::string_view rest, AxisSourceOptions& out) {
  out.counts_per_degree = kArcSeconds;
  if (rest.empty()) return true;
  if (rest.size() < 2 || rest.size() > kLongestPath || rest[0] != ':') return false;
  out.line = rest.substr(1);
  return true;
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
  if (takes("v4l2")) {
    out.protocol = AxisProtocol::kV4l2;
    return read_v4l2(text, out);
  }
  if (!takes("visca:")) return false;
  if (text.starts_with('/')) {
    out.protocol = AxisProtocol::kViscaSerial;
    return read_line(text, out);
  }
  out.protocol = AxisProtocol::kVisca;
  out.port = kViscaPort;
  return read_peer(text, out);
}

}  // namespace

Result<AxisSourceOptions> parse_axis_source(std::string_view text, const std::string& where) {
  AxisSourceOptions out;
  if (read_source(text, out)) return out;
  return make_error(
      ErrorCode::kInvalidInput, where,
      "'{}' tells no angles: write \"freed:PORT\" or \"opentrackio:PORT\" (with an "
      "own ADDRESS: or a group before the port, and \"/ID\" behind to take one "
      "camera's only), \"visca:ADDRESS[:PORT]\", \"visca:/dev/TTY[#CAMERA]\", "
      "\"onvif:ADDRESS[:PORT][/PROFILE]\" or \"v4l2[:DEVICE]\"; addresses are numbers",
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
    case AxisProtocol::kV4l2:
      return capture::open_v4l2_head(options, name);
    case AxisProtocol::kViscaSerial:
      return capture::open_visca_serial(options, name);
    case AxisProtocol::kVisca:
    case AxisProtocol::kNone:
      break;
  }
  return capture::open_visca(options, name);
}

}  // namespace sightline
