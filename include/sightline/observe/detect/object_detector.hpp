// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/base/executor.hpp"
#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/observe/detect/color_verifier.hpp"
#include "sightline/observe/detect/detection_trace.hpp"
#include "sightline/observe/detect/detector_options.hpp"
#include "sightline/observe/detect/pose_check.hpp"
#include "sightline/observe/detect/search_hint.hpp"
#include "sightline/observe/detect/search_work.hpp"
#include "sightline/observe/shape/known_object.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/detection.hpp"
#include "sightline/observe/terms/foreground_map.hpp"
#include "sightline/observe/terms/pose_proposals.hpp"

namespace sightline {

/// Finds one object anywhere in the images of a calibrated rig: from its mesh alone, without
/// training or prior pose. Four stages:
/// - scan: every view, rotation, distance and position is tried in one camera (a different one each
///   time) on edge directions;
/// - verify: the best are moved to the depth at which all cameras agree, climb on their score, and
///   are ranked by how each stretch of their outline stands out from its own surroundings;
/// - fit: the best of those are fitted to the edges of all images, each at its own capture time
///   with a common velocity; all orientations at the best place compete;
/// - judge: by their edges and by how different the colors inside and outside of the outline are,
///   or by the stretches of the outline: that finds what is printed, gray or before clutter. The
///   winner also competes with itself rotated about its principal axes, so that a symmetry comes
///   out even if only one of its poses was found.
///
/// Where the cameras' backgrounds are known, poses whose silhouettes fit the foreground take part
/// too, and the search for edges keeps to the foreground; if that finds nothing, every second
/// search goes over everything. docs/detection.md says more.
///
/// Passive; one thread at a time. The same frames give the same detections.
class ObjectDetector {
 public:
  /// Refused: no camera, numbers out of range. `executor` shares the work of one call out; the
  /// result is the same with any.
  static Result<std::unique_ptr<ObjectDetector>> create(ObjectId object,
                                                        std::shared_ptr<const ViewpointModel> views,
                                                        std::vector<DetectorCamera> cameras,
                                                        const DetectorOptions& options = {},
                                                        Executor executor = run_serially);
  ~ObjectDetector();

  /// Keeps the frame at about 320x240 (and twice that, where the object may be small in it; larger,
  /// where it would be too small), in place of the camera's last one. About 0.1 ms. Frames of
  /// unknown cameras, damaged ones and those of another size are ignored. `camera` counts, not what
  /// the frame says of it. `foreground` of this frame, of half its size; null: not known.
  void add_frame(CameraId camera, const Frame& frame, const ForegroundMap* foreground = nullptr);

  /// What the first detect() with these colors would do once; some 10 ms.
  void prepare(const ColorVerifier& colors);

  /// What else there is, for all that follows: where one of `known` stands, this object is not
  /// (they must outlive those calls); `alike`: so many objects that look the same are looked for as
  /// well, so that as many other places may look as much like it.
  void set_others(std::vector<KnownObject> known, size_t alike);

  /// Looks for the object where somebody says it is, in the newest frames. What it finds about a
  /// pose is judged as detect() does; what it finds about a place in an image is among the
  /// candidates of detect(), if that is called next, in the same frames: rivals at other places
  /// count. About 20 ms.
  Detection detect_at(const SearchHint& hint);

  /// Looks for the object in the newest frames. About 0.3 s of CPU, less where backgrounds are
  /// known; twice that if it is not found at once. `colors` of the mesh, with the same frames, help
  /// to rank what looks like its outline; null: it has none.
  Detection detect(const ColorVerifier* colors = nullptr);

  /// Whether the last detect() has found something that stands out by too little to be believed,
  /// and newer frames have come: then look_again() says whether it is found again about there, in
  /// half of the time. Nothing where it is not; it goes on waiting to be found by detect().
  bool waits() const;
  Detection look_again(const ColorVerifier* colors = nullptr);
  /// What has been found and waits is dropped.
  void forget();

  /// The search by contours in the newest frames, with what each of its stages leaves; `colors` as
  /// for detect(). Decides nothing.
  void explain(DetectionTrace& trace, const ColorVerifier* colors = nullptr);
  /// What the frames of the newest search say of a pose, fitted within a few pixels.
  PoseAssessment assess(const Rigid3& world_from_object) const;

  /// The last stage for poses that were found otherwise, in the same frames: what their terms say
  /// and how well outline and colors agree there count together, and the best one needs the same
  /// margin over all others and over itself rotated. The poses stay where they are proposed.
  /// One camera is enough if the proposals' own evidence is. A few milliseconds.
  Detection judge(const PoseProposals& proposals);

  /// Moves accepted poses of an earlier detection to the newest frames and judges them again.
  /// A few milliseconds.
  Detection follow(const Detection& earlier);

  /// Whether the newest frames show the object rather in another orientation than at this pose of
  /// `time` with this twist (body frame). About 20 ms.
  OrientationComparison compare_orientations(const Rigid3& world_from_object, const Vector6& twist,
                                             Time time, const ColorVerifier* colors = nullptr);

  /// Searches about the place of that pose as if nothing were known of it. About 0.2 s.
  PlaceSearch search_about(const Rigid3& world_from_object, const Vector6& twist, Time time,
                           const ColorVerifier* colors = nullptr);

  /// What all calls so far have done.
  SearchWork work() const;

 private:
  class Impl;
  explicit ObjectDetector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
