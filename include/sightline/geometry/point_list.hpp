// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// Points as a text file lists them, in the file's order.
struct PointList {
  std::vector<Eigen::Vector3d> points;  ///< [m]
  std::vector<size_t> lines;            ///< line of the file that each stands in, from 1
};

/// Reads a text file of one point a line: three numbers between blanks, commas or semicolons. Empty
/// lines, and what follows '#', are skipped. `meters_per_unit` scales the numbers. A file without
/// points, a line with another count of numbers, and numbers that are not finite are errors with
/// `where` = file:line.
Result<PointList> read_points(const std::filesystem::path& path, double meters_per_unit = 1.0);

/// The same from memory; `where` names the file in errors.
Result<PointList> parse_points(std::string_view text, const std::string& where,
                               double meters_per_unit = 1.0);

}  // namespace sightline
