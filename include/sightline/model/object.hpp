// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// One square marker on an object. Fiducial frame: origin at its center, x right, y up, z out of
/// the print.
struct Fiducial {
  std::string family;  ///< AprilTag ("tag36h11", ...) or ArUco dictionary ("aruco_4x4_50", ...)
  int id = 0;
  double size = 0;  ///< outer edge of the black border [m]
  Rigid3 object_from_fiducial;
};

/// A printed ChArUco board that is the object. Board frame = object frame: origin at the top-left
/// outer corner of the print, x right, y down, z into the board.
struct CharucoBoard {
  int columns = 0, rows = 0;  ///< squares
  double square = 0;          ///< [m]
  double marker = 0;          ///< [m]
  std::string dictionary;     ///< "4X4_1000", ...
  bool inverted = false;      ///< printed white on black
};

enum class Symmetry : uint8_t { kNone, kAxis, kDiscrete };

/// By what an object may be measured.
struct Modalities {
  bool fiducial = true;  ///< markers and board that are on it
  bool region = true;    ///< its outline, by color
  bool edge = true;      ///< its outline and creases, by brightness
  bool texture = true;   ///< patches and corners of its surface

  /// By its own appearance, without markers.
  bool appearance() const { return region || edge || texture; }
};

/// An object file (object.toml, docs/formats.md), read and checked.
struct ObjectDescription {
  std::string name;
  std::filesystem::path file;  ///< the object file itself
  std::filesystem::path mesh;  ///< absolute or relative to the working directory
  double meters_per_unit = 1.0;
  Symmetry symmetry = Symmetry::kNone;
  Eigen::Vector3d symmetry_axis = Eigen::Vector3d::UnitZ();  ///< object frame, for kAxis
  int symmetry_order = 1;                                    ///< turns of 360/n deg, for kDiscrete
  std::vector<Fiducial> fiducials;
  std::optional<CharucoBoard> board;
  std::filesystem::path features;  ///< trained (sightline train); empty: none
  Modalities modalities;
};

}  // namespace sightline
