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
/// Why a request failed, of a SOAP fault; empty: it is none.
std::string parse_onvif_fault(std::string_view xml);

std::string format_onvif_capabilities();
std::string format_onvif_profiles();
std::string format_onvif_get_status(std::string_view profile);
/// `place` as `degrees` says, `speed` as shares of the fastest.
std::string format_onvif_move(std::string_view profile, const HeadAngles& place, bool degrees,
                              const HeadAngles& speed);

}  // namespace sightline::capture
