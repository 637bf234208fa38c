// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sightline/model/frame.hpp"
#include "sightline/model/observation.hpp"

namespace sightline {

/// An observation of `object` in this frame that says nothing yet ("searched and not seen").
/// `camera` is the caller's: a frame may come from a recording that numbers its cameras otherwise.
inline Observation make_observation(const FrameInfo& info, CameraId camera, ObjectId object) {
  Observation out;
  out.object = object;
  out.camera = camera;
  out.epoch = info.epoch;
  out.sequence = info.sequence;
  out.capture = info.capture;
  out.capture_error = info.capture_error;
  if (info.place) out.calibration_covariance = info.place->covariance;
  return out;
}

}  // namespace sightline
