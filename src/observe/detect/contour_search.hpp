// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "observe/detect/colors/mesh_colors.hpp"
#include "observe/detect/colors/pose_pool.hpp"
#include "observe/detect/detect_constants.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/joint_search.hpp"
#include "observe/detect/pose_fit.hpp"
#include "observe/detect/silhouette_search.hpp"
#include "sightline/observe/detect/detection_trace.hpp"

namespace sightline::observe {

/// A fitted pose and how well its outline stands out from what is around it.
struct ContourPose {
  PoseFit fit;
  /// Share of its lines with an edge, times sector_contrast(); negative where the middle of the
  /// object is not in the image.
  std::vector<double> cameras;
  double score = 0;  ///< joint_score() of them: what is believed goes by it
  double rank = 0;   ///< which of several poses is the best goes by joint_rank() times `extent`
  /// One camera: how much of its image the pose explains, by the size of the object there; else 1.
  double extent = 1;
};

/// Best first.
void sort_by_rank(std::vector<ContourPose>& poses);
/// Of the scores of all cameras, negative where the pose is not in the image: the mean, of three
/// and more without the worst, because something may stand before it. Where there are several
/// cameras, one alone is not believed: 0.
double joint_score(std::vector<double> cameras);
/// The same of what poses are compared by, for each camera that has the pose in its image, of `of`
/// cameras: the mean of all. Without the worst, wrong poses win: they fit two cameras by chance
/// more often than something stands before one, and that is the same for all poses of a place.
double joint_rank(const std::vector<double>& cameras, size_t of);

/// Second and third stage of a detection, for objects that responses to edges alone do not lift
/// out of clutter: a large pool of what the scan has found, thinned by place, climbs on spread
/// responses, is ranked by the local contrast of its outline, and only then fitted.
class ContourSearch {
 public:
  ContourSearch(const TemplateBank& bank, const SilhouetteSearch& silhouettes,
                const PoseFitter& fitter, Executor executor = run_serially)
      : bank_(bank), silhouettes_(silhouettes), fitter_(fitter), executor_(std::move(executor)) {}

  /// Of what PoseVerification::verify() has made of the scan, best first; needs the response maps
  /// of the frames. `trace` null: nobody asks.
  std::vector<ContourPose> search(const DetectorFrames& frames, std::vector<JointPose> verified,
                                  const MeshColors* colors, DetectionTrace* trace,
                                  size_t pool) const;
  /// Poses that are fitted from these starts, and other orientations there. Best first.
  std::vector<ContourPose> fit(const DetectorFrames& frames,
                               std::span<const RigMotion> starts) const;
  /// A pose as it is and fitted from close by, beside poses that are fitted from other starts and
  /// from turns of it, and other orientations at the place of the best. Best first.
  std::vector<ContourPose> compare(const DetectorFrames& frames, const RigMotion& motion,
                                   std::span<const RigMotion> others) const;
  /// The score of a pose as it is.
  ContourPose evaluate(const DetectorFrames& frames, const RigMotion& motion) const;

 private:
  ContourPose scored(const DetectorFrames& frames, PoseFit fit, size_t sample_step) const;
  /// Fits these starts with little effort, and what comes near to the best score of them and of
  /// `known` with all. Best first.
  std::vector<ContourPose> fit_promising(const DetectorFrames& frames,
                                         std::span<const RigMotion> starts, double reach,
                                         double known, const MeshColors* colors) const;
  std::vector<ContourPose> fit(const DetectorFrames& frames, std::span<const RigMotion> starts,
                               double reach, const FitEffort& effort) const;
  /// Of the turns of a motion those that stand out most as they are.
  std::vector<RigMotion> best_turned(const DetectorFrames& frames, const RigMotion& motion) const;
  std::vector<JointPose> of_each_distance(const DetectorFrames& frames,
                                          std::vector<JointPose> poses, size_t max,
                                          const KeepPoses& keep) const;
  std::vector<JointPose> screened(const DetectorFrames& frames, std::vector<JointPose> poses,
                                  const MeshColors* colors, DetectionTrace* trace) const;
  void add_variants(const DetectorFrames& frames, std::vector<ContourPose>& fits,
                    const MeshColors* colors) const;
  /// All orientations at the place of the best: an outline that leaves a part of the object out
  /// stands out as well as the whole one, but more of what looks like the object lies outside.
  void reorient(const DetectorFrames& frames, std::vector<ContourPose>& fits,
                const MeshColors* mesh_colors) const;

  const TemplateBank& bank_;
  const SilhouetteSearch& silhouettes_;
  const PoseFitter& fitter_;
  const Executor executor_;
};

}  // namespace sightline::observe
