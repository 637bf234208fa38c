// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/observe/corner_term.hpp"
#include "sightline/observe/feature_model.hpp"
#include "sightline/observe/object_detector.hpp"

namespace sightline {

struct FeatureDetectorOptions {
  int per_picture = 2500;   ///< ORB features of one picture, strongest first, 50..10000
  int most_bits = 70;       ///< that may differ between a feature and what it was taught as
  double ratio = 0.85;      ///< of its bits to those of the best feature at another place
  double elsewhere = 0.01;  ///< [m] what counts as another place
  double inlier_px = 3;     ///< reprojection error of a match that supports a pose
  int min_inliers = 14;     ///< matches that support it, of all cameras ...
  double min_spread =
      0.008;  ///< ... of them on the object: root mean square distance from their middle [m]
  double most_sigma_deg = 4;    ///< a pose that is less certain is none: of the worst direction ...
  double most_sigma_m = 0.012;  ///< ... [m]
  double least_tilt_deg = 15;   ///< between line of sight and normal of what one camera sees flat
  /// Noise of a match, one coordinate [px]: of the finest features and of coarser ones by their
  /// size. Matches of a picture closer together than `correlation_px` are wrong together.
  double sigma_px = 0.4;
  double correlation_px = 8;
  double huber = 2.5;  ///< [sigma]
  /// What a whole view may be wrong by; the taught places come from poses that have errors too.
  ViewError view_error{0.5, 0.006};
  /// Evidence of a pose: most (1 - exp(-(support - chance) / usual)) sqrt(support / that of the
  /// best), support the number of matches weighted by how well they fit. It levels off because
  /// features seen from another side than taught are off by a pixel in common, so that the wrong
  /// one of a plane's two poses may fit better: the outline decides between those.
  double most = 0.6, chance = 8, usual = 24;
  double most_twist = 5;  ///< [sigma of 1 m/s, 3.5 rad/s] poses that move faster are none
};

/// Proposes poses of one object by its taught features, in the pictures of all cameras at once and
/// without prior pose: matches by Hamming distance with the ratio to the best other place (Lowe,
/// 2004), poses from matches of all cameras (P3P, RANSAC, both poses of flat parts, joint fit
/// through the full lenses with a common velocity). ObjectDetector::judge() says which of them to
/// believe. About 60 ms of CPU a camera. Passive; one thread at a time; deterministic.
class FeatureDetector {
 public:
  /// Refused: no camera, a model without features, numbers out of range.
  static Result<std::unique_ptr<FeatureDetector>> create(
      std::shared_ptr<const FeatureModel> model, std::vector<DetectorCamera> cameras,
      const FeatureDetectorOptions& options = {});
  ~FeatureDetector();

  /// As ObjectDetector::add_frame(): keeps a copy of the grey picture.
  void add_frame(CameraId camera, const Frame& frame);

  /// Looks in every camera's newest frame that no call has looked at yet and that is not older than
  /// the newest one by more than 100 ms. Empty: nothing that was taught is there, or too little to
  /// be sure of a pose. The terms are by camera as given to create().
  Proposals propose();

  /// The same near poses of an earlier detection only, as far as their velocity and 8 cm: some 10
  /// ms a camera.
  Proposals propose_near(const Detection& earlier);

 private:
  class Impl;
  explicit FeatureDetector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
