// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/point_list.hpp"
#include "sightline/image/image.hpp"
#include "sightline/model/scene_points.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/overlay/overlay_style.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline::cli {

/// Still images: points or a mesh, known in one camera's frame or in the world, in another
/// camera's view.

/// A file of points of one kind.
struct PointFile {
  std::string name;
  PointKind kind = PointKind::kPoint;
  PointList list;
};

enum class PointState { kVisible, kHidden, kOutside, kBehind, kBeyondLens };
/// "visible", "hidden" (behind a surface), "outside" (of the image), "behind" (the camera),
/// "beyond_lens" (its fold-over radius).
std::string_view to_string(PointState state);

/// One point on its way into the image.
struct SuperimposedPoint {
  size_t file = 0;  ///< into the files
  size_t index = 0;
  Eigen::Vector3d in_world, in_camera;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< unless behind or beyond_lens
  PointState state = PointState::kVisible;
  bool in_image() const { return state == PointState::kVisible || state == PointState::kHidden; }
};

/// A mesh and where it stands.
struct PlacedMesh {
  std::shared_ptr<const RenderMesh> mesh;
  Rigid3 world_from_mesh;
};

/// Brings points from `world_from_points` into the camera and through its lens. With
/// `skip_behind`, points behind the camera or beyond the lens are kept with that state; otherwise
/// the first one is an error with its file and line.
Result<std::vector<SuperimposedPoint>> superimpose_points(const std::vector<PointFile>& files,
                                                          const Rigid3& world_from_points,
                                                          const CalibratedCamera& camera,
                                                          bool skip_behind);

/// Marks points as hidden that lie behind one of the meshes by more than `tolerance` of their range
/// (Z-buffer through the exact lens).
void hide_points(const std::vector<PlacedMesh>& surfaces, const CalibratedCamera& camera,
                 const std::shared_ptr<const RayTable>& rays, double tolerance,
                 std::vector<SuperimposedPoint>& points);

/// Draws the mesh as the stream would, hidden surfaces removed; parts behind `scene` as x-ray.
Status draw_placed_mesh(const PlacedMesh& object, const std::vector<PlacedMesh>& scene,
                        const CalibratedCamera& camera, const std::shared_ptr<const RayTable>& rays,
                        const OverlayStyle& style, Image& image);

/// Draws the points that are in the image, edges and corners apart, colored by depth.
void draw_superimposed(const std::vector<PointFile>& files,
                       const std::vector<SuperimposedPoint>& points, Image& image);

/// CSV with a heading: kind,file,line,x_world,...,x_camera,...,u_px,v_px,state [m, px].
std::string format_table(const std::vector<PointFile>& files,
                         const std::vector<SuperimposedPoint>& points);

}  // namespace sightline::cli
