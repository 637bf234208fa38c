// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/video/video.h>

#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// The planes of a mapped frame in I420, for as long as it is mapped.
inline I420View i420_view(const GstVideoFrame& frame) {
  const auto plane = [&frame](guint i) {
    return PlaneView{static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i)),
                     GST_VIDEO_FRAME_COMP_WIDTH(&frame, i), GST_VIDEO_FRAME_COMP_HEIGHT(&frame, i),
                     GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i)};
  };
  return {plane(0), plane(1), plane(2)};
}

}  // namespace sightline::capture
