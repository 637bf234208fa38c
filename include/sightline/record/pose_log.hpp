// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/pose_track.hpp"

namespace sightline {

/// One row of poses.csv: one object at one processed frame's capture time.
struct PoseLogRow {
  Time time{};
  std::string object;
  TrackState state = TrackState::kSearching;
  std::optional<Rigid3> world_from_object;  ///< empty for searching and lost
  double sigma_t_mm = 0;
  double sigma_r_deg = 0;
  std::vector<std::string> cameras;  ///< whose measurements were accepted
};

/// The row of an estimate; `cameras` are the names by CameraId.
PoseLogRow make_pose_log_row(const PoseEstimate& estimate, std::string object,
                             std::span<const std::string> cameras);

/// "t_ns,object,state,tx,ty,tz,qw,qx,qy,qz,sigma_t_mm,sigma_r_deg,cameras"
extern const std::string_view kPoseLogHeader;

/// One line without its end: meters with 7 decimals, quaternions with 9 and qw >= 0, sigmas with 4.
/// Equal rows give equal bytes; states without a pose have empty pose fields.
std::string format_pose_row(const PoseLogRow& row);

/// Writes poses.csv; buffered. Not thread-safe.
class PoseLogWriter {
 public:
  /// Replaces a file that exists.
  static Result<std::unique_ptr<PoseLogWriter>> create(const std::filesystem::path& path);
  virtual ~PoseLogWriter() = default;  ///< close()s, ignoring errors

  virtual Status append(const PoseLogRow& row) = 0;
  virtual Status flush() = 0;  ///< to the operating system
  virtual Status close() = 0;
};

/// Reads poses.csv. A last line without its end that does not parse (crash) is left out; every
/// other fault is an error naming file:line.
Result<std::vector<PoseLogRow>> read_pose_log(const std::filesystem::path& path);
Result<std::vector<PoseLogRow>> parse_pose_log(std::string_view text, const std::string& where);

/// One row of truth.csv.
struct TruthRow {
  Time time{};
  std::string object;
  Rigid3 world_from_object;
};

/// Reads truth.csv: `t_ns,object,tx,ty,tz,qw,qx,qy,qz`; times must grow per object. Strict.
Result<std::vector<TruthRow>> read_truth(const std::filesystem::path& path);
Result<std::vector<TruthRow>> parse_truth(std::string_view text, const std::string& where);

/// A still image in which an object's pose is known.
struct ImageRow {
  std::filesystem::path image;
  std::string camera;  ///< of the calibration
  Rigid3 world_from_object;
  size_t line = 0;
};

/// Reads a list of images: `image,camera,tx,ty,tz,qw,qx,qy,qz`; names of images are relative
/// to the list. Strict; an empty list is refused.
Result<std::vector<ImageRow>> read_image_list(const std::filesystem::path& path);
Result<std::vector<ImageRow>> parse_image_list(std::string_view text,
                                               const std::filesystem::path& path);

}  // namespace sightline
