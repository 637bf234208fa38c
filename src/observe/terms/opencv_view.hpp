// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

#include "sightline/image/planes.hpp"

namespace sightline::observe {

/// The plane for OpenCV, without a copy. Only to be read: OpenCV has no view of what is constant.
inline cv::Mat opencv_view(const PlaneView& plane) {
  return {plane.height, plane.width, CV_8UC1,
          const_cast<uint8_t*>(plane.data),  // NOLINT(cppcoreguidelines-pro-type-const-cast)
          static_cast<size_t>(plane.stride)};
}

}  // namespace sightline::observe
