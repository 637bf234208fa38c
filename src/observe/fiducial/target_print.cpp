// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/fiducial/target_print.hpp"

#include "observe/fiducial/apriltag_detector.hpp"
#include "observe/fiducial/aruco_detector.hpp"
#include "observe/fiducial/board_layout.hpp"

namespace sightline {
namespace {

using namespace observe;

/// The dark modules of a marker, joined along its rows.
void add_marker(const std::vector<bool>& modules, const Eigen::Vector2d& at, double size,
                std::vector<PrintedRect>& out) {
  size_t side = 1;
  while (side * side < modules.size()) ++side;
  const double module = size / static_cast<double>(side);
  for (size_t row = 0; row < side; ++row) {
    for (size_t column = 0; column < side;) {
      size_t end = column;
      while (end < side && modules[row * side + end]) ++end;
      if (end > column) {
        out.push_back({at.x() + module * static_cast<double>(column),
                       at.y() + module * static_cast<double>(row),
                       module * static_cast<double>(end - column), module});
      }
      column = end + 1;
    }
  }
}

Error too_few(const CalibrationTarget& target, int id) {
  return make_error(ErrorCode::kInvalidInput, target.name,
                    "'{}' cannot be printed: not known, or it has no marker {}", target.dictionary,
                    id);
}

void add_squares(const CalibrationTarget& target, bool dark_first, std::vector<PrintedRect>& out) {
  for (int row = 0; row < target.rows; ++row) {
    for (int column = 0; column < target.columns; ++column) {
      if (((row + column) % 2 == 0) != dark_first) continue;
      out.push_back({column * target.square, row * target.square, target.square, target.square});
    }
  }
}

}  // namespace

Result<std::vector<PrintedRect>> target_print(const CalibrationTarget& target) {
  std::vector<PrintedRect> out;
  if (target.inverted) {
    return make_error(ErrorCode::kInvalidInput, target.name,
                      "white on black is read, not printed: leave out inverted = true");
  }
  if (target.kind == TargetKind::kChessboard) add_squares(target, true, out);
  if (target.kind == TargetKind::kTagGrid) {
    for (int i = 0; i < target.columns * target.rows; ++i) {
      const auto modules = apriltag_modules(target.dictionary, target.first_id + i);
      if (modules.empty()) return too_few(target, target.first_id + i);
      add_marker(modules, target.corner(4 * i), target.marker, out);
    }
  }
  if (target.kind == TargetKind::kCharuco) {
    const bool marker_first = target.layout == CharucoLayout::kMarkerFirst && target.rows % 2 == 0;
    const BoardLayout layout(
        {target.columns, target.rows, target.square, target.marker, target.dictionary, false},
        marker_first);
    add_squares(target, !marker_first, out);  // markers are in the bright squares
    for (int id = 0; id < layout.markers(); ++id) {
      const auto modules = aruco_modules(target.dictionary, id);
      if (modules.empty()) return too_few(target, id);
      add_marker(modules, layout.marker(id)[0], target.marker, out);
    }
  }
  return out;
}

}  // namespace sightline
