// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/lookalikes.hpp"
#include "sightline/model/object.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/observe/corner_term.hpp"
#include "sightline/observe/line_term.hpp"
#include "sightline/observe/surface_spot.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline {

/// How objects are measured by their own look. Measured reasons: src/observe/README.md.
struct TrackerOptions {
  /// What a whole outline or set of edges may be wrong by (see LineError).
  LineError region_error{0.50, 0.30};
  LineError edge_error{0.15, 0.15};
  LineError limb_error{0.15, 0.40};  ///< steps of light where a smooth surface turns away
  /// The same of texture points: their places come from poses that were estimated.
  ViewError texture_error{0.5, 0.006};
  /// Least noise of one line's offset [px], whatever the picture says.
  double region_floor_px = 0.35;
  double edge_floor_px = 0.20;
  double texture_floor_px = 0.15;
  /// Exponent from picture level to light, as in FiducialOptions.
  double gamma = 2.2;
  double blur_px = 0.8;  ///< of a sharp outline in the picture: lens and pixel, one sigma
  double huber = 2.0;    ///< robust threshold [sigma]
  /// Lines closer together than this along the outline are wrong together [px].
  double region_correlation_px = 10.0;
  double edge_correlation_px = 5.0;
  double learning_rate = 0.15;  ///< of the colours, per accepted frame
  /// A camera sees the object if so many of the lines that should be visible agree ...
  int min_lines = 24;
  double min_line_share = 0.35;
  /// ... and inside and outside look different by so much (mean evidence, 0 .. 1).
  double min_evidence = 0.25;
  double min_separation = 0.2;  ///< and so do the histograms that tell it (see Look)
};

/// One object as the trackers of all cameras share it.
struct TrackedObject {
  ObjectId id;
  std::shared_ptr<const ViewpointModel> views;
  Cues cues;
  DepthRendererFactory depth;  ///< for texture; empty: without
  Lookalikes lookalikes = {};  ///< poses that the shape cannot tell apart
  SurfaceSpots spots = {};     ///< the mesh's colours, to tell them apart; null: none
};

/// The static scene as one camera sees it: what hides an object.
struct SceneDepth {
  DepthTile tile;  ///< whole picture; width 0: nothing
  std::shared_ptr<const void> owner;
};

/// Measures known objects in one camera's frames by their outline, edges and texture, around where
/// the estimate says they are. It never finds an object by itself: an object whose track has no
/// pose yields an observation without terms. One tracker per camera; passive; one thread at a time.
class ObjectTracker {
 public:
  /// Objects without region, edge or texture cue are left out. Refused: numbers out of range.
  static Result<std::unique_ptr<ObjectTracker>> create(const CalibratedCamera& camera, CameraId id,
                                                       std::vector<TrackedObject> objects,
                                                       const TrackerOptions& options = {},
                                                       SceneDepth scene = {});
  ~ObjectTracker();

  /// Objects of the observations that step() makes, in their order.
  std::span<const ObjectId> objects() const;

  /// Looks at a frame and appends one Observation per object of objects(). Colours and texture are
  /// learned from the frame before this one, and only if its estimate counted this camera and says
  /// `tracking`, or nothing but that poses look alike is against it: what is learned then says
  /// nothing of which it is. While that is not known, the observation tells what the mesh's colours
  /// and the texture learned before say of it (Observation::alike). Damaged frames and those of
  /// another size yield nothing. Allocates nothing but the terms that it hands out, once warm.
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);

  /// Measures one object around a proposed pose, with colours as this frame shows them there, and
  /// names that pose as the observation's hypothesis. For detectors: refine with the terms, measure
  /// again. `covariance` (tangent, see Rigid3) says how far off the pose may be. The terms are
  /// empty if the picture does not look like the object there. Nothing is learned.
  Observation propose(const Frame& frame, ObjectId object, const Rigid3& world_from_object,
                      const Matrix6& covariance);

  /// What one look came to, for metrics and tests.
  struct Look {
    int lines_total = 0;    ///< of the outline, in the picture and not hidden by what is known
    int lines_used = 0;     ///< that agree with a visible object
    double evidence = 0;    ///< mean of (inside - outside) / 2
    double separation = 0;  ///< of the colours inside and outside, as learned: 0 alike .. 1
    double noise_px = 0;    ///< of one line, from the residuals
    int edges_used = 0;
    double edge_noise_px = 0;
    int points_used = 0;  ///< of texture
    bool seen = false;
    bool learned = false;  ///< colours, from the frame before
  };
  /// Of the last step() or propose(); by object as in objects().
  const Look& last_look(size_t index) const;

 private:
  class Impl;
  explicit ObjectTracker(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
