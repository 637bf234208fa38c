// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pixels/frame_difference.hpp"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "observe/detect/detect_constants.hpp"
#include "observe/terms/opencv_threads.hpp"
#include "observe/terms/opencv_view.hpp"

namespace sightline::observe {
namespace {

// Sum over 3 x 3 pixels of what each plane has changed by, their magnitudes added. Averaged before
// the magnitude is taken, so that noise is less.
cv::Mat changes(const HalfSizeImage& before, const HalfSizeImage& now) {
  cv::Mat sum, difference, smooth;
  for (size_t plane = 0; plane < 3; ++plane) {
    cv::subtract(opencv_view(now.view(plane)), opencv_view(before.view(plane)), difference,
                 cv::noArray(), CV_16S);
    cv::boxFilter(difference, smooth, CV_16S, {3, 3}, {-1, -1}, false);
    smooth = cv::abs(smooth);
    if (plane == 0) {
      sum = smooth.clone();
    } else {
      sum += smooth;
    }
  }
  return sum;
}

// Noise changes every pixel; the more of it there is, the more it takes to count.
double least_change(const cv::Mat& changes) {
  std::vector<int16_t> some;
  for (int y = 0; y < changes.rows; y += 3) {
    const auto* row = changes.ptr<int16_t>(y);
    for (int x = y % 5; x < changes.cols; x += 5) some.push_back(row[x]);
  }
  if (some.empty()) return 0;
  const auto middle = some.begin() + static_cast<ptrdiff_t>(some.size() / 2);
  std::nth_element(some.begin(), middle, some.end());
  return std::max(9 * kMotionContrast, kMotionOverMedian * *middle);
}

// Of cells of the image, those in which anything has moved: of a camera that is carried the edges
// alone change, but everywhere.
double share_of_cells(const cv::Mat& moved) {
  int cells = 0, moving = 0;
  for (int y = 0; y + kMotionCell <= moved.rows; y += kMotionCell) {
    for (int x = 0; x + kMotionCell <= moved.cols; x += kMotionCell) {
      ++cells;
      moving += cv::countNonZero(moved(cv::Rect(x, y, kMotionCell, kMotionCell))) > 0 ? 1 : 0;
    }
  }
  return moving / static_cast<double>(std::max(1, cells));
}

}  // namespace

void FrameDifference::remember(HalfSizeImage& image, Time capture) {
  const bool first = newer_.image.width == 0;
  if (!first && capture - newer_.capture < kMotionGap) return;
  std::swap(older_, newer_);
  std::swap(newer_.image, image);
  newer_.capture = capture;
}

// The newer one, unless it is so new that hardly anything has moved since.
const FrameDifference::Remembered& FrameDifference::reference(Time capture) const {
  const bool older = capture - newer_.capture < kMotionGap && older_.image.width > 0;
  return older ? older_ : newer_;
}

bool FrameDifference::find(const HalfSizeImage& now, Time capture,
                           std::vector<uint8_t>& mask) const {
  mask.clear();
  const Remembered& before = reference(capture);
  if (before.image.width != now.width || before.image.height != now.height ||
      capture <= before.capture || capture - before.capture > kMotionAge)
    return false;
  keep_opencv_in_one_thread();
  const cv::Mat change = changes(before.image, now);
  const cv::Mat moved = change > least_change(change);
  const double share = cv::countNonZero(moved) / static_cast<double>(moved.total());
  if (share < kMinMotionShare || share_of_cells(moved) > kMaxMovingCells) return false;
  const int side = 2 * kMotionMargin + 1;
  mask.resize(moved.total());
  cv::Mat out(moved.rows, moved.cols, CV_8UC1, mask.data());
  cv::dilate(moved & 1, out, cv::Mat::ones(side, side, CV_8UC1));
  return true;
}

}  // namespace sightline::observe
