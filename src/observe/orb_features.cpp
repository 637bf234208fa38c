// SPDX-License-Identifier: Apache-2.0
#include "orb_features.hpp"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "sightline/base/log.hpp"

namespace sightline::observe {
namespace {

constexpr int kRoom = 40;  // of the patches of the coarser levels
constexpr int kLevels = 5;
constexpr float kStep = 1.2f;
constexpr int kFastThreshold = 8;
constexpr int kPatch = 31;
// Objects are small in small pictures: at twice the size a patch covers half as much of them.
constexpr int kMostDoubled = 1 << 20;  // [px]

cv::Mat mask_of(const cv::Rect& box, const std::function<bool(int, int)>& wanted) {
  cv::Mat mask = cv::Mat::zeros(box.size(), CV_8UC1);
  for (int y = 0; y < box.height; ++y) {
    for (int x = 0; x < box.width; ++x) {
      if (wanted(box.x + x, box.y + y)) mask.at<uint8_t>(y, x) = 255;
    }
  }
  return mask;
}

}  // namespace

std::vector<OrbFeature> orb_features(const PlaneView& grey, int x0, int y0, int x1, int y1,
                                     int most, const std::function<bool(int, int)>& wanted) {
  std::vector<OrbFeature> features;
  try {
    const cv::Rect whole(0, 0, grey.width, grey.height);
    const cv::Rect box =
        cv::Rect(x0 - kRoom, y0 - kRoom, x1 - x0 + 2 * kRoom, y1 - y0 + 2 * kRoom) & whole;
    if (box.width < 2 * kRoom || box.height < 2 * kRoom) return features;
    const cv::Mat picture(grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.data),
                          static_cast<size_t>(grey.stride));
    const int times = grey.width * grey.height <= kMostDoubled ? 2 : 1;
    cv::Mat part, mask = wanted ? mask_of(box, wanted) : cv::Mat();
    cv::resize(picture(box), part, {}, times, times, cv::INTER_LINEAR);
    if (wanted) cv::resize(mask, mask, part.size(), 0, 0, cv::INTER_NEAREST);
    const auto orb = cv::ORB::create(most, kStep, kLevels, kPatch, 0, 2, cv::ORB::HARRIS_SCORE,
                                     kPatch, kFastThreshold);
    std::vector<cv::KeyPoint> points;
    cv::Mat descriptors;
    orb->detectAndCompute(part, mask, points, descriptors);
    for (size_t i = 0; i < points.size(); ++i) {
      OrbFeature feature;
      feature.pixel = {(static_cast<double>(points[i].pt.x) + 0.5) / times - 0.5 + box.x,
                       (static_cast<double>(points[i].pt.y) + 0.5) / times - 0.5 + box.y};
      feature.scale = static_cast<double>(points[i].size) / (kPatch * times);
      feature.strength = points[i].response;
      std::copy_n(descriptors.ptr<uint8_t>(static_cast<int>(i)), feature.descriptor.size(),
                  feature.descriptor.begin());
      features.push_back(feature);
    }
  } catch (const cv::Exception& error) {
    log::warning("features: OpenCV refused a picture: {}", error.what());
    return {};
  }
  std::stable_sort(features.begin(), features.end(), [](const OrbFeature& a, const OrbFeature& b) {
    return a.strength > b.strength;
  });
  return features;
}

}  // namespace sightline::observe
