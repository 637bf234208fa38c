// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sightline/geometry/rigid3.hpp"

namespace sightline {

enum class TargetKind : uint8_t { kChessboard, kCharuco, kTagGrid };

/// What the square at the top-left of a ChArUco print is. OpenCV prints dark squares there from 4.6
/// on; older prints of boards with an even number of rows start with a marker. With an odd number
/// of rows both are the same.
enum class CharucoLayout : uint8_t { kAny, kDarkFirst, kMarkerFirst };

/// A flat calibration target and the corners on it. Frame: origin at the top-left outer corner of
/// the print, x right, y down, z into the board [m]. Corner ids:
///     chessboard, ChArUco   inner corners, row by row from the top-left, from 0
///     tag grid              4 * tag + 0..3: top-left, top-right, bottom-right, bottom-left of the
///                           black border; tags row by row from the top-left, from 0
///
/// Targets that are shown beside it are its `others`: each has a frame of its own, and their ids go
/// on where those of the one before end. What knows nothing of them sees one target with more
/// corners, of which no view shows those of two.
struct CalibrationTarget {
  std::string name = "target";
  TargetKind kind = TargetKind::kCharuco;
  int columns = 0, rows = 0;  ///< squares, or tags
  double square = 0;          ///< chessboard, ChArUco: side of a square [m]
  double marker = 0;          ///< ChArUco, tag grid: outer edge of the black border [m]
  double gap = 0;             ///< tag grid: from tag to tag, and around them [m]
  std::string dictionary;     ///< ChArUco: "5X5_100"; tag grid: family, "tag36h11"
  int first_id = 0;           ///< tag grid: id of the tag at the top-left
  bool inverted = false;      ///< ChArUco: printed white on black
  CharucoLayout layout = CharucoLayout::kAny;
  bool fixed = false;  ///< it stands in the room and is not moved
  /// Where it is known to stand in the world (surveyed), of a fixed one.
  std::optional<Rigid3> world_from_target{};
  std::vector<CalibrationTarget> others{};  ///< without others of their own

  bool operator==(const CalibrationTarget&) const = default;

  int own_corner_count() const;  ///< without the others
  int corner_count() const;
  /// The target, itself or one of the others, that has this corner.
  const CalibrationTarget& part(int id) const;
  /// Corner `id`, 0 <= id < corner_count(), in the frame of the target that has it [m].
  Eigen::Vector2d corner(int id) const;
  /// Size of the pattern, margins aside [m].
  Eigen::Vector2d size() const;
  /// "ChArUco board of 8x6 squares of 60 mm, 5X5_100", for messages.
  std::string describe() const;
  /// A chessboard of which two views half a turn apart look the same: inner corners even x even or
  /// odd x odd.
  bool same_after_half_turn() const;
};

/// A dark rectangle of a print, in the target's frame [m].
struct PrintedRect {
  double left = 0, top = 0, width = 0, height = 0;
};

}  // namespace sightline
