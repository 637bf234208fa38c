// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "observe/detect/contour_search.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/pose_fit.hpp"
#include "sightline/observe/detect/detector_options.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/observe/terms/pose_proposals.hpp"

namespace sightline::observe {

/// A pose and the evidence for it.
struct JudgedPose {
  PoseFit fit;
  double evidence = 0;                     ///< of outline and proposal
  double outline = 0;                      ///< of the outline alone
  int cameras = 0;                         ///< that see the outline
  const ProposedPose* proposal = nullptr;  ///< null: fitted to edges
  std::vector<double> contour;             ///< local contrast by camera; empty: not asked for
};

/// Evidence of one camera: the share of its lines that agree times the contrast of the outline,
/// less what clutter gives; 0 or more.
double camera_evidence(const CameraFit& fit);

/// Last stage of a detection: one test for all poses, wherever they come from.
class DetectionJudge {
 public:
  /// `center` [m, object frame] and `radius` [m] of the object.
  DetectionJudge(ObjectId object, const DetectorOptions& options, const Eigen::Vector3d& center,
                 double radius)
      : object_(object), options_(options), center_(center), radius_(radius) {}

  ObjectId object() const { return object_; }
  /// So many objects that look the same are missing, too: as many other places may have as much.
  void expect(size_t alike) { alike_ = alike; }

  /// Evidence of a pose; `proposal`: where it comes from, adds its own. It must outlive the result.
  JudgedPose judge(PoseFit fit, const ProposedPose* proposal = nullptr) const;

  /// Whether the evidence is enough, with so many cameras taking part: the outline has to agree in
  /// two cameras, or at all with what was proposed: of the two poses of a flat thing in one image
  /// the wrong one may have as many features.
  bool acceptable(const JudgedPose& pose, size_t cameras) const;
  /// Acceptable beyond doubt: other poses need not be searched for.
  bool clear(const JudgedPose& pose, size_t cameras) const;

  /// Fills poses, observations and runner_up of `out`: the acceptable pose with most evidence, and
  /// all others that have about as much. `judged` is sorted.
  void decide(const DetectorFrames& frames, std::vector<JudgedPose>& judged, Detection& out) const;

  /// The same by local contrast: the best pose needs at least `min_score`, and what is best at
  /// another place may have `max_rival` of that; poses at its own place that are about as good are
  /// possible, too.
  void decide_by_contour(const DetectorFrames& frames, const std::vector<ContourPose>& poses,
                         double min_score, double max_rival, Detection& out) const;
  /// Score of the best of these poses at another place than the first, as it counts beside that; 0:
  /// none.
  double best_rival(const std::vector<ContourPose>& poses) const;

 private:
  /// Poses and observations of what is accepted, best first.
  void report(const DetectorFrames& frames, const std::vector<const JudgedPose*>& accepted,
              Detection& out) const;
  bool same_hypothesis(const JudgedPose& a, const JudgedPose& b) const;
  /// Their middles are further apart than one place is wide.
  bool elsewhere(const PoseFit& a, const PoseFit& b) const;
  Observation observation_of(const DetectorFrames& frames, size_t camera,
                             const std::vector<const JudgedPose*>& poses) const;
  LinearizedTerm measurement(const DetectorFrames& frames, size_t camera, const JudgedPose& pose,
                             const Rigid3& here) const;
  LinearizedTerm measurement(const CameraFit& fit) const;

  const ObjectId object_;
  const DetectorOptions options_;
  const Eigen::Vector3d center_;
  const double radius_;
  size_t alike_ = 0;
};

}  // namespace sightline::observe
