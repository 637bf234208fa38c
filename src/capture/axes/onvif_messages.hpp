// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "sightline/geometry/axis_history.hpp"
#include "sightline/geometry/head_drive.hpp"

namespace sightline::capture {

/// What a head says of itself (ONVIF PTZ Service, GetStatusResponse).
struct OnvifStatus {
  double pan = 0, tilt = 0;  ///< as its space counts
  bool degrees = false;      ///< that is degrees; else the generic space of -1 to 1
  double zoom = 0;
  bool moving = false;
};
/// Empty: no XML, no position, numbers that its space does not have.
std::optional<OnvifStatus> parse_onvif_status(std::string_view xml);

/// The path of the service `name` ("Media", "PTZ") in a GetCapabilitiesResponse, without scheme and
/// host: the camera may know itself by another address. Empty: it has none.
std::string parse_onvif_path(std::string_view xml, std::string_view name);
/// The token of the first profile that has a head; with `wanted`, of that one only. Empty: none.
std::string parse_onvif_profile(std::string_view xml, std::string_view wanted);
/// The token of its node, which says what the head can do. Empty: it does not say.
std::string parse_onvif_node(std::string_view xml, std::string_view profile);

/// How a head can be told to turn: the spaces of a node in a GetNodesResponse.
struct OnvifMoves {
  bool absolute = false, continuous = false, relative = false;
};
/// Of the node `wanted`, else of the first. Empty: no such answer, or no node.
std::optional<OnvifMoves> parse_onvif_moves(std::string_view xml, std::string_view wanted);
/// Why a request failed, of a SOAP fault; empty: it is none.
std::string parse_onvif_fault(std::string_view xml);

std::string format_onvif_capabilities();
std::string format_onvif_profiles();
std::string format_onvif_get_status(std::string_view profile);
std::string format_onvif_get_nodes();
/// `place` as `degrees` says, `speed` as shares of the fastest.
std::string format_onvif_move(std::string_view profile, const HeadAngles& place, bool degrees,
                              const HeadAngles& speed);

/// By so much from where it stands.
std::string format_onvif_relative(std::string_view profile, const HeadAngles& way, bool degrees,
                                  const HeadAngles& speed);
/// `velocity` as shares of the fastest, with signs as positions count; ends by itself after a
/// second, the shortest time that all cameras take.
std::string format_onvif_continuous(std::string_view profile, const HeadAngles& velocity);
std::string format_onvif_stop(std::string_view profile);

}  // namespace sightline::capture
