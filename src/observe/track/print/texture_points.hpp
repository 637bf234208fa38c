// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "observe/track/contour_lines.hpp"
#include "observe/track/line_fit.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/observe/terms/reprojection_term.hpp"

namespace sightline::observe {

/// Small patches of an object's texture, as one camera saw them, each with its place on the mesh.
/// They stay as long as they are found: an object that shows an aspect again is measured against
/// what was kept of it first, so that errors do not add up from frame to frame. (Tracking of
/// patches by an affine warp that the pose predicts: Shi and Tomasi, 1994; inverse compositional
/// alignment: Baker and Matthews, 2004.)
class TexturePoints {
 public:
  static constexpr int kRadius = 4;
  static constexpr int kSide = 2 * kRadius + 1;
  static constexpr size_t kMax = 160;      ///< that are kept
  static constexpr size_t kEnough = 24;    ///< found in an image, so that no new ones are needed
  static constexpr size_t kPerFrame = 48;  ///< tried in an image

  /// Without a factory nothing is learned from images.
  TexturePoints(const CameraModel& camera, const DepthRendererFactory& factory);
  struct Limits {
    float correlation;      ///< least of a patch that is found, normalized
    float corner_strength;  ///< least eigenvalue of the mean gradient squares
  };
  /// For take().
  TexturePoints(const CameraModel& camera, const Limits& limits);

  /// Searches the kept points around where `camera_from_object` puts them. Those that are missed
  /// again and again are dropped, unless a symmetric pose may be the true one (`ambiguous`).
  void find(const PlaneView& gray, const Rigid3& camera_from_object, const Occluders& occluders,
            bool ambiguous);
  struct Found {
    Eigen::Vector3d point_in_object;
    Eigen::Vector2d pixel;
  };
  const std::vector<Found>& found() const { return found_; }
  size_t tried() const { return tried_; }  ///< by the last find()

  /// Notes corners of the image inside the given box as candidates, if new points are needed:
  /// every few frames, and seldom on an object without texture.
  void note_candidates(const PlaneView& gray, int left, int top, int right, int bottom);
  /// Makes points of the candidates: they lie on the mesh at this pose, which the estimate of their
  /// frame gave.
  void keep_candidates(const Rigid3& camera_from_object);
  /// Makes points of the corners of an image that was rendered at this pose, of the place and size
  /// of `depth`; without meaning where that is 0.
  void take(const PlaneView& rendered, const DepthTile& depth, const Rigid3& camera_from_object);
  /// The estimate is not good enough; that says nothing of the texture.
  void drop_candidates();
  size_t kept() const { return points_.size(); }
  void forget();

 private:
  using Patch = std::array<float, kSide * kSide>;
  struct Candidate {
    int x = 0, y = 0;
    float strength = 0;
    Patch patch;
  };
  struct Point {
    Eigen::Vector3d in_object;
    Eigen::Vector3d tangent_u, tangent_v;  ///< object frame, any two along the surface
    Eigen::Matrix2d image_from_tangent;    ///< at the frame it was taken from
    Eigen::Vector3d direction;             ///< to the camera then, object frame
    Patch patch;                           ///< without its mean
    Eigen::Matrix2d gradient_squares;
    float norm = 0;
    int misses = 0;
  };
  bool align(const PlaneView& gray, const Point& point, const Eigen::Matrix2d& warp,
             Eigen::Vector2d& pixel) const;
  bool make_point(const Candidate& candidate, const DepthTile& depth,
                  const Rigid3& object_from_camera, Point& point) const;
  bool crowded(const Eigen::Vector2d& pixel, double spacing) const;
  /// The strongest corners of a box inside the image, into candidates_. With `surface`, a depth
  /// tile that the image lies on, only where a whole patch is on the surface.
  void find_corners(const PlaneView& gray, int left, int top, int right, int bottom,
                    const DepthTile* surface, size_t max);
  /// The strongest of strengths_, `spacing` [px] and more apart. Of the image `gray`, whose corner
  /// `origin` [px] is, the first of strengths_ is at `first`.
  void pick(const PlaneView& gray, const Eigen::Vector2i& first, const Eigen::Vector2i& origin,
            int columns, size_t max, double spacing);
  void make_points(const DepthTile& depth, const Rigid3& camera_from_object);

  const CameraModel& camera_;
  const Limits limits_;
  std::unique_ptr<DepthRenderer> renderer_;
  std::vector<Point> points_;
  std::vector<Candidate> candidates_;
  std::vector<Found> found_;
  std::vector<float> strengths_;
  std::vector<std::pair<int, float>> crowded_;  ///< too near to others: of strengths_, by index
  size_t tried_ = 0;
  int rest_ = 0;   ///< frames until candidates are searched again
  int pause_ = 1;  ///< and for how many after that: grows while the object shows no texture
};

}  // namespace sightline::observe
