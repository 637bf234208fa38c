// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/time.hpp"
#include "sightline/calibrate/scene_watch.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline {

/// What is believed of a camera's place against its calibration.
enum class CalibrationState : uint8_t {
  kUnknown,   ///< not compared with others for long enough
  kInOrder,   ///< it agrees with the others
  kKnocked,   ///< it stands elsewhere since a moment (or since the start)
  kDrifting,  ///< it has been moving away slowly (temperature, a mount that gives)
  kDisputed,  ///< it and another contradict each other, and nobody tells which is wrong
  kUnfit,     ///< its image is not of what it has always seen: another camera, or another lens
};
/// "unknown", "in_order", "knocked", "drifting", "disputed", "unfit".
std::string_view to_string(CalibrationState state);
/// Whether the camera is known to stand elsewhere than its calibration says.
constexpr bool is_wrong(CalibrationState state) {
  return state == CalibrationState::kKnocked || state == CalibrationState::kDrifting;
}

struct CalibrationWatchOptions {
  Duration round = std::chrono::milliseconds(100);  ///< one look of each camera and object in each
  Duration bucket = std::chrono::seconds(2);        ///< looks that are kept as one sum
  int buckets = 300;                                ///< that many of them are kept ...
  int coarse_buckets = 240;                         ///< ... and of 30 buckets each so many
  int confirm_buckets = 4;                          ///< that agree before a camera is flagged
  double significance = 50;  ///< squared Mahalanobis distance beyond which it is
  /// One sigma of what a camera that is in order may be off, by its lens and the like. What is
  /// found is never claimed to be known better.
  double floor_rotation = 0.00014;    ///< [rad] (0.008 deg)
  double floor_translation = 0.0001;  ///< [m]
  /// One sigma of how far a camera may have been moved, before anything is known.
  double prior_rotation = 0.02;     ///< [rad]
  double prior_translation = 0.01;  ///< [m]
};

/// One camera against its calibration.
struct CameraWatch {
  CalibrationState state = CalibrationState::kUnknown;
  /// calibrated_from_now: the camera stands at world_from_camera * exp(correction); tangent and
  /// covariance as everywhere (rotation [rad], translation [m], perturbed on the right).
  Vector6 correction = Vector6::Zero();
  Matrix6 covariance = Matrix6::Zero();
  double significance = 0;   ///< correction^T (covariance + floor)^-1 correction
  Time since{};              ///< of the knock, or the begin of the drift; Time() while in order
  Time flagged{};            ///< when that was said
  bool since_start = false;  ///< it was so when the watch began
  Vector6 rate = Vector6::Zero();  ///< of a drift [rad/s, m/s]
  double vote = 1;                 ///< share of its weight that it still has, 0..1
  /// What the covariance does to a look at where the object was, against that look's own: below 1
  /// the correction is as good there as a look.
  double look_ratio = 0;
  double compared_s = 0;  ///< time in which it could be compared with others [s]
  bool by_scene = false;  ///< what stands still around it says so, too, or alone
  int patches = 0;        ///< of the room, found at the newest look
  Time looked{};          ///< that look; there is none while nothing of the room can be told
  double zoom = 1;        ///< of kUnfit: the image is so many times as large as it was; 1: not that
  std::string looks_like{};  ///< of kUnfit: the camera whose image it is; empty: not known
  /// Its room looks another, as those of most cameras do since then: the light? It says nothing.
  bool light_changed = false;
};

/// Watches over the places of a rig's cameras while it runs. Of every look of a camera at a tracked
/// object the others say where the object is; what the camera measures instead is what its own
/// place is off. These small corrections of six numbers are added up in information form over
/// minutes, and a step in them is told from a ramp. What stands still around a camera says the
/// same of it alone, object or not. docs/calibration.md has the equations.
///
/// Passive: no threads, no clock; same calls, same result. Not thread-safe. After the first minute
/// of each object nothing allocates.
class CalibrationWatch {
 public:
  /// `world_from_camera` by CameraId: the calibration in force; nothing for cameras that are not
  /// watched. `shape_symmetry` by ObjectId; a missing one is none.
  CalibrationWatch(std::vector<std::optional<Rigid3>> world_from_camera,
                   std::vector<ShapeSymmetry> shape_symmetry,
                   const CalibrationWatchOptions& options = {});
  ~CalibrationWatch();
  CalibrationWatch(CalibrationWatch&&) noexcept;
  CalibrationWatch& operator=(CalibrationWatch&&) noexcept;

  /// One camera's look at an object, and the object's track after it took part. Costs two
  /// linearizations of its terms in every round, otherwise nothing. True if the verdict on any
  /// camera is new: once in a bucket.
  bool add(const Observation& observation, const PoseTrack& track);

  /// One camera's look at what stands still around it. True if the verdict on any camera is new.
  bool add(const SceneLook& look);

  /// By CameraId; those that are not watched stay unknown.
  std::span<const CameraWatch> cameras() const;

  /// What a camera's wrong place adds to the covariance of its measurements: of a tangent
  /// on the left of world_from_object (world axes) [rad, m]. Null: not at all.
  const std::shared_ptr<const Matrix6>& extra_covariance(CameraId camera) const;

  /// A calibration that may be another; what is known is forgotten if it is.
  void set_cameras(std::vector<std::optional<Rigid3>> world_from_camera);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
