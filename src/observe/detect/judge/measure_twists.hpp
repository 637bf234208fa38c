// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/observe/terms/detection.hpp"

namespace sightline::observe {

/// The twist of each pose from the nearest one in orientation of an earlier detection of the same
/// object: over two detections the motion is known better than between the exposures of one of
/// them. Unchanged if there is hardly any time between them. `earlier` has poses.
void measure_twists(const Detection& earlier, Detection& now);

}  // namespace sightline::observe
