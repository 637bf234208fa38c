// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/base/time.hpp"

namespace sightline::capture {

/// Longest silence of a camera that is alive: `asked` if that is given, else five frame periods,
/// but not less than `at_least`. `rate_hz`: 0 if unknown.
Duration frame_deadline(Duration asked, double rate_hz,
                        Duration at_least = std::chrono::seconds(1));

/// 0 if the rate is unknown (0).
Duration frame_period(double rate_hz);

}  // namespace sightline::capture
