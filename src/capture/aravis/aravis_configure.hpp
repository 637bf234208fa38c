// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "capture/aravis/aravis_chunks.hpp"
#include "capture/aravis/aravis_ref.hpp"
#include "capture/aravis/genicam_formats.hpp"
#include "sightline/capture/aravis/aravis_source.hpp"

namespace sightline::capture {

/// What the camera is set to, read back.
struct AravisSettings {
  const GenicamFormat* format = nullptr;
  int width = 0, height = 0;
  double rate_hz = 0;            ///< 0: unknown, or triggered
  double exposure_us = 0;        ///< 0: unknown
  double exposure_range_us = 0;  ///< how far automatic exposure may be from exposure_us
  size_t payload = 0;            ///< bytes of a buffer
  bool gige = false;
  bool packet_socket = false;  ///< Aravis reads from one: packets come in batches
  bool triggered = false;
  double fire_hz = 0;  ///< rate of the software triggers that the source fires; 0: none
  int packet_size = 0;
};

/// Stops the camera and sets it up, chunk data included. An error says what the camera would take
/// instead. After `stop` it gives up between two settings (kUnavailable).
Result<AravisSettings> configure_aravis(ArvCamera* camera, const AravisOptions& options,
                                        const std::string& name, AravisChunks& chunks,
                                        const std::stop_token& stop = {});

/// Names of the camera's formats that can be used.
std::vector<std::string> usable_formats(ArvCamera* camera);

/// "Slave", "Master", "Disabled" ..., or empty where the camera has no PTP.
std::string ptp_state(ArvCamera* camera);

/// Nanoseconds from the master's clock, as the camera says; nullopt where it does not.
std::optional<int64_t> ptp_offset(ArvCamera* camera);

}  // namespace sightline::capture
