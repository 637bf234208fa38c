// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "genicam_formats.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// Bilinear demosaicing of 8-bit samples (OpenCV); `bgr` holds width x height x 3 bytes. Pictures
/// of less than 3x3 pixels have no colour: all channels are the sample.
void demosaic_to_bgr(BayerPattern pattern, const PlaneView& mosaic, uint8_t* bgr);

}  // namespace sightline
