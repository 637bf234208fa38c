// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/model/scene_points.hpp"

namespace sightline {

struct StereoPointOptions {
  int max_corners = 300;         ///< of one pair, strongest first
  int max_edges = 700;           ///< of one pair, strongest first
  int spacing_px = 3;            ///< least distance between points of one image
  int patch_radius_px = 4;       ///< compared patches are squares of 2 radius + 1
  double smoothing_px = 0.8;     ///< one sigma of the Gaussian over both images
  double min_gradient = 4;       ///< [levels/px] of an edge, after smoothing
  double min_score = 0.90;       ///< normalized correlation of the patches
  double min_margin = 0.05;      ///< of the best place over any other one along the curve
  double check_px = 1.0;         ///< matched back, the point must come out this close
  double min_edge_angle = 0.44;  ///< [rad] between an edge and the epipolar curve (25 deg)
  double min_sigma_px = 0.12;    ///< floor of a pixel's standard deviation
  double min_angle = 0.03;       ///< [rad] between the rays of a pair: less says nothing of depth
  double max_angle = 0.70;       ///< more, and the images look too different (40 deg)
};

/// A camera's image as the reconstruction sees it.
struct StereoView {
  /// Its pose may be another than the calibrated one: of a moving object seen at another time, put
  /// the camera where it would have to stand for the object to be where it is at the time asked for
  /// (moved_with()).
  const CalibratedCamera* camera = nullptr;
  PlaneView gray;
};

/// Where points are wanted: a ball in the world [m].
struct StereoRegion {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0.1;
};

/// How many points each check left, over all calls.
struct StereoPointCounters {
  size_t corners = 0;  ///< corners and edges detected in the first view ...
  size_t edges = 0;
  size_t unmatched = 0;  ///< ... of these: nothing similar on the curve,
  size_t ambiguous = 0;  ///< several similar places,
  size_t unchecked = 0;  ///< matched back elsewhere,
  size_t outside = 0;    ///< not in the region, or rays that do not meet
  size_t points = 0;     ///< reconstructed
};

/// Reconstructs corner and edge points from two cameras at a time. Corners (Shi and Tomasi, 1994)
/// and edge points (Canny, 1986) of the first view, sub-pixel, are searched along their epipolar
/// curve in the second: the exact curve through both lenses, since candidates are points on the ray
/// in space. Patches are compared by normalized correlation after the affine map of a plane at the
/// candidate, which is tilted until it fits best; the place along the curve is refined by
/// Gauss-Newton. A match counts if the patches correlate, no other place of the curve comes near,
/// and matching back ends where it started. The point and its covariance are those of
/// triangulate(). Pixels alone are used: no mesh, no pose beyond the region. Passive; one thread at
/// a time; deterministic.
class StereoPointFinder {
 public:
  explicit StereoPointFinder(const StereoPointOptions& options = {}) : options_(options) {}

  /// Appends the points of the first view that the second confirms. Views of different size than
  /// their camera give nothing.
  void find(const StereoView& first, const StereoView& second, const StereoRegion& region,
            std::vector<ScenePoint>& out);

  const StereoPointOptions& options() const { return options_; }
  const StereoPointCounters& counters() const { return counters_; }

 private:
  StereoPointOptions options_;
  StereoPointCounters counters_;
};

/// Pairs of cameras that suit: for every camera the one whose view of the region's center is
/// nearest to its own, within the options' angles, both seeing the center in their images; each
/// pair once, the lower index first.
std::vector<std::pair<size_t, size_t>> stereo_pairs(std::span<const CalibratedCamera> cameras,
                                                    const StereoRegion& region,
                                                    const StereoPointOptions& options = {});

/// The camera that at `reference` sees the object as this one did when it was at `seen`
/// (world_from_object each): how free-running cameras come together on a moving object.
CalibratedCamera moved_with(const CalibratedCamera& camera, const Rigid3& seen,
                            const Rigid3& reference);

}  // namespace sightline
