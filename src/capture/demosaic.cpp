// SPDX-License-Identifier: Apache-2.0
#include "demosaic.hpp"

#include <opencv2/imgproc.hpp>

namespace sightline {
namespace {

// OpenCV's older names start at the second row and column; the ones with four letters do not.
int code_of(BayerPattern pattern) {
  switch (pattern) {
    case BayerPattern::kRg:
      return cv::COLOR_BayerRGGB2BGR;
    case BayerPattern::kGr:
      return cv::COLOR_BayerGRBG2BGR;
    case BayerPattern::kGb:
      return cv::COLOR_BayerGBRG2BGR;
    case BayerPattern::kBg:
      return cv::COLOR_BayerBGGR2BGR;
    case BayerPattern::kNone:
      break;
  }
  return cv::COLOR_GRAY2BGR;
}

}  // namespace

void demosaic_to_bgr(BayerPattern pattern, const PlaneView& mosaic, uint8_t* bgr) {
  const bool tiny = mosaic.width < 3 || mosaic.height < 3;
  // OpenCV has no read-only view; it does not write to its input.
  const cv::Mat from(mosaic.height, mosaic.width, CV_8UC1, const_cast<uint8_t*>(mosaic.data),
                     static_cast<size_t>(mosaic.stride));
  cv::Mat to(mosaic.height, mosaic.width, CV_8UC3, bgr);
  cv::cvtColor(from, to, tiny ? static_cast<int>(cv::COLOR_GRAY2BGR) : code_of(pattern));
}

}  // namespace sightline
