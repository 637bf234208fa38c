// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibration/capture_session.hpp"

namespace sightline {

/// What to do next, in words: of the guide, unless a camera has no images or finds no target, or
/// the target moves. `cameras` by name.
std::string next_words(const CaptureState& state, const std::vector<std::string>& cameras);
/// What came of the newest image, "hold it still"; empty: the target is not seen.
std::string hint_words(const CaptureStep& step);

/// Refused: a camera that has sent no image so long after the start; `otherwise` is what to do
/// about it.
Status check_present(const CaptureState& state, const std::vector<std::string>& cameras,
                     Duration since_start, const std::string& otherwise);

}  // namespace sightline
