// SPDX-License-Identifier: Apache-2.0
//
// SOAP 1.2 as ONVIF has it (Core Specification 5, PTZ Service Specification 5.2). Cameras choose
// prefixes as they like: elements are known by their local names.
#include "capture/axes/onvif_messages.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <pugixml.hpp>

namespace sightline::capture {
namespace {

constexpr std::string_view kDegreesSpace =
    "http://www.onvif.org/ver10/tptz/PanTiltSpaces/SphericalPositionSpaceDegrees";
constexpr std::string_view kWayDegreesSpace =
    "http://www.onvif.org/ver10/tptz/PanTiltSpaces/SphericalTranslationSpaceDegrees";
constexpr std::string_view kWayGenericSpace =
    "http://www.onvif.org/ver10/tptz/PanTiltSpaces/TranslationGenericSpace";
constexpr std::string_view kGenericSpace =
    "http://www.onvif.org/ver10/tptz/PanTiltSpaces/PositionGenericSpace";

std::string_view local_name(const pugi::xml_node& node) {
  const std::string_view name = node.name();
  const size_t colon = name.find(':');
  return colon == std::string_view::npos ? name : name.substr(colon + 1);
}

// The next node in the order of the document, within `root`.
pugi::xml_node following(pugi::xml_node node, const pugi::xml_node& root) {
  if (node.first_child()) return node.first_child();
  while (node != root && !node.next_sibling()) node = node.parent();
  return node == root ? pugi::xml_node() : node.next_sibling();
}

pugi::xml_node find(const pugi::xml_node& root, std::string_view name) {
  for (pugi::xml_node node = root; node; node = following(node, root)) {
    if (local_name(node) == name) return node;
  }
  return {};
}

std::optional<double> number(const pugi::xml_node& node, const char* key) {
  const std::string_view text = node.attribute(key).value();
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || fault != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

bool read(pugi::xml_document& document, std::string_view xml) {
  return static_cast<bool>(document.load_buffer(xml.data(), xml.size()));
}

// What comes from the camera or a file goes into attributes and text.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&' || c == '<' || c == '>' || c == '"' || c == '\'') {
      out += fmt::format("&#{};", static_cast<int>(c));
    } else {
      out += c;
    }
  }
  return out;
}

std::string envelope(std::string_view body) {
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>"
      "<s:Envelope xmlns:s=\"http://www.w3.org/2003/05/soap-envelope\" "
      "xmlns:t=\"http://www.onvif.org/ver10/schema\"><s:Body>{}</s:Body></s:Envelope>",
      body);
}

std::string move_request(std::string_view request, std::string_view kind, std::string_view profile,
                         const HeadAngles& to, std::string_view space, const HeadAngles& speed) {
  return envelope(fmt::format(
      "<{0} xmlns=\"http://www.onvif.org/ver20/ptz/wsdl\"><ProfileToken>{2}</ProfileToken>"
      "<{1}><t:PanTilt x=\"{3:.6f}\" y=\"{4:.6f}\" space=\"{5}\"/></{1}>"
      "<Speed><t:PanTilt x=\"{6:.4f}\" y=\"{7:.4f}\"/></Speed></{0}>",
      request, kind, escaped(profile), to.x(), to.y(), space, speed.x(), speed.y()));
}

}  // namespace

std::optional<OnvifStatus> parse_onvif_status(std::string_view xml) {
  pugi::xml_document document;
  if (!read(document, xml)) return std::nullopt;
  const pugi::xml_node status = find(document, "GetStatusResponse");
  const pugi::xml_node position = find(status, "Position");
  const pugi::xml_node pan_tilt = find(position, "PanTilt");
  const auto pan = number(pan_tilt, "x"), tilt = number(pan_tilt, "y");
  if (!pan || !tilt) return std::nullopt;
  OnvifStatus out;
  out.pan = *pan;
  out.tilt = *tilt;
  out.degrees = pan_tilt.attribute("space").value() == kDegreesSpace;
  const double most = out.degrees ? 360 : 1.001;
  if (std::abs(out.pan) > most || std::abs(out.tilt) > most) return std::nullopt;
  out.zoom = number(find(position, "Zoom"), "x").value_or(0);
  const pugi::xml_node moves = find(find(status, "MoveStatus"), "PanTilt");
  out.moving = std::string_view(moves.text().get()) == "MOVING";
  return out;
}

std::string parse_onvif_path(std::string_view xml, std::string_view name) {
  pugi::xml_document document;
  if (!read(document, xml)) return {};
  const pugi::xml_node capabilities = find(document, "Capabilities");
  const std::string_view address = find(find(capabilities, name), "XAddr").text().get();
  const size_t host = address.find("://");
  if (host == std::string_view::npos) return {};
  const size_t path = address.find('/', host + 3);
  return path == std::string_view::npos ? "/" : std::string(address.substr(path));
}

std::string parse_onvif_profile(std::string_view xml, std::string_view wanted) {
  pugi::xml_document document;
  if (!read(document, xml)) return {};
  const pugi::xml_node all = find(document, "GetProfilesResponse");
  for (const pugi::xml_node profile : all.children()) {
    const std::string token = profile.attribute("token").value();
    if (token.empty() || (!wanted.empty() && token != wanted)) continue;
    if (find(profile, "PTZConfiguration")) return token;
  }
  return {};
}

std::string parse_onvif_node(std::string_view xml, std::string_view profile) {
  pugi::xml_document document;
  if (!read(document, xml)) return {};
  const pugi::xml_node all = find(document, "GetProfilesResponse");
  for (const pugi::xml_node one : all.children()) {
    if (one.attribute("token").value() != profile) continue;
    return find(find(one, "PTZConfiguration"), "NodeToken").text().get();
  }
  return {};
}

std::optional<OnvifMoves> parse_onvif_moves(std::string_view xml, std::string_view wanted) {
  pugi::xml_document document;
  if (!read(document, xml)) return std::nullopt;
  pugi::xml_node node;
  for (const pugi::xml_node one : find(document, "GetNodesResponse").children()) {
    if (!node || one.attribute("token").value() == wanted) node = one;
  }
  if (!node) return std::nullopt;
  OnvifMoves out;
  out.absolute = static_cast<bool>(find(node, "AbsolutePanTiltPositionSpace"));
  out.continuous = static_cast<bool>(find(node, "ContinuousPanTiltVelocitySpace"));
  out.relative = static_cast<bool>(find(node, "RelativePanTiltTranslationSpace"));
  return out;
}

std::string parse_onvif_fault(std::string_view xml) {
  pugi::xml_document document;
  if (!read(document, xml)) return {};
  const pugi::xml_node fault = find(document, "Fault");
  if (!fault) return {};
  const std::string text = find(find(fault, "Reason"), "Text").text().get();
  return text.empty() ? "it does not say why" : text.substr(0, 200);
}

std::string format_onvif_capabilities() {
  return envelope(
      "<GetCapabilities xmlns=\"http://www.onvif.org/ver10/device/wsdl\"><Category>All</Category>"
      "</GetCapabilities>");
}

std::string format_onvif_profiles() {
  return envelope("<GetProfiles xmlns=\"http://www.onvif.org/ver10/media/wsdl\"/>");
}

std::string format_onvif_get_status(std::string_view profile) {
  return envelope(
      fmt::format("<GetStatus xmlns=\"http://www.onvif.org/ver20/ptz/wsdl\"><ProfileToken>{}"
                  "</ProfileToken></GetStatus>",
                  escaped(profile)));
}

std::string format_onvif_get_nodes() {
  return envelope("<GetNodes xmlns=\"http://www.onvif.org/ver20/ptz/wsdl\"/>");
}

std::string format_onvif_relative(std::string_view profile, const HeadAngles& way, bool degrees,
                                  const HeadAngles& speed) {
  return move_request("RelativeMove", "Translation", profile, way,
                      degrees ? kWayDegreesSpace : kWayGenericSpace, speed);
}

std::string format_onvif_continuous(std::string_view profile, const HeadAngles& velocity) {
  return envelope(
      fmt::format("<ContinuousMove xmlns=\"http://www.onvif.org/ver20/ptz/wsdl\"><ProfileToken>{}"
                  "</ProfileToken><Velocity><t:PanTilt x=\"{:.4f}\" y=\"{:.4f}\"/></Velocity>"
                  "<Timeout>PT1S</Timeout></ContinuousMove>",
                  escaped(profile), velocity.x(), velocity.y()));
}

std::string format_onvif_stop(std::string_view profile) {
  return envelope(
      fmt::format("<Stop xmlns=\"http://www.onvif.org/ver20/ptz/wsdl\"><ProfileToken>{}"
                  "</ProfileToken><PanTilt>true</PanTilt><Zoom>false</Zoom></Stop>",
                  escaped(profile)));
}

std::string format_onvif_move(std::string_view profile, const HeadAngles& place, bool degrees,
                              const HeadAngles& speed) {
  return move_request("AbsoluteMove", "Position", profile, place,
                      degrees ? kDegreesSpace : kGenericSpace, speed);
}

}  // namespace sightline::capture
