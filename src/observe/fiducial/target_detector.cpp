// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/fiducial/target_detector.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "observe/fiducial/apriltag_detector.hpp"
#include "observe/fiducial/aruco_detector.hpp"
#include "observe/fiducial/charuco_corners.hpp"
#include "observe/fiducial/edge_refine.hpp"
#include "observe/terms/opencv_threads.hpp"
#include "observe/terms/opencv_view.hpp"

namespace sightline {
namespace {

using namespace observe;

class ChessboardTarget : public TargetDetector {
 public:
  ChessboardTarget(const CalibrationTarget& target, int window)
      : columns_(target.columns - 1), rows_(target.rows - 1), window_(window) {}

  std::vector<DetectedCorner> detect(const Frame& frame) override try {
    const cv::Mat image = opencv_view(frame.gray());
    std::vector<cv::Point2f> corners;
    if (!cv::findChessboardCorners(image, {columns_, rows_}, corners,
                                   cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE)) {
      return {};
    }
    const int window = window_ > 0 ? window_ : window_for(corners);
    cv::cornerSubPix(image, corners, {window, window}, {-1, -1},
                     {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 30, 0.001});
    std::vector<DetectedCorner> out;
    for (size_t i = 0; i < corners.size(); ++i) {
      out.push_back({static_cast<int>(i), {corners[i].x, corners[i].y}});
    }
    turn_upright(out);
    if ((columns_ + rows_) % 2 == 1 && !starts_dark(frame.gray(), out)) {
      std::vector<DetectedCorner> turned = out;
      for (size_t i = 0; i < out.size(); ++i) turned[i].pixel = out[out.size() - 1 - i].pixel;
      out = std::move(turned);
    }
    return out;
  } catch (const cv::Exception&) {
    return {};  // an image too small for the pattern
  }

 private:
  // A third of the shortest side of a square: the window must not reach the next corner.
  int window_for(const std::vector<cv::Point2f>& corners) const {
    double side = 1e9;
    for (int i = 0; i + 1 < columns_ * rows_; ++i) {
      if ((i + 1) % columns_ == 0) continue;
      const auto d = corners[static_cast<size_t>(i + 1)] - corners[static_cast<size_t>(i)];
      side = std::min(side, static_cast<double>(std::hypot(d.x, d.y)));
    }
    return std::clamp(static_cast<int>(side / 4), 2, 7);
  }

  // The print has a dark square at its top-left, so the square after the first inner corner is
  // dark.
  bool starts_dark(const PlaneView& gray, const std::vector<DetectedCorner>& corners) const {
    double levels[2] = {0, 0}, counts[2] = {0, 0};
    for (int row = 0; row + 1 < rows_; ++row) {
      for (int column = 0; column + 1 < columns_; ++column) {
        const auto at = [&](int r, int c) {
          return corners[static_cast<size_t>(r * columns_ + c)].pixel;
        };
        const Eigen::Vector2d middle = (at(row, column) + at(row + 1, column + 1) +
                                        at(row, column + 1) + at(row + 1, column)) /
                                       4;
        const int x = static_cast<int>(middle.x() + 0.5), y = static_cast<int>(middle.y() + 0.5);
        if (x < 0 || y < 0 || x >= gray.width || y >= gray.height) continue;
        levels[(row + column) % 2] += gray.row(y)[x];
        counts[(row + column) % 2] += 1;
      }
    }
    return levels[0] * counts[1] <= levels[1] * counts[0];
  }

  // OpenCV may start at either end where both look alike, and lists rows of a mirrored frame when
  // it starts in a column; the corners must turn like the print's.
  void turn_upright(std::vector<DetectedCorner>& corners) const {
    const Eigen::Vector2d along =
        corners[static_cast<size_t>(columns_ - 1)].pixel - corners[0].pixel;
    const Eigen::Vector2d down =
        corners[static_cast<size_t>(columns_ * (rows_ - 1))].pixel - corners[0].pixel;
    if (along.x() * down.y() - along.y() * down.x() > 0) return;
    std::vector<DetectedCorner> turned = corners;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        turned[static_cast<size_t>(row * columns_ + column)].pixel =
            corners[static_cast<size_t>(row * columns_ + columns_ - 1 - column)].pixel;
      }
    }
    corners = std::move(turned);
  }

  int columns_, rows_, window_;
};

class TagGridTarget : public TargetDetector {
 public:
  TagGridTarget(std::unique_ptr<SquareDetector> tags, double gamma)
      : tags_(std::move(tags)), light_(gamma, kRefineWhite) {}

  std::vector<DetectedCorner> detect(const Frame& frame) override {
    const PlaneView gray = frame.gray();
    // Lines are straight enough over one tag: refine them without a lens.
    CameraModel::Parameters p;
    p.width = gray.width;
    p.height = gray.height;
    p.fx = p.fy = std::max(gray.width, gray.height);
    p.cx = (gray.width - 1) / 2.0;
    p.cy = (gray.height - 1) / 2.0;
    const auto pinhole = CameraModel::create(p, "");
    if (!pinhole) return {};
    std::vector<SquareDetection> found;
    tags_->detect(frame, {0, 0, gray.width, gray.height}, 1.0, found);
    std::sort(found.begin(), found.end(),
              [](const SquareDetection& a, const SquareDetection& b) { return a.code < b.code; });
    std::vector<DetectedCorner> out;
    for (size_t i = 0; i < found.size(); ++i) {
      const bool twice = (i > 0 && found[i - 1].code == found[i].code) ||
                         (i + 1 < found.size() && found[i + 1].code == found[i].code);
      if (twice) continue;  // nothing tells which of the two is on the target
      const auto refined =
          refine_square(gray, light_, *pinhole, found[i].corners, tags_->border(found[i].code));
      if (!refined) continue;
      for (size_t k = 0; k < 4; ++k) {
        out.push_back({4 * found[i].code + static_cast<int>(k), refined->corners[k]});
      }
    }
    return out;
  }

 private:
  std::unique_ptr<SquareDetector> tags_;
  LightTable light_;
};

class CharucoTarget : public TargetDetector {
 public:
  CharucoTarget(std::unique_ptr<SquareDetector> markers, const CalibrationTarget& target,
                int window)
      : markers_(std::move(markers)), finder_(target, window) {}

  std::vector<DetectedCorner> detect(const Frame& frame) override {
    const PlaneView gray = frame.gray();
    std::vector<SquareDetection> found;
    markers_->detect(frame, {0, 0, gray.width, gray.height}, 1.0, found);
    return finder_.find(gray, found);
  }
  CharucoLayout layout() const override { return finder_.layout(); }

 private:
  std::unique_ptr<SquareDetector> markers_;
  CharucoCorners finder_;
};

}  // namespace

Result<std::unique_ptr<TargetDetector>> TargetDetector::create(
    const CalibrationTarget& target, const TargetDetectorOptions& options) {
  using Made = Result<std::unique_ptr<TargetDetector>>;
  keep_opencv_in_one_thread();
  std::vector<SquareCode> codes;
  switch (target.kind) {
    case TargetKind::kChessboard:
      return Made(std::make_unique<ChessboardTarget>(target, options.window));
    case TargetKind::kTagGrid: {
      if (!is_apriltag_family(target.dictionary)) {
        return make_error(ErrorCode::kInvalidInput, target.name,
                          "family '{}' is not known; tag36h11, tag25h9, tag16h5, ...",
                          target.dictionary);
      }
      for (int i = 0; i < target.columns * target.rows; ++i) {
        codes.push_back({target.dictionary, target.first_id + i});
      }
      SL_ASSIGN(auto tags, make_apriltag_detector(codes, {}, target.name));
      return Made(std::make_unique<TagGridTarget>(std::move(tags), options.gamma));
    }
    case TargetKind::kCharuco: {
      if (!is_aruco_dictionary(target.dictionary)) {
        return make_error(ErrorCode::kInvalidInput, target.name,
                          "dictionary '{}' is not known; 4X4_50, 5X5_100, 6X6_250, ...",
                          target.dictionary);
      }
      for (int i = 0; i < (target.columns * target.rows + 1) / 2; ++i) {
        codes.push_back({"", i});
      }
      SL_ASSIGN(auto markers,
                make_aruco_detector(codes, target.dictionary, target.inverted, target.name));
      return Made(std::make_unique<CharucoTarget>(std::move(markers), target, options.window));
    }
  }
  return make_error(ErrorCode::kInternal, target.name, "no such kind of target");
}

}  // namespace sightline
