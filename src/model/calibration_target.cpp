// SPDX-License-Identifier: Apache-2.0
#include "sightline/model/calibration_target.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "sightline/base/check.hpp"

namespace sightline {

int CalibrationTarget::own_corner_count() const {
  return kind == TargetKind::kTagGrid ? 4 * columns * rows : (columns - 1) * (rows - 1);
}

int CalibrationTarget::corner_count() const {
  int count = own_corner_count();
  for (const CalibrationTarget& other : others) count += other.own_corner_count();
  return count;
}

const CalibrationTarget& CalibrationTarget::part(int id) const {
  const CalibrationTarget* found = this;
  for (const CalibrationTarget& other : others) {
    if (id < found->own_corner_count()) break;
    id -= found->own_corner_count();
    found = &other;
  }
  return *found;
}

Eigen::Vector2d CalibrationTarget::corner(int id) const {
  SL_CHECK(id >= 0 && id < corner_count(), "corner of a target");
  int end = own_corner_count();
  for (size_t i = 0; id >= end; ++i) {
    const int count = others[i].own_corner_count();
    if (id < end + count) return others[i].corner(id - end);
    end += count;
  }
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
  if (!others.empty()) {
    CalibrationTarget first = *this;
    first.others.clear();
    std::string text = first.describe();
    for (const CalibrationTarget& other : others) text += "; " + other.describe();
    return text;
  }
  const std::string stands = fixed ? "fixed " : "";
  switch (kind) {
    case TargetKind::kChessboard:
      return stands +
             fmt::format("chessboard of {}x{} squares of {:g} mm", columns, rows, 1e3 * square);
    case TargetKind::kCharuco:
      return stands + fmt::format("ChArUco board of {}x{} squares of {:g} mm, {}", columns, rows,
                                  1e3 * square, dictionary);
    case TargetKind::kTagGrid:
      return stands + fmt::format("grid of {}x{} tags of {:g} mm, {} from id {}", columns, rows,
                                  1e3 * marker, dictionary, first_id);
  }
  return "";
}

bool CalibrationTarget::same_after_half_turn() const {
  const bool own = kind == TargetKind::kChessboard && (columns - rows) % 2 == 0;
  return own || std::any_of(others.begin(), others.end(), [](const CalibrationTarget& other) {
           return other.same_after_half_turn();
         });
}

}  // namespace sightline
