// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/charuco_corners.hpp"

#include <algorithm>
#include <array>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <optional>

#include "observe/fiducial/saddle_corner.hpp"

namespace sightline::observe {
namespace {

constexpr double kTolerancePx = 2;
constexpr double kMinModulePx = 1.2;  // smaller markers say nothing exact

CharucoBoard board_of(const CalibrationTarget& t) {
  return {t.columns, t.rows, t.square, t.marker, t.dictionary, t.inverted};
}

using Points = std::vector<cv::Point2d>;

std::optional<Eigen::Matrix3d> homography(const Points& from, const Points& to) {
  const cv::Mat h = cv::findHomography(from, to, 0);
  if (h.empty()) return std::nullopt;
  Eigen::Matrix3d out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out(i, j) = h.at<double>(i, j);
  }
  return out;
}

void append(const BoardLayout& layout, const SquareDetection& marker, Points& board,
            Points& image) {
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d p = layout.marker(marker.code)[k];
    board.emplace_back(p.x(), p.y());
    image.emplace_back(marker.corners[k].x(), marker.corners[k].y());
  }
}

/// How badly a layout explains neighboring markers: each marker's homography predicts the corners
/// of the nearest other one; median of that, in sides of the marker.
double disagreement(const BoardLayout& layout, const std::vector<SquareDetection>& markers) {
  std::vector<double> errors;
  for (const SquareDetection& a : markers) {
    const SquareDetection* nearest = nullptr;
    double least = 1e18;
    for (const SquareDetection& b : markers) {
      const double distance = (layout.marker(a.code)[0] - layout.marker(b.code)[0]).squaredNorm();
      if (&a != &b && distance < least) {
        least = distance;
        nearest = &b;
      }
    }
    if (nearest == nullptr) continue;
    Points board, image;
    append(layout, a, board, image);
    const auto h = homography(board, image);
    if (!h) continue;
    const Eigen::Vector2d at = (*h * layout.marker(nearest->code)[0].homogeneous()).hnormalized();
    errors.push_back((at - nearest->corners[0]).norm() / shortest_side(nearest->corners));
  }
  if (errors.empty()) return -1;
  std::nth_element(errors.begin(), errors.begin() + static_cast<ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

}  // namespace

CharucoCorners::CharucoCorners(const CalibrationTarget& target, int window)
    : board_(board_of(target)), window_(window) {
  layouts_.emplace_back(board_, false);
  if (target.rows % 2 == 0) layouts_.emplace_back(board_, true);
  votes_.assign(layouts_.size(), 0);
}

CharucoLayout CharucoCorners::layout() const {
  if (layouts_.size() < 2 || votes_[0] == votes_[1]) return CharucoLayout::kAny;
  return votes_[0] > votes_[1] ? CharucoLayout::kDarkFirst : CharucoLayout::kMarkerFirst;
}

const BoardLayout* CharucoCorners::choose(const std::vector<SquareDetection>& markers) {
  constexpr double kAgrees = 0.35;
  if (layouts_.size() == 1) {
    const double error = disagreement(layouts_[0], markers);
    return error < kAgrees ? &layouts_[0] : nullptr;
  }
  const double first = disagreement(layouts_[0], markers);
  const double second = disagreement(layouts_[1], markers);
  if (first < 0) return nullptr;
  const size_t better = second < first ? 1 : 0;
  const double best = std::min(first, second), other = std::max(first, second);
  if (best > kAgrees) return nullptr;
  // Markers of one row alone agree with both layouts; what other images said decides then.
  if (other > 2 * best && other > 0.2) {
    ++votes_[better];
    return &layouts_[better];
  }
  if (votes_[0] == votes_[1]) return nullptr;
  return &layouts_[votes_[1] > votes_[0] ? 1 : 0];
}

std::vector<DetectedCorner> CharucoCorners::find(const PlaneView& gray,
                                                 const std::vector<SquareDetection>& all) {
  std::vector<SquareDetection> markers;
  for (const SquareDetection& marker : all) {
    const bool ours = marker.code < layouts_.front().markers();
    if (ours && shortest_side(marker.corners) > 6 * kMinModulePx) markers.push_back(marker);
  }
  const BoardLayout* layout = markers.empty() ? nullptr : choose(markers);
  if (layout == nullptr) return {};
  std::vector<DetectedCorner> out;
  const double inset = (board_.square - board_.marker) / 2;
  for (int corner = 0; corner < layout->corners(); ++corner) {
    const auto [a, b] = layout->markers_at(corner);
    Points board, image;
    for (const SquareDetection& marker : markers) {
      if (marker.code == a || marker.code == b) append(*layout, marker, board, image);
    }
    if (board.empty()) continue;
    const auto h = homography(board, image);
    if (!h) continue;
    const Eigen::Vector2d at = layout->corner(corner);
    SaddleStart start;
    start.pixel = (*h * at.homogeneous()).hnormalized();
    const std::array<Eigen::Vector2d, 4> steps = {Eigen::Vector2d(1, 1), Eigen::Vector2d(-1, -1),
                                                  Eigen::Vector2d(1, -1), Eigen::Vector2d(-1, 1)};
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d beside = at + inset * steps[k];
      start.around[k] = (*h * beside.homogeneous()).hnormalized() - start.pixel;
    }
    start.main_is_bright = layout->markers_on_main_diagonal(corner) != board_.inverted;
    start.tolerance_px = kTolerancePx;
    start.window = window_;
    if (const auto pixel = refine_saddle(gray, start)) out.push_back({corner, *pixel});
  }
  return out;
}

}  // namespace sightline::observe
