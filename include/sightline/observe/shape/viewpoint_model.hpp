// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/depth_renderer.hpp"
#include "sightline/model/shape_symmetry.hpp"

namespace sightline {
namespace observe {
class RevolvedSurface;
class ViewpointModelBuilder;
}  // namespace observe

/// A point of the outline. All in the object's frame [m]. `normal` (unit) lies in the image
/// plane of the view and points out of the silhouette: project `point` and `point + small *
/// normal` to get the direction of the correspondence line in any camera near the view.
/// (Sparse viewpoint model: Stoiber et al., SRT3D, IJCV 2022, section 3.)
struct ContourSample {
  Eigen::Vector3f point;
  Eigen::Vector3f normal;
  float foreground = 0;  ///< from the point inwards along -normal, silhouette without a gap [m]
  float background = 0;  ///< from the point outwards, no silhouette [m]; at most kFreeLimit radii
  /// 1: the surface ends here at a crease or border. 0: it turns away smoothly, and its shading
  /// makes steps of light that do not lie on the outline.
  uint8_t crease = 0;
};

/// A point of an edge inside the silhouette. Object frame, meters.
struct InnerEdgeSample {
  Eigen::Vector3f point;
  Eigen::Vector3f tangent;  ///< unit, along the edge
  /// To the nearest other inner edge or outline, in the image across the edge [m]; at most
  /// kFreeLimit radii. Search no further than half of it.
  float clearance = 0;
  /// 1: crease of the mesh, the same points in every view. 0: the surface occludes itself there, so
  /// the edge wanders over the surface as the viewpoint moves (like the outline).
  uint8_t crease = 1;
};

/// One viewpoint. The spans live in the model.
struct View {
  Eigen::Vector3f direction;  ///< unit, from the mesh's center to the camera, object frame
  Rigid3 camera_from_object;  ///< of the camera it was rendered with, upright by convention
  std::span<const ContourSample> contour;
  std::span<const InnerEdgeSample> edges;
  float area = 0;            ///< of the silhouette, at the depth of the mesh's center [m^2]
  float contour_length = 0;  ///< outer and inner outlines, likewise [m]
};

struct ViewpointModelOptions {
  int subdivisions = 3;        ///< of the icosahedron, 0..4: 12, 42, 162, 642, 2562 views
  int contour_samples = 200;   ///< per view at most, 8..4096
  int edge_samples = 150;      ///< per view at most, 0..4096
  int image_px = 320;          ///< of the square rendering, 64..2048
  double distance_radii = 10;  ///< camera to center, in radii of the bounding sphere, 2..1000
  double crease_angle = 0.5;   ///< [rad] faces that meet under more than this make an edge
  double depth_jump = 0.04;    ///< of the radius: a larger step inside the silhouette is an edge
};

/// What a mesh looks like from everywhere: sparse samples of outline and inner edges for views
/// spread evenly over the sphere, made once per object and cached on disk. Immutable; any thread.
class ViewpointModel {
 public:
  /// Free distances are cut at this many radii.
  static constexpr float kFreeLimit = 2.0f;
  /// Side of the silhouette masks.
  static constexpr int kMaskSize = 32;
  /// Silhouette in the axes of View::camera_from_object, seen from afar: bit x of row y is set if
  /// the middle of the cell belongs to the object. The mask covers the square of side 2 radii about
  /// the center; x right, y down.
  using Mask = std::array<uint32_t, kMaskSize>;

  /// Renders all views; about 1 s for 15k faces. Refused: options out of range (named), a mesh that
  /// cannot be seen.
  static Result<std::shared_ptr<const ViewpointModel>> build(
      const TriangleMesh& mesh, const DepthRendererFactory& factory,
      const ViewpointModelOptions& options = {});

  /// Reads the cached model of this mesh and these options from `folder`, or builds it and writes
  /// it there (aside, synced, renamed). A file that is damaged, of another mesh, of other options
  /// or of another version of this format is rebuilt; a folder that cannot be written costs a
  /// warning. An empty `folder` means no cache.
  static Result<std::shared_ptr<const ViewpointModel>> load_or_build(
      const TriangleMesh& mesh, const DepthRendererFactory& factory,
      const ViewpointModelOptions& options, const std::filesystem::path& folder);

  /// Hash of everything that the model depends on: mesh, options, version of the method.
  static uint64_t key(const TriangleMesh& mesh, const ViewpointModelOptions& options);
  /// Name of the cache file for a key, without folder.
  static std::string cache_name(uint64_t key);

  /// The file format. parse() believes nothing: sizes, checksum and the range of every number are
  /// checked, and the key must be the one asked for.
  std::string serialize() const;
  static Result<std::shared_ptr<const ViewpointModel>> parse(std::string_view content, uint64_t key,
                                                             const std::string& where);

  size_t size() const { return records_.size(); }
  View view(size_t index) const;
  const Mask& mask(size_t index) const { return records_[index].mask; }
  /// The view whose direction is nearest to where the camera stands. A table look-up and a few
  /// steps over neighbors.
  size_t nearest(const Rigid3& camera_from_object) const;
  size_t nearest(const Eigen::Vector3d& direction_in_object) const;
  /// Views next to this one on the sphere: five or six.
  std::span<const uint16_t> neighbors(size_t index) const;

  /// Rotations that map the shape onto itself, colors aside: a pose T and T * rotation cannot be
  /// told apart by outline and edges. Without the identity and those about symmetry_axis(). Object
  /// frame.
  const std::vector<Rigid3>& symmetry_rotations() const { return symmetry_rotations_; }
  /// Set if the shape is the same after any rotation about it.
  const std::optional<ShapeSymmetry::Axis>& symmetry_axis() const { return symmetry_axis_; }
  /// Transforms after which it looks nearly the same (see NearSymmetries).
  const std::vector<Rigid3>& near_rotations() const { return near_rotations_; }
  /// Set if it looks nearly the same after any rotation about it.
  const std::optional<ShapeSymmetry::Axis>& near_axis() const { return near_axis_; }
  /// What of it turns about its axis, exact or near, do not move; null without one.
  const observe::RevolvedSurface* revolved() const { return revolved_.get(); }
  /// Least rotation between the orientations of two poses that look alike by these [rad].
  double angle_up_to_symmetry(const Rigid3& a, const Rigid3& b) const;

  const Eigen::Vector3d& center() const { return center_; }  ///< of the bounding sphere
  double radius() const { return radius_; }                  ///< [m]
  uint64_t key() const { return key_; }
  const ViewpointModelOptions& options() const { return options_; }

 private:
  friend class observe::ViewpointModelBuilder;
  struct Record {
    Eigen::Vector3f direction;
    uint32_t first_contour = 0, contours = 0, first_edge = 0, edges = 0;
    float area = 0, contour_length = 0;
    Mask mask{};
  };
  ViewpointModel() = default;
  void finish();

  uint64_t key_ = 0;
  ViewpointModelOptions options_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double radius_ = 0;
  std::vector<Rigid3> symmetry_rotations_, near_rotations_;
  std::optional<ShapeSymmetry::Axis> symmetry_axis_, near_axis_;
  std::shared_ptr<const observe::RevolvedSurface> revolved_;
  std::vector<Record> records_;
  std::vector<Rigid3> camera_from_object_;  ///< of each view
  std::vector<ContourSample> contours_;
  std::vector<InnerEdgeSample> edges_;
  std::vector<std::array<uint16_t, 6>> neighbors_;
  std::vector<uint8_t> neighbor_counts_;
  std::vector<uint16_t> start_of_cell_;  ///< cube map: a view near each direction
};

}  // namespace sightline
