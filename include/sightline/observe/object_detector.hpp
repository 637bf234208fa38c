// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline {

struct ForegroundMap;

struct DetectorOptions {
  /// Distances from a camera at which the object is looked for [m]; 0: from where the cameras look
  /// and how large the object is in their pictures.
  double nearest = 0, farthest = 0;
  /// Least evidence of a pose that is accepted (JointEvidence::total).
  double accept = 0.4;
  /// What is within this share of the best pose's evidence is as possible as that.
  double margin = 0.82;
  int refined = 14;           ///< poses that are fitted to the pictures
  size_t scan_hits = 12000;   ///< places in one camera that are tried in the others
  double sigma_px = 2.5;      ///< of one fitted line, full-size pixels
  double independent = 0.06;  ///< share of the lines that is worth an independent measurement
};

/// A camera that the detector may use.
struct DetectorCamera {
  CameraId id;
  CalibratedCamera calibration;
};

/// A pose that the detector found, at the time of the detection.
struct DetectedPose {
  Rigid3 world_from_object;
  Vector6 twist = Vector6::Zero();  ///< [rad/s, m/s], body frame; zero for cameras that expose
                                    ///< together
  double evidence = 0;              ///< sum over cameras
  int cameras = 0;                  ///< that show the object there
};

/// What one detection came to.
struct Detection {
  Time time{};  ///< capture of the camera that was searched
  /// Accepted poses, best first; empty: not found. More than one: they look alike, and nothing in
  /// the pictures decides between them.
  std::vector<DetectedPose> poses;
  /// One per camera that shows the object at the best pose, at that camera's own capture time, in
  /// order of time. Each has a term of kind "detection" and all poses as hypotheses.
  std::vector<Observation> observations;
  double runner_up = 0;  ///< evidence of the best pose that was not accepted
};

/// A pose that something beside the outline proposes: taught features.
struct ProposedPose {
  Rigid3 world_from_object;  ///< at the time of the proposals
  Vector6 twist = Vector6::Zero();
  double evidence = 0;             ///< of its own; 1 is as good as two cameras' outlines
  std::vector<PoseTermPtr> terms;  ///< by camera of the detector, what it measured; null: nothing
};
struct Proposals {
  Time time{};
  std::vector<ProposedPose> poses;  ///< best first
};

/// Finds one object anywhere in the pictures of a calibrated rig: from its mesh alone, without
/// training or prior pose. Every view, turn, distance and place is tried in one camera
/// (a different one each time) on edge directions, the best in all cameras jointly; the best of
/// those are fitted to the edges of all pictures, each at its own capture time with a common
/// velocity, and judged by their edges and by how unlike the colours inside and outside of the
/// outline are. The winner is compared with itself turned over, so that a symmetry comes out even
/// if only one of its poses was found.
///
/// Where the cameras' backgrounds are known, poses whose silhouettes fit what is new in the
/// pictures take part too, and the search for edges keeps to what is new; if that finds nothing,
/// every second search goes over everything. docs/detection.md says more.
///
/// Passive; one thread at a time. The same frames give the same detections.
class ObjectDetector {
 public:
  /// Refused: no camera, numbers out of range.
  static Result<std::unique_ptr<ObjectDetector>> create(ObjectId object,
                                                        std::shared_ptr<const ViewpointModel> views,
                                                        std::vector<DetectorCamera> cameras,
                                                        const DetectorOptions& options = {});
  ~ObjectDetector();

  /// Remembers the frame at half size, in place of the camera's last one. About 0.1 ms. Frames of
  /// unknown cameras, damaged ones and those of another size are ignored. `camera` counts, not what
  /// the frame says of it. `foreground`: what is new in this frame, of half its size; null: not
  /// known.
  void add_frame(CameraId camera, const Frame& frame, const ForegroundMap* foreground = nullptr);

  /// Looks for the object in the newest frames; pictures that are older than the newest one by more
  /// than 100 ms do not take part. About 0.3 s of CPU, less where backgrounds are known.
  Detection detect();

  /// The same test for poses that were found otherwise, in the same frames: what their terms say
  /// and how well outline and colours agree there count together, and the best one needs the same
  /// margin over all others and over itself turned over. The poses stay where they are proposed.
  /// One camera is enough if the proposals' own evidence is. A few milliseconds.
  Detection judge(const Proposals& proposals);

  /// Moves accepted poses of an earlier detection to the newest frames and judges them again.
  /// A few milliseconds.
  Detection follow(const Detection& earlier);

 private:
  class Impl;
  explicit ObjectDetector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
