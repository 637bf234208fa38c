// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string_view>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/geometry/camera_axes.hpp"

namespace sightline {

/// What a head said of its angles.
struct AxisReading {
  Time stamp{};              ///< when it said so, on the clock of the frames
  double pan = 0, tilt = 0;  ///< [rad], as the device counts
  double zoom = 0;           ///< setting of the encoder; 0 where there is none
  bool moving = false;       ///< it has been told to turn, and says that it does

  bool operator==(const AxisReading&) const = default;
};

/// How far the angles at a time are to be believed.
enum class AxesState : uint8_t {
  kKnown,
  kSilent,     ///< no reading yet, or none for CameraAxes::stale_s
  kFrozen,     ///< it says that it turns, and the angles stand still
  kUnsettled,  ///< after a jump of its clock or angles: a few readings have to agree first
  kZoomed,     ///< the zoom is not where the lens in use was calibrated
};
/// "known", "silent", ...
std::string_view to_string(AxesState state);

/// The angles at one time.
struct AxesAt {
  double pan = 0, tilt = 0;              ///< [rad], scaled
  double pan_rate = 0, tilt_rate = 0;    ///< [rad/s]
  double pan_sigma = 0, tilt_sigma = 0;  ///< [rad]
  double zoom = 0;
  AxesState state = AxesState::kSilent;
};

/// Where a camera that turns stood when a frame was taken.
struct CameraPlace {
  Rigid3 world_from_camera;
  /// Of a tangent on the left of that (world axes) [rad, m].
  std::shared_ptr<const Matrix6> covariance;
  AxesState state = AxesState::kSilent;
  /// Those of the last moments, for whoever records the frame.
  std::vector<AxisReading> readings;

  /// Whether its image may be measured in and drawn into.
  bool trusted() const { return state == AxesState::kKnown; }
};
using CameraPlacePtr = std::shared_ptr<const CameraPlace>;

/// The readings of one head's angles over the last seconds. Between readings the angles are
/// interpolated, after the newest one they go on along the parabola through the last 0.12 s, and
/// their sigma grows with what CameraAxes::acceleration allows. Any thread.
class AxisHistory {
 public:
  /// `fx`: of the lens in use [px]; counts for cameras with a zoom table only.
  AxisHistory(const CameraAxes& axes, double fx) : axes_(axes), fx_(fx) {}

  const CameraAxes& axes() const { return axes_; }
  /// Readings in order of their stamps. A stamp that runs back, or ahead by more than kGap, and an
  /// angle that jumps further than CameraAxes::max_rate allows start anew: nothing is believed
  /// until kSettled readings agree. Those that are no numbers are ignored.
  void add(const AxisReading& reading);
  /// The angles when the light fell in: latency is accounted for here.
  AxesAt at(Time capture) const;
  /// The camera at that time. kZoomed where the zoom's focal length is 0.5 % off the lens in use.
  CameraPlace place(Time capture) const;
  CameraPlacePtr place_at(Time capture) const {
    return std::make_shared<const CameraPlace>(place(capture));
  }
  /// Forgets all.
  void clear();

  static constexpr Duration kGap = std::chrono::seconds(2);
  static constexpr int kSettled = 5;
  static constexpr Duration kKept = std::chrono::seconds(3);
  /// Angles that stand still for so long while the head says that it turns are frozen.
  static constexpr Duration kFrozenAfter = std::chrono::milliseconds(250);

 private:
  struct Curve {  ///< through the newest readings: pan and tilt by powers of time after the last
    Eigen::Matrix<double, 3, 2> coefficients = Eigen::Matrix<double, 3, 2>::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of each angle's coefficients
  };
  bool follows(const AxisReading& reading) const;
  Curve fit() const;
  AxesState state(double ahead_s) const;
  /// Both put the sigma of what is between or beyond the readings into pan_sigma.
  void interpolate(Time stamp, AxesAt& out) const;
  void extrapolate(double ahead_s, AxesAt& out) const;
  AxesAt look_up(Time capture) const;

  const CameraAxes axes_;
  const double fx_;
  mutable std::mutex mutex_;
  std::deque<AxisReading> readings_;  ///< growing stamps
  Time moved_{};                      ///< last reading whose angles differ from the one before
  int settled_ = 0;                   ///< readings in a row that agree, up to kSettled
};

}  // namespace sightline
