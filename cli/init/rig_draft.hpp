// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "init/camera_choice.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline::cli {

/// One [[camera]] that will be written.
struct DraftCamera {
  std::string name, source;
  std::vector<std::string> remarks;  ///< lines above it, without "# "
  std::string format;                ///< empty: no such key
  double rate_hz = 0;                ///< 0: no such key
  int width = 0, height = 0;
  std::string recorded_as;                      ///< of a recording, where not its name
  std::optional<CalibratedCamera> calibration;  ///< empty: nobody knows its lens and place
};

/// An installation before it is written.
struct RigDraft {
  std::vector<DraftCamera> cameras;
  std::vector<std::string> left_out;            ///< cameras that were found and cannot be used
  std::vector<std::filesystem::path> objects;   ///< object files
  std::vector<std::string> object_remarks;      ///< above them
  std::vector<std::filesystem::path> scene;     ///< meshes
  std::optional<std::filesystem::path> source;  ///< one file that has all calibrations
};

/// What the command line says about cameras.
struct CameraWishes {
  std::vector<std::string> cameras;        ///< NAME=SOURCE
  std::filesystem::path recording;         ///< all cameras, objects and the scene of it
  std::filesystem::path listing;           ///< `sightline cameras --json` of another host
  std::map<std::string, ImageSize> sizes;  ///< by camera; "": of all others
  std::filesystem::path calibration;       ///< of cameras that have one
};

/// Finds out what there is to write; opens the network cameras that are named, to learn their size.
/// kNotFound: there is no camera at all.
Result<RigDraft> draft_rig(const CameraWishes& wishes);

/// A lens as webcams have one (58 degrees wide), at a place in a row: something to show the camera
/// with until it is calibrated. Not to measure with.
Result<CalibratedCamera> nominal_calibration(const DraftCamera& camera, size_t place);

}  // namespace sightline::cli
