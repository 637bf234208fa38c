// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/model/calibration_target.hpp"

namespace sightline {

/// A calibration target, `target.toml`:
///
///     type = "charuco"          # or "chessboard", "tag_grid"
///     columns = 8               # squares (tags of a tag_grid), not inner corners
///     rows = 6
///     square = 0.06             # [m]; charuco, chessboard
///     marker = 0.045            # [m]; charuco, tag_grid: outer edge of the black border
///     gap = 0.015               # [m]; tag_grid: white between two tags
///     dictionary = "5X5_100"    # charuco; tag_grid: family, "tag36h11"
///     first_id = 0              # optional; tag_grid
///     inverted = false          # optional; charuco printed white on black
///     layout = "any"            # optional; charuco: "dark_first", "marker_first" (before OpenCV
///                               # 4.6, even number of rows); "any" finds out
///     fixed = false             # optional; it stands in the room for the whole recording
///     world_from_target = [[..], [..], [..], [..]]  # optional, of a fixed one: 4x4 row-major [m]
///     name = "board"            # optional
///
/// An object file with a [board] is read too. Refused with file:line:column: unknown keys, what is
/// missing, sizes that are not positive or beyond 100 m, a marker that does not fit its square,
/// fewer than 3x3 squares (1x1 tags), more than 100 of them on a side.
Result<CalibrationTarget> read_target(const std::filesystem::path& path);
Result<CalibrationTarget> parse_target(std::string_view text, const std::string& where);

/// Text that parse_target() reads back to the same.
std::string format_target(const CalibrationTarget& target);

}  // namespace sightline
