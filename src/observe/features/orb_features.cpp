// SPDX-License-Identifier: Apache-2.0
#include "observe/features/orb_features.hpp"

#include <algorithm>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "observe/terms/opencv_threads.hpp"
#include "observe/terms/opencv_view.hpp"
#include "sightline/base/log.hpp"

namespace sightline::observe {
namespace {

constexpr int kMargin = 40;  // of the patches of the coarser levels
constexpr int kLevels = 5;
constexpr float kStep = 1.2f;
constexpr int kFastThreshold = 8;
// Objects are small in small images: at twice the size a patch covers half as much of them.
constexpr int kMaxDoubled = 1 << 20;  // [px]

cv::Mat make_mask(const cv::Rect& box, const std::function<bool(int, int)>& use) {
  cv::Mat mask = cv::Mat::zeros(box.size(), CV_8UC1);
  for (int y = 0; y < box.height; ++y) {
    for (int x = 0; x < box.width; ++x) {
      if (use(box.x + x, box.y + y)) mask.at<uint8_t>(y, x) = 255;
    }
  }
  return mask;
}

}  // namespace

std::vector<OrbFeature> orb_features(const PlaneView& gray, int x0, int y0, int x1, int y1, int max,
                                     const std::function<bool(int, int)>& use) {
  keep_opencv_in_one_thread();
  std::vector<OrbFeature> features;
  try {
    const cv::Rect whole(0, 0, gray.width, gray.height);
    const cv::Rect box =
        cv::Rect(x0 - kMargin, y0 - kMargin, x1 - x0 + 2 * kMargin, y1 - y0 + 2 * kMargin) & whole;
    if (box.width < 2 * kMargin || box.height < 2 * kMargin) return features;
    const cv::Mat image = opencv_view(gray);
    const int times = gray.width * gray.height <= kMaxDoubled ? 2 : 1;
    cv::Mat part, mask = use ? make_mask(box, use) : cv::Mat();
    cv::resize(image(box), part, {}, times, times, cv::INTER_LINEAR);
    if (use) cv::resize(mask, mask, part.size(), 0, 0, cv::INTER_NEAREST);
    const auto orb = cv::ORB::create(max, kStep, kLevels, kOrbPatch, 0, 2, cv::ORB::HARRIS_SCORE,
                                     kOrbPatch, kFastThreshold);
    std::vector<cv::KeyPoint> points;
    cv::Mat descriptors;
    orb->detectAndCompute(part, mask, points, descriptors);
    for (size_t i = 0; i < points.size(); ++i) {
      OrbFeature feature;
      feature.pixel = {(static_cast<double>(points[i].pt.x) + 0.5) / times - 0.5 + box.x,
                       (static_cast<double>(points[i].pt.y) + 0.5) / times - 0.5 + box.y};
      feature.angle = static_cast<double>(points[i].angle) * std::numbers::pi / 180;
      feature.scale = static_cast<double>(points[i].size) / (kOrbPatch * times);
      feature.strength = points[i].response;
      std::copy_n(descriptors.ptr<uint8_t>(static_cast<int>(i)), feature.descriptor.size(),
                  feature.descriptor.begin());
      features.push_back(feature);
    }
  } catch (const cv::Exception& error) {
    log::warning("features: OpenCV refused an image: {}", error.what());
    return {};
  }
  std::stable_sort(features.begin(), features.end(), [](const OrbFeature& a, const OrbFeature& b) {
    return a.strength > b.strength;
  });
  return features;
}

}  // namespace sightline::observe
