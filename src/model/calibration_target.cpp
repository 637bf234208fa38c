// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/calibration_target.hpp"

#include <fmt/format.h>

#include "sightline/base/check.hpp"

namespace sightline {

int CalibrationTarget::corner_count() const {
  return kind == TargetKind::kTagGrid ? 4 * columns * rows : (columns - 1) * (rows - 1);
}

Eigen::Vector2d CalibrationTarget::corner(int id) const {
  SL_CHECK(id >= 0 && id < corner_count(), "corner of a target");
  if (kind != TargetKind::kTagGrid) {
    return square * Eigen::Vector2d(id % (columns - 1) + 1, id / (columns - 1) + 1);
  }
  const int tag = id / 4, k = id % 4;
  const double pitch = marker + gap;
  const Eigen::Vector2d top_left(gap + pitch * (tag % columns), gap + pitch * (tag / columns));
  return top_left + marker * Eigen::Vector2d(k == 1 || k == 2, k >= 2);
}

Eigen::Vector2d CalibrationTarget::size() const {
  if (kind != TargetKind::kTagGrid) return square * Eigen::Vector2d(columns, rows);
  return Eigen::Vector2d::Constant(gap) + (marker + gap) * Eigen::Vector2d(columns, rows);
}

std::string CalibrationTarget::describe() const {
  switch (kind) {
    case TargetKind::kChessboard:
      return fmt::format("chessboard of {}x{} squares of {:g} mm", columns, rows, 1e3 * square);
    case TargetKind::kCharuco:
      return fmt::format("ChArUco board of {}x{} squares of {:g} mm, {}", columns, rows,
                         1e3 * square, dictionary);
    case TargetKind::kTagGrid:
      return fmt::format("grid of {}x{} tags of {:g} mm, {} from id {}", columns, rows,
                         1e3 * marker, dictionary, first_id);
  }
  return "";
}

bool CalibrationTarget::same_after_half_turn() const {
  return kind == TargetKind::kChessboard && (columns - rows) % 2 == 0;
}

}  // namespace sightline
