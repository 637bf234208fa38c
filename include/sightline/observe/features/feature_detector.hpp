// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/base/executor.hpp"
#include "sightline/base/result.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/features/feature_model.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/observe/terms/pose_proposals.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"

namespace sightline {

/// Which features of an image are matches of trained ones.
struct FeatureMatchOptions {
  int per_image = 2500;       ///< ORB features of one image, strongest first, 50..10000
  int min_per_place = 500;    ///< where only the place of an earlier detection is searched
  int max_bits = 70;          ///< that may differ between a feature and the trained one
  double ratio = 0.85;        ///< of its bits to those of the best feature at another place
  double other_place = 0.01;  ///< [m] what counts as another place on the object
  /// Matches so close together in the image and on the object [m] are one at several scales.
  double same_px = 2, same_place = 0.004;
  /// Noise of a match, one coordinate [px]: of the finest features and of coarser ones by their
  /// size. Matches of an image closer together than `correlation_px` are wrong together.
  double sigma_px = 0.4;
  double correlation_px = 8;
};

/// Which poses the matches determine.
struct FeaturePoseOptions {
  double inlier_px = 3;       ///< reprojection error of a match that supports a pose
  int min_inliers = 8;        ///< matches that support it, of all cameras ...
  double min_spread = 0.008;  ///< ... root mean square distance from their middle on the object [m]
  double max_sigma_deg = 4;   ///< a pose that is less certain is none: of the worst direction ...
  double max_sigma_m = 0.012;  ///< ... [m]
  double min_tilt_deg = 15;    ///< between line of sight and normal of what one camera sees flat
  int min_of_view = 8;         ///< matches with which a camera counts as seeing the object
  double max_twist = 5;        ///< [sigma of 1 m/s, 3.5 rad/s] poses that move faster are none
  double huber = 2.5;          ///< [sigma]
  /// What a whole view may be wrong by; the trained places come from poses that have errors too.
  ViewError view_error{0.5, 0.006};
};

/// Evidence of a pose: max (1 - exp(-(support - chance) / usual)) (support / that of the best)^2,
/// support the number of matches weighted by how well they fit. It levels off because features seen
/// from another side than trained are off by a pixel in common; of a plane's two poses the right
/// one has more support all the same (docs/detection.md, "A print").
struct FeatureEvidenceOptions {
  double max = 0.6, chance = 4, usual = 24;
};

/// Chosen on `bench` (a printed carton, trained in one part of the recording and found in
/// another) and on rendered cartons in other rooms; docs/detection.md has the figures.
struct FeatureDetectorOptions {
  FeatureMatchOptions match;
  FeaturePoseOptions pose;
  FeatureEvidenceOptions evidence;
  /// Frames that are older than the newest one by more than this do not take part.
  Duration max_age = std::chrono::milliseconds(100);
  /// How far an object may be from where an earlier detection's velocity takes it [m].
  double max_displacement = 0.08;
};

/// Proposes poses of one object by its trained features, in the images of all cameras at once and
/// without prior pose: matches by Hamming distance with the ratio to the best other place (Lowe,
/// 2004), poses from groups of matches that agree in place, orientation and size (Hough clustering;
/// P3P, both poses of flat parts, joint fit through the full lenses with a common velocity).
/// ObjectDetector::judge() says which of them to believe. 40 to 80 ms of CPU a camera. Passive; one
/// thread at a time; deterministic.
class FeatureDetector {
 public:
  /// Refused: no camera, a model without features, numbers out of range. `executor` shares the
  /// cameras out; the result does not depend on it.
  static Result<std::unique_ptr<FeatureDetector>> create(std::shared_ptr<const FeatureModel> model,
                                                         std::vector<DetectorCamera> cameras,
                                                         const FeatureDetectorOptions& options = {},
                                                         Executor executor = run_serially);
  ~FeatureDetector();

  /// As ObjectDetector::add_frame(): keeps a copy of the gray image.
  void add_frame(CameraId camera, const Frame& frame);

  /// Searches every camera's newest frame that no call has searched yet, if it is not too old.
  /// Empty: nothing that was trained is there, or too little to be sure of a pose. The terms are by
  /// camera as given to create().
  PoseProposals propose();

  /// The same near poses of an earlier detection only, as far as their velocity and
  /// `max_displacement` reach: some 10 ms a camera.
  PoseProposals propose_near(const Detection& earlier);

 private:
  class Impl;
  explicit FeatureDetector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
