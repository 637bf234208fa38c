// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/axis_history.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/image/planes.hpp"
#include "sightline/model/occlusion_depth.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/render/gpu/raster_device.hpp"
#include "sightline/render/overlay/overlay_style.hpp"

namespace sightline {

class LevelOfDetail;
class RayTable;
struct RenderMesh;
class StaticDepth;
class TurningDepth;

/// One object as one camera shows it.
struct OverlayObject {
  ObjectId id;
  std::string name;                        ///< UTF-8, for the label
  std::shared_ptr<const RenderMesh> mesh;  ///< shared by all cameras
  OverlayStyle style;
  /// Of the same mesh, shared by all cameras; null: the mesh is drawn as it is.
  std::shared_ptr<const LevelOfDetail> levels = nullptr;
};

struct RenderOptions {
  RasterChoice backend = RasterChoice::kAuto;
  /// TrueType or OpenType file; empty: DejaVu Sans where Debian's fonts-dejavu-core puts it.
  std::filesystem::path font_file;
  /// Coarser levels of a mesh are drawn where no pixel of it moves by more than this; 0: never.
  double detail_px = 0.25;
  /// Edges whose faces meet at more than this are creases: drawn in wireframes, and sharp in smooth
  /// shading [deg]. Of meshes that are made with these options; normals of a file stay.
  double crease_deg = 34.4;
  /// The scene hides the object where it is nearer by more than this share of the range ...
  double depth_tolerance = 0.01;
  /// ... plus so many standard deviations of the object's position.
  double depth_tolerance_sigmas = 2.0;

  bool operator==(const RenderOptions&) const = default;
};

/// What is known about one frame beside the poses; all of it may be null. Read during draw() only.
struct FrameHints {
  const OcclusionDepth* hidden = nullptr;  ///< hides objects like the static scene
  std::string_view notice{};               ///< what every label says beside; one line
  /// Where the camera stood, if it turns; null: where its calibration says. Where it may not be
  /// trusted no object is drawn, and the corner names its state.
  const CameraPlace* place = nullptr;
};

/// Draws the overlay of one camera: asks each track for the pose at the frame's own capture time,
/// rasterizes a tile around the object, compares it with the static scene, and blends marks and
/// text in place. Work grows with the object, not with the frame. One thread at a time; after the
/// first frames of each object nothing allocates.
class CameraRenderer {
 public:
  /// `static_depth` may be null: then nothing is hidden. It is that of `turning`, if there is one:
  /// then it is turned to the place of each frame. Refused: a ray table or static depth of
  /// another size than the camera, an object without mesh, style numbers out of range, a font that
  /// cannot be read (only asked for if a style writes text). kUnavailable: backend kEgl without
  /// EGL.
  static Result<std::unique_ptr<CameraRenderer>> create(
      const CalibratedCamera& camera, CameraId id, std::vector<OverlayObject> objects,
      std::shared_ptr<const RayTable> rays, std::shared_ptr<const StaticDepth> static_depth,
      const RenderOptions& options, std::shared_ptr<TurningDepth> turning = nullptr);
  ~CameraRenderer();
  CameraRenderer(const CameraRenderer&) = delete;
  CameraRenderer& operator=(const CameraRenderer&) = delete;

  /// Draws all objects at `capture` into the image, which has the camera's size. `tracks[i]`
  /// belongs to the i-th object given to create(); null means nothing was published yet. Fills
  /// `poses_out` with one entry per object in the same order; where there is no pose, `source` is
  /// kNone and `estimate` holds object, time and state only.
  void draw(const MutableI420View& image, Time capture, std::span<const PoseTrackPtr> tracks,
            std::vector<PoseAt>& poses_out, const FrameHints& hints = {});
  /// The same into NV12.
  void draw(const MutableNv12View& image, Time capture, std::span<const PoseTrackPtr> tracks,
            std::vector<PoseAt>& poses_out, const FrameHints& hints = {});

  CameraId camera() const;
  const std::vector<OverlayObject>& objects() const;

 private:
  class Impl;
  explicit CameraRenderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
