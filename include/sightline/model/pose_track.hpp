// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline {

enum class TrackState : uint8_t {
  kSearching,  ///< never found, or lost for long
  kTracking,   ///< measured, all directions well known
  kDegraded,   ///< measured, but a direction is weak, one camera only, or two poses are possible
  kCoasting,   ///< no measurement now; predicted, covariance grows
  kLost,       ///< was known; too long ago to say where it is
};
/// "searching", "tracking", ... as in poses.csv and the label.
std::string_view to_string(TrackState state);
/// True for tracking, degraded and coasting: there is a pose to draw.
constexpr bool has_pose(TrackState state) {
  return state == TrackState::kTracking || state == TrackState::kDegraded ||
         state == TrackState::kCoasting;
}

/// Why an object that is measured is `degraded`: bits.
using DegradedReasons = uint16_t;
enum DegradedReason : DegradedReasons {
  kUnconfirmed = 1,     ///< too few measurements have agreed yet
  kSeveralPoses = 2,    ///< the images fit more than one pose
  kAmbiguous = 4,       ///< its shape looks alike in other poses, and nothing tells which it is
  kWeakPosition = 8,    ///< not known well enough in a direction: weak_direction()
  kWeakRotation = 16,   ///< or about an axis
  kOneCamera = 32,      ///< one camera alone sees it, and that counts as weak
  kContradicted = 64,   ///< by the cameras of this set, as many others as hold it, or a check
  kUnexplained = 128,   ///< the images show more of the object than the pose, or less
  kPossibleSwap = 256,  ///< another object that looks alike was near: it may be that one
  kFlatPrint = 512      ///< one camera sees its print in one plane, at rest: it may be a picture
};
/// "ambiguous", "weak_position", ... in a fixed order, `separator` between them; "" for none.
std::string to_string(DegradedReasons degraded_reasons, std::string_view separator);

/// Up to 64 cameras as bits (index of CameraId).
using CameraSet = uint64_t;
constexpr CameraSet camera_bit(CameraId camera) { return CameraSet{1} << (camera.index() & 63u); }

/// The object at one time. Pose and twist tangent as in geometry/rigid3.hpp: (rotation,
/// translation) in the object's frame.
struct PoseEstimate {
  ObjectId object;
  Time time{};
  TrackState state = TrackState::kSearching;
  Rigid3 world_from_object;
  Vector6 twist = Vector6::Zero();  ///< [rad/s, m/s], body frame
  /// Of (pose, twist): 12x12 [rad, m, rad/s, m/s].
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  CameraSet cameras = 0;  ///< whose measurements were accepted at this time
  Time last_measured{};   ///< newest accepted measurement at or before `time`

  /// Second moments of the other poses that the object may have instead, about this one: poses that
  /// look alike, and turns about an axis of symmetry. Not in `covariance`.
  Matrix6 alternatives = Matrix6::Zero();
  DegradedReasons degraded_reasons = 0;  ///< meaningful while degraded

  /// Everything that is not known.
  Matrix6 pose_covariance() const { return own_covariance() + alternatives; }
  /// Next to this pose, if it is the right one of those that look alike.
  Matrix6 own_covariance() const { return covariance.topLeftCorner<6, 6>(); }
  /// Largest standard deviation over directions: of position [m], of rotation [rad].
  double sigma_translation() const;
  double sigma_rotation() const;
  /// The same of own_covariance().
  double own_sigma_translation() const;
  double own_sigma_rotation() const;
  /// World frame, unit: the direction of the largest standard deviation of position, and the axis
  /// of that of rotation, both of own_covariance().
  Eigen::Vector3d weak_direction() const;
  Eigen::Vector3d weak_axis() const;
};

/// White-noise acceleration of the constant-velocity model, as power spectral densities.
struct MotionNoise {
  double angular = 8.0;  ///< [rad/s^2 / sqrt(Hz)]
  double linear = 2.0;   ///< [m/s^2 / sqrt(Hz)]

  bool operator==(const MotionNoise&) const = default;
};

/// The estimate moved by `dt` (either sign) with its twist; covariance grows with |dt|. State and
/// cameras are unchanged. (Constant velocity on SE(3): Barfoot, State Estimation for Robotics,
/// ch. 8.)
PoseEstimate predict(const PoseEstimate& from, Time to, const MotionNoise& noise);

/// How a pose came about.
enum class PoseSource : uint8_t { kNone, kEstimated, kInterpolated, kPredicted };

struct PoseAt {
  PoseEstimate estimate;  ///< meaningful if source is not kNone
  PoseSource source = PoseSource::kNone;
};

/// Immutable snapshot of about one second of one object's estimates. Any thread.
class PoseTrack {
 public:
  PoseTrack(ObjectId object, std::vector<PoseEstimate> history, MotionNoise noise)
      : object_(object), history_(std::move(history)), noise_(noise) {}

  ObjectId object() const { return object_; }
  /// Oldest first, strictly growing times.
  const std::vector<PoseEstimate>& history() const { return history_; }
  bool empty() const { return history_.empty(); }
  const MotionNoise& noise() const { return noise_; }
  const PoseEstimate& newest() const { return history_.back(); }

  /// The pose at `time`: interpolated inside the history, predicted after its end, kNone where
  /// there is no pose (no history, before it, a searching or lost neighbor, or `coast_limit` after
  /// the newest measurement). A predicted pose that is later than `coasting_after` since the last
  /// measurement carries state kCoasting.
  PoseAt at(Time time) const;

  /// How long a pose is predicted after the last measurement before at() refuses.
  static constexpr Duration kCoastLimit = std::chrono::milliseconds(700);
  /// A pose older than this is kCoasting, not kTracking.
  static constexpr Duration kFreshFor = std::chrono::milliseconds(150);

 private:
  ObjectId object_;
  std::vector<PoseEstimate> history_;
  MotionNoise noise_;
};
using PoseTrackPtr = std::shared_ptr<const PoseTrack>;

}  // namespace sightline
