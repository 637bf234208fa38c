// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "../support/random.hpp"
#include "sightline/calibrate/head_sights.hpp"
#include "sightline/calibrate/solve_axes.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline::test {

struct SyntheticHeadOptions {
  size_t settings = 16;
  double noise_px = 0.15;
  double step_deg = 0.05;  ///< of the encoder; 0: none
  double noise_deg = 0;    ///< of each reading
  double latency_s = 0.04;
  double play_deg = 0;
  double pan_scale = 1, tilt_scale = 1;
  double pan_range_deg = 14, tilt_range_deg = 8;  ///< to either side
  double moving_s = 6;                            ///< turning to and fro behind the settings
  size_t recordings = 1;                          ///< the board elsewhere in each
  size_t fixed_cameras = 1;
  std::vector<double> zooms = {};  ///< settings at each of them; focal length 900 (1 + zoom / 1000)
  uint64_t seed = 1;
};

/// Where the motors of a head are [rad]: from place to place with a rest at each, then to and fro.
class HeadWay {
 public:
  HeadWay(const SyntheticHeadOptions& options, Random& random);
  double end() const;  ///< [s]; it begins at 0
  Eigen::Vector2d at(double time_s) const;
  double zoom(double time_s) const;
  /// Angles of the axes by milliseconds: pushed along by the edges of the gap.
  std::vector<Eigen::Vector2d> with_play(double play) const;

 private:
  double rests() const;

  std::vector<Eigen::Vector2d> places_;
  std::vector<double> zoom_;
  Eigen::Vector2d swing_;
  double moving_;
};
/// What the encoder says from a second before to a second behind, time 0 at ten seconds.
std::vector<AxisReading> read_head(const SyntheticHeadOptions& options, const HeadWay& way,
                                   Random& random);
inline constexpr Time kHeadStart = Time(std::chrono::seconds(10));
/// The focal length is as many times as large.
inline double zoom_factor(double zoom) { return 1 + zoom / 1000; }

/// A camera on a head before a board that stands still: what it and cameras that stand still see,
/// what the head says, and the truth.
struct SyntheticHead {
  HeadSights sights;
  std::vector<CalibratedCamera> truth;  ///< the head first; its lens at the first zoom
  std::vector<Rigid3> world_from_body;

  /// As it is known beforehand: the head's lens without axes, the others as they are.
  std::vector<CalibratedCamera> calibration() const;
};
SyntheticHead make_head(const SyntheticHeadOptions& options);

/// The same head with base and tilt frame where solve_axes() puts them.
CameraAxes in_its_gauge(const CameraAxes& axes);

/// solved [-] truth in the order of AxesParameter; play of `play` [rad] on both axes.
Eigen::Matrix<double, kAxesParameters, 1> axes_error(const CameraAxes& truth,
                                                     const AxesSolution& solved, double play);

}  // namespace sightline::test
