// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sightline/calibrate/calibration_watch.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/pipeline/rig.hpp"

namespace sightline {

/// The watch over an installation's cameras; null where it is off, or fewer than two observe (one,
/// if it is watched by its background).
std::unique_ptr<CalibrationWatch> make_calibration_watch(const Installation& installation,
                                                         const Rig& rig);

/// By CameraId, the calibrated places of those that observe.
std::vector<std::optional<Rigid3>> watched_places(const Installation& installation);

/// Of a camera that is CalibrationState::kUnfit: "its picture does not fit its calibration: left
/// and right look exchanged". `names`, `watches` by CameraId.
std::string unfit_words(std::span<const std::string> names, std::span<const CameraWatch> watches,
                        size_t camera);

/// "turned 0.31 deg +- 0.02, shifted 2.1 mm +- 0.3", one sigma of the largest direction.
std::string correction_words(const CameraWatch& watch);

/// Where a daemon puts the calibration that it proposes instead of the one in force: in the state
/// folder, by the content of that one, so that it is of no use for another. Empty: there is no
/// state folder.
std::filesystem::path proposal_file(const std::filesystem::path& calibration,
                                    const std::filesystem::path& state);

/// The calibration in force with new places of the cameras that are wrong, written to `file`.
/// `watches` by CameraId of the installation.
Status write_proposal(const std::filesystem::path& file, const Installation& installation,
                      std::span<const CameraWatch> watches);

/// What an acceptance changed.
struct AcceptedCamera {
  std::string name;
  double turned_deg = 0, shifted_mm = 0;
};
struct Acceptance {
  std::vector<AcceptedCamera> cameras;
  std::filesystem::path kept;  ///< the calibration that was in force
};

/// Replaces `calibration` by it with the places of `proposal`; of `cameras` only, if any are named.
/// The old file is kept beside it under the time of now, and a crash leaves one or the other.
/// Refused, with nothing written: a proposal that cannot be read, that has other cameras or lenses,
/// a camera that it does not move, nothing that differs.
Result<Acceptance> accept_proposal(const std::filesystem::path& calibration,
                                   const std::filesystem::path& proposal,
                                   std::span<const std::string> cameras = {});

}  // namespace sightline
