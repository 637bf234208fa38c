// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "sightline/base/time.hpp"

namespace sightline::capture {

/// What a GigE Vision camera says of itself.
struct GigeAnswer {
  std::string vendor, model, serial, user_name;
};

/// Asks one address for a GigE Vision camera (a discovery command of GVCP, GigE Vision 2.0 chapter
/// 14), three times within `timeout`. Costs nothing where nobody is, unlike opening the camera.
/// `own`: address of the interface to ask from.
std::optional<GigeAnswer> ask_gige(const std::string& camera, const std::string& own,
                                   Duration timeout);

}  // namespace sightline::capture
