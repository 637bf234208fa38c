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
#include "sightline/model/object.hpp"
#include "sightline/model/observation.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/model/shape_symmetry.hpp"
#include "sightline/observe/shape/surface_sample.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"
#include "sightline/observe/terms/line_term.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"
#include "sightline/observe/track/found_view.hpp"

namespace sightline {

/// A rotation and a translation that a pose's standard deviations are compared with.
struct PoseSigma {
  double rotation = 0;     ///< [rad]
  double translation = 0;  ///< [m]

  bool operator==(const PoseSigma&) const = default;
};

/// How objects are measured by their outline, edges and texture. Measured reasons:
/// docs/tracking.md.
struct TrackerOptions {
  /// What a whole outline or set of edges may be wrong by (see LineError).
  LineError region_error{0.50, 0.30};
  LineError edge_error{0.15, 0.15};
  LineError limb_error{0.15, 0.40};  ///< steps of light where a smooth surface turns away
  /// The same of texture points: their places come from poses that were estimated.
  ViewError texture_error{0.5, 0.006};
  ViewError print_error{0.2, 0.002};  ///< of points of the mesh's own print
  /// Least noise of one line's offset [px], whatever the image says.
  double region_floor_px = 0.35;
  double edge_floor_px = 0.20;
  double texture_floor_px = 0.15;
  /// Most noise of one line or point, from the residuals, with which it still agrees [px].
  double max_line_noise_px = 2.5;
  double max_edge_noise_px = 0.75;
  double max_texture_noise_px = 0.8;
  double min_edge_step = 3.0;  ///< [gray levels/px] of light across an edge
  double edge_reach_px = 5;    ///< to either side of a projected edge that is searched
  /// Exponent from image level to light, as in FiducialOptions.
  double gamma = 2.2;
  double blur_px = 0.8;  ///< of a sharp outline in the image: lens and pixel, one sigma
  double huber = 2.0;    ///< robust threshold [sigma]
  /// Lines closer together than this along the outline are wrong together [px].
  double region_correlation_px = 10.0;
  double edge_correlation_px = 5.0;
  double learning_rate = 0.15;  ///< of the colors, per accepted frame
  /// Colors are learned only if the estimate of their frame puts the outline this close to where
  /// they were read [px, rms].
  double learn_distance_px = 2.0;
  /// Texture points get their place on the mesh from an estimate at least this precise.
  PoseSigma texture_pose{0.010, 0.004};
  /// An estimate at least this precise says where an outline must be: cameras that miss it there
  /// again and again have colors that are no longer true.
  PoseSigma held_pose{0.10, 0.03};
  /// A prediction is never believed better than this: it only places lines.
  PoseSigma placing_floor{0.006, 0.0015};
  /// A camera sees the object if so many of the lines that should be visible agree ...
  int min_lines = 24;
  double min_line_share = 0.35;
  /// ... and inside and outside look different by so much (mean evidence, 0 .. 1).
  double min_evidence = 0.25;
  double min_separation = 0.2;  ///< and so do the histograms (see TrackResult)

  bool operator==(const TrackerOptions&) const = default;
};

/// One object as the trackers of all cameras share it.
struct TrackedObject {
  ObjectId id;
  std::shared_ptr<const ViewpointModel> views;
  Modalities modalities;
  DepthRendererFactory depth;         ///< for texture; empty: without
  ShapeSymmetry shape_symmetry = {};  ///< poses that the shape cannot tell apart
  SurfaceSamples samples = {};        ///< the mesh's colors, to tell them apart; null: none
  bool printed = false;  ///< they are those of a print: where it does not show, the object is not
  PrintRendererFactory print = {};  ///< then, for its corners; empty: without
  /// Of a coarser mesh, to compare poses that look nearly the same and to check the image around
  /// the object; empty: without.
  DepthRendererFactory silhouette = {};
  /// Of the mesh in its own colors, to compare such poses where these differ; empty: without.
  ColorRendererFactory colors = {};
};

/// The static scene as one camera sees it: what hides an object.
struct SceneDepth {
  DepthTile tile;  ///< whole image; width 0: nothing
  std::shared_ptr<const void> owner;
};

/// Measures known objects in one camera's frames by their outline, edges and texture, around where
/// the estimate says they are. It never finds an object by itself: an object whose track has no
/// pose yields an observation without terms. One tracker per camera; passive; one thread at a time.
class ObjectTracker {
 public:
  /// Objects without region, edge or texture modality are left out. Refused: numbers out of range.
  static Result<std::unique_ptr<ObjectTracker>> create(const CalibratedCamera& camera, CameraId id,
                                                       std::vector<TrackedObject> objects,
                                                       const TrackerOptions& options = {},
                                                       SceneDepth scene = {});
  ~ObjectTracker();

  /// Objects of the observations that step() makes, in their order.
  std::span<const ObjectId> objects() const;

  /// Measures the objects in a frame and appends one Observation per object of objects(). Colors
  /// and texture are learned from the frame before this one, and only if its estimate counted this
  /// camera and says `tracking`, or is degraded only because symmetric poses are possible: what is
  /// learned then says nothing of which pose it is. While that is not known, the observation tells
  /// what the mesh's colors and the texture learned before say of them
  /// (Observation::symmetric_hypotheses). Damaged frames and those of another size yield nothing.
  /// Allocates nothing but the terms that it hands out, once warm.
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);

  /// Says where a search has found an object in this camera: the next step() that has a pose of it
  /// learns its colors there, unless it knows them. Before its track is tracked, they would have
  /// to be read where it is predicted, and of what moves that is beside it.
  void note_found(FoundView view);

  /// Measures one object around a proposed pose, with colors as this frame shows them there, and
  /// names that pose as the observation's hypothesis. For detectors: refine with the terms, measure
  /// again. `covariance` (tangent, see Rigid3) says how far off the pose may be. The terms are
  /// empty if the image does not show the object there. Nothing is learned.
  Observation propose(const Frame& frame, ObjectId object, const Rigid3& world_from_object,
                      const Matrix6& covariance);

  /// What the measurement of one object in one frame came to, for metrics and tests.
  struct TrackResult {
    int lines_total = 0;    ///< of the outline, in the image and not hidden by what is known
    int lines_used = 0;     ///< that agree with a visible object
    double evidence = 0;    ///< mean of (inside - outside) / 2
    double separation = 0;  ///< of the colors inside and outside, as learned: 0 the same .. 1
    double noise_px = 0;    ///< of one line, from the residuals
    /// Found by the colors of each stretch of its outline, because as a whole they do not tell.
    bool local_colors = false;
    double edge_support = 0;  ///< then: lines with an edge, 0 as many as by chance .. 1 all
    int edges_used = 0;
    double edge_noise_px = 0;
    int points_used = 0;          ///< of texture
    bool by_print = false;        ///< these are the mesh's own, not learned from images
    bool by_print_alone = false;  ///< the outline does not show
    bool seen = false;
    bool learned = false;  ///< colors, from the frame before
  };
  /// Of the last step() or propose(); by object as in objects().
  const TrackResult& last_result(size_t index) const;

 private:
  class Impl;
  explicit ObjectTracker(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
