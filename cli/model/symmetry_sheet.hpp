// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sightline/image/image.hpp"
#include "sightline/observe/shape/near_symmetry.hpp"
#include "sightline/observe/shape/symmetry_comparison.hpp"

namespace sightline::cli {

/// A turn after which an object looks nearly the same, or all of them about an axis.
struct ListedSymmetry {
  NearSymmetry symmetry;
  std::vector<Rigid3> turns;  ///< those of 30 degrees and more about the axis, or the one
  SymmetryBreaking broken_by;
};

/// For a person's eye, one row a turn: the object as it is, turned, and what tells, from the side
/// that hides the turn and from the one that shows it (orange: only as it is, blue: only turned,
/// yellow: nearer or farther, magenta: another color); then a map of all sides, azimuth from -180
/// to 180 degrees about the object's z, elevation from 90 at the top: black where nothing tells,
/// white where 10 % of the picture do. `coarse`: for the map.
Result<std::shared_ptr<const Image>> draw_symmetry_sheet(std::span<const ListedSymmetry> symmetries,
                                                         SymmetryComparer& comparer,
                                                         SymmetryComparer& coarse);

}  // namespace sightline::cli
