// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <string>

#include "sightline/base/result.hpp"

namespace sightline::capture {

/// Between two steps of an opening: kUnavailable once a stop is requested.
inline Status check_not_stopped(const std::stop_token& stop, const std::string& name) {
  if (!stop.stop_requested()) return {};
  return make_error(ErrorCode::kUnavailable, name, "stopped while the camera was being opened");
}

}  // namespace sightline::capture
