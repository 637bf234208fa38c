// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/model/scene_points.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/raster/static_depth.hpp"

namespace sightline {

/// From where a virtual camera looks. Unset: a place behind the rig's cameras, far enough to see
/// them all and what they look at.
struct ViewPoint {
  std::optional<Eigen::Vector3d> eye;     ///< world [m]
  std::optional<Eigen::Vector3d> target;  ///< world [m]; unset: where the cameras look
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double fov_deg = 50;  ///< horizontal, 5 .. 150
  int width = 1280, height = 720;

  bool operator==(const ViewPoint&) const = default;
};

/// The point nearest to the optical axes of the cameras (least squares); for parallel axes, ahead
/// of their middle.
Eigen::Vector3d where_cameras_look(std::span<const CalibratedCamera> cameras);

/// The pinhole camera of a view point. Refuses sizes that are odd or outside 16..8192, an eye at
/// its target, a line of sight along `up`, numbers that are not finite. `where` goes into errors.
Result<CalibratedCamera> make_view_camera(const ViewPoint& point,
                                          std::span<const CalibratedCamera> cameras,
                                          const std::string& name, const std::string& where);

/// What a camera of the rig is doing, as the view shows it.
enum class ViewedState : uint8_t {
  kAbsent,     ///< no signal: red, dashed
  kWatching,   ///< there, but no object is measured with it: gray
  kMeasuring,  ///< its measurement took part lately: green, with a ray to the object
};

/// How objects look in a virtual camera unless told otherwise: seen from outside, an object is a
/// body among others, not a mark on an image. Colors and widths are those of `base`.
OverlayStyle virtual_camera_style(OverlayStyle base);

struct VirtualCameraOptions {
  RenderOptions render;
  int font_px = 16;
  double grid_m = 0;  ///< between grid lines; 0: what fits the rig
};

/// The rig seen from anywhere: grid and axes of the world, frusta of the cameras with their state,
/// the static scene, the objects with trail and label, reconstructed points colored by depth. What
/// does not move is drawn once. One thread at a time.
class VirtualCamera {
 public:
  /// `view` as of make_view_camera(). Refuses what CameraRenderer::create() refuses.
  static Result<std::unique_ptr<VirtualCamera>> create(const CalibratedCamera& view,
                                                       std::vector<CalibratedCamera> cameras,
                                                       std::vector<OverlayObject> objects,
                                                       std::span<const SceneMesh> scene,
                                                       const VirtualCameraOptions& options);
  ~VirtualCamera();

  int width() const;
  int height() const;

  /// Draws everything at `time` into an image of the view's size. `tracks` one per object,
  /// `states` one per camera, in the order given to create(); `points` may be null.
  void draw(const MutableI420View& image, Time time, std::span<const PoseTrackPtr> tracks,
            std::span<const ViewedState> states, const ScenePoints* points,
            std::vector<PoseAt>& poses_out);

 private:
  class Impl;
  explicit VirtualCamera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// kMeasuring for cameras that took part in one of the tracks within `lately` before `time`;
/// kAbsent where `present` says so.
std::vector<ViewedState> viewed_states(std::span<const PoseTrackPtr> tracks, Time time,
                                       Duration lately, const std::vector<bool>& present);

}  // namespace sightline
