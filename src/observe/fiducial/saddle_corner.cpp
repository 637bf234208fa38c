// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/saddle_corner.hpp"
#include "observe/terms/opencv_view.hpp"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace sightline::observe {
namespace {

constexpr int kMinWindow = 2, kMaxWindow = 7;
constexpr double kMinSaddleContrast = 8;  // gray levels between the two diagonals

bool alternates(const PlaneView& gray, const SaddleStart& start, const Eigen::Vector2d& found) {
  std::array<double, 4> levels{};
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d p = found + 0.6 * start.around[k];
    if (p.x() < 0 || p.y() < 0 || p.x() > gray.width - 1 || p.y() > gray.height - 1) return false;
    levels[k] = gray.row(static_cast<int>(p.y() + 0.5))[static_cast<int>(p.x() + 0.5)];
  }
  const double darkest_bright =
      start.main_is_bright ? std::min(levels[0], levels[1]) : std::min(levels[2], levels[3]);
  const double brightest_dark =
      start.main_is_bright ? std::max(levels[2], levels[3]) : std::max(levels[0], levels[1]);
  return darkest_bright - brightest_dark >= kMinSaddleContrast;
}

}  // namespace

std::optional<Eigen::Vector2d> refine_saddle(const PlaneView& gray, const SaddleStart& start) {
  double plain_px = 1e9;
  for (const Eigen::Vector2d& step : start.around) plain_px = std::min(plain_px, step.norm());
  const int window = start.window > 0
                         ? start.window
                         : std::clamp(static_cast<int>(plain_px * 0.8), kMinWindow, kMaxWindow);
  const double border = window + 3.0;
  const Eigen::Vector2d& at = start.pixel;
  if (!(at.x() >= border && at.y() >= border && at.x() <= gray.width - 1 - border &&
        at.y() <= gray.height - 1 - border)) {
    return std::nullopt;
  }
  const cv::Mat image = opencv_view(gray);
  std::vector<cv::Point2f> points = {{static_cast<float>(at.x()), static_cast<float>(at.y())}};
  cv::cornerSubPix(image, points, {window, window}, {-1, -1},
                   {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 20, 0.01});
  const Eigen::Vector2d found(points[0].x, points[0].y);
  const double tolerance = std::max(start.tolerance_px, 0.25 * start.tolerance_px * plain_px);
  if ((found - at).norm() > tolerance || !alternates(gray, start, found)) return std::nullopt;
  return found;
}

}  // namespace sightline::observe
