// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdlib>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <set>

#include "observe/fiducial/apriltag_detector.hpp"
#include "observe/fiducial/aruco_detector.hpp"
#include "observe/terms/opencv_view.hpp"
#include "sightline/observe/fiducial/target_detector.hpp"

namespace sightline {
namespace {

using namespace observe;

constexpr size_t kConvincing = 3;  // markers; small dictionaries see single ones anywhere

/// Ids that a detector finds, each once.
std::set<int> ids_in(SquareDetector& detector, const Frame& frame) {
  std::vector<SquareDetection> found;
  detector.detect(frame, {0, 0, frame.info().width, frame.info().height}, 1.0, found);
  std::set<int> ids;
  for (const SquareDetection& each : found) ids.insert(each.code);
  return ids;
}

std::vector<SquareCode> codes(const std::string& family, int count) {
  std::vector<SquareCode> out;
  for (int i = 0; i < count; ++i) out.push_back({family, i});
  return out;
}

std::set<int> aruco_ids(const std::string& dictionary, bool inverted, const Frame& frame) {
  for (const int count : {1000, 250, 100, 50}) {
    auto detector = make_aruco_detector(codes("", count), dictionary, inverted, "");
    if (detector) return ids_in(**detector, frame);
  }
  return {};
}

std::set<int> tag_ids(const std::string& family, const Frame& frame) {
  for (const int count : {587, 35, 30, 242, 320}) {
    auto detector = make_apriltag_detector(codes(family, count), {}, "");
    if (detector) return ids_in(**detector, frame);
  }
  return {};
}

std::string ids_text(const std::set<int>& ids) {
  return fmt::format("{} markers, ids {} to {}", ids.size(), *ids.begin(), *ids.rbegin());
}

FramePtr mirrored(const Frame& frame) {
  const PlaneView gray = frame.gray();
  auto image = std::make_shared<Image>(gray.width, gray.height);
  const MutablePlaneView to = image->mutable_view().y;
  for (int y = 0; y < gray.height; ++y) {
    std::reverse_copy(gray.row(y), gray.row(y) + gray.width, to.row(y));
  }
  FrameInfo info = frame.info();
  return Frame::decoded(info, std::move(image));
}

/// Tries sizes near the wanted one, larger ones first: a miscount, or corners taken for squares.
std::string chessboard_size(const CalibrationTarget& target, const Frame& frame) try {
  constexpr int kReach = 2;
  const PlaneView gray = frame.gray();
  const cv::Mat image = opencv_view(gray);
  for (int more = 2 * kReach; more >= -2 * kReach; --more) {
    for (int wider = -kReach; wider <= kReach; ++wider) {
      const int columns = target.columns + wider, rows = target.rows + more - wider;
      const bool same = columns == target.columns && rows == target.rows;
      if (std::abs(more - wider) > kReach || columns < 4 || rows < 4 || same) continue;
      std::vector<cv::Point2f> corners;
      if (cv::findChessboardCorners(image, {columns - 1, rows - 1}, corners,
                                    cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_FAST_CHECK)) {
        return fmt::format("the image shows a chessboard of {}x{} squares", columns, rows);
      }
    }
  }
  return "";
} catch (const cv::Exception&) {
  return "";
}

std::string other_markers(const CalibrationTarget& target, const Frame& frame) {
  std::string best;
  size_t most = kConvincing - 1;
  const auto better = [&](const std::set<int>& ids, const std::string& what) {
    if (ids.size() <= most) return;
    most = ids.size();
    best = fmt::format("the image shows {} of {}", ids_text(ids), what);
  };
  for (const std::string& dictionary : aruco_dictionaries()) {
    for (const bool inverted : {false, true}) {
      const bool own = target.kind == TargetKind::kCharuco && dictionary == target.dictionary &&
                       inverted == target.inverted;
      if (own) continue;
      better(aruco_ids(dictionary, inverted, frame),
             fmt::format("{} (or a larger one of its kind){}", dictionary,
                         inverted ? ", white on black (inverted = true)" : ""));
    }
  }
  for (const std::string& family : apriltag_families()) {
    const bool own = target.kind == TargetKind::kTagGrid && family == target.dictionary;
    if (!own) better(tag_ids(family, frame), family);
  }
  return best;
}

}  // namespace

std::string explain_missing_target(const CalibrationTarget& target, const Frame& frame) {
  if (target.kind == TargetKind::kChessboard) return chessboard_size(target, frame);
  const auto own = [&](const Frame& image) {
    return target.kind == TargetKind::kCharuco
               ? aruco_ids(target.dictionary, target.inverted, image)
               : tag_ids(target.dictionary, image);
  };
  const std::set<int> ids = own(frame);
  if (ids.size() >= kConvincing) {
    return fmt::format(
        "the image shows {} of the right dictionary, but not where a target of that "
        "size and layout has them: are columns and rows right?",
        ids_text(ids));
  }
  if (own(*mirrored(frame)).size() >= kConvincing) {
    return "the image is mirrored: its mirror image shows the markers. Switch off the mirror image "
           "of the camera, or the print is flipped";
  }
  return other_markers(target, frame);
}

}  // namespace sightline
