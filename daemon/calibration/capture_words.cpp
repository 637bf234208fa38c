// SPDX-License-Identifier: Apache-2.0
#include "calibration/capture_words.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kFirstImage = 20s;  // a camera that is silent for longer is not there

}  // namespace

std::string hint_words(const CaptureStep& step) {
  switch (step.kind) {
    case CaptureStep::Kind::kMoving:
      return "hold it still";
    case CaptureStep::Kind::kBlurred:
      return "it is not sharp";
    case CaptureStep::Kind::kTaken:
    case CaptureStep::Kind::kKnown:
      return "taken";
    case CaptureStep::Kind::kNotSeen:
      break;
  }
  return "";
}

std::string next_words(const CaptureState& state, const std::vector<std::string>& cameras) {
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const TargetCameraStatus& camera = state.cameras[c];
    if (!camera.problem.empty()) return fmt::format("{}: {}", cameras[c], camera.problem);
    if (camera.frames == 0) return fmt::format("{}: waiting for its first image", cameras[c]);
  }
  if (state.refusal) return *state.refusal;
  return state.advice.words;
}

Status check_present(const CaptureState& state, const std::vector<std::string>& cameras,
                     Duration since_start, const std::string& otherwise) {
  if (since_start < kFirstImage) return {};
  for (size_t c = 0; c < cameras.size(); ++c) {
    const TargetCameraStatus& camera = state.cameras[c];
    if (camera.frames > 0 || camera.ended) continue;
    return make_error(ErrorCode::kUnavailable, "camera " + cameras[c],
                      "no image in {:.0f} s{}{}; {}", to_seconds(kFirstImage),
                      camera.problem.empty() ? "" : ": ", camera.problem, otherwise);
  }
  return {};
}

}  // namespace sightline
