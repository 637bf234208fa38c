// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/base/result.hpp"

namespace sightline::stream {

/// What the answer needs to know of a viewer's offer.
struct ViewerOffer {
  std::string sdp;          ///< as it came, without candidates
  unsigned media_line = 0;  ///< index of the video
  int payload_type = 0;     ///< H.264, packetization-mode 1, best profile for us first
  std::string profile;      ///< its profile-level-id, or ""
};

/// Reads an SDP offer (RFC 8866, RFC 9429) that wants to receive H.264. kInvalidInput says what
/// it lacks.
Result<ViewerOffer> read_offer(const std::string& sdp);

}  // namespace sightline::stream
