// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "support/scene_motion.hpp"
#include "support/scene_renderer.hpp"

namespace sightline::test {

/// A card that is held before a camera for a while, large enough for all the object's room.
struct SceneCard {
  int camera = -1;  ///< -1: before every camera
  Duration from{0};
  Duration to{0};
  Duration slide = std::chrono::milliseconds(100);  ///< to slide in and out, outside from..to
  double share = 1.0;  ///< of the view that it covers when in place, from the left
};

/// A camera stands at world_from_camera * exp(by) from this time on; its calibration stays.
struct SceneKnock {
  int camera = -1;  ///< -1: none
  Duration from{0};
  Vector6 by = Vector6::Zero();  ///< rotation [rad], translation [m]
};

/// Cameras on a circle about the world's z axis, looking at its origin, and one moving object.
struct SceneRigOptions {
  std::vector<double> azimuths_deg = {0, 60};  ///< one camera each
  double elevation = 0.5;                      ///< [rad] above the horizon
  double distance = 0.7;                       ///< [m] from the origin
  CameraModel::Parameters lens{LensModel::kBrownConrady,           640, 480, 600, 600, 319.5, 239.5,
                               {-0.12, 0.05, 0.0008, -0.0005, 0.0}};
  double blur_px = 0.7;
  Sensor sensor;
  /// Factor on the exposure of a camera's frame, for changes of light; empty: none.
  std::function<double(int, Time)> exposure;

  double rate_hz = 30;
  std::vector<double> phases;   ///< share of a period by which a camera is late; empty: together
  std::vector<Duration> skews;  ///< unknown error of a camera's stamps; empty: none
  Duration delay{0};            ///< capture to arrival

  std::string name = "object";
  std::shared_ptr<const RayMesh> shape;
  Paint paint;
  ScenePath path;
  BackdropOptions backdrop;
  std::vector<SceneCard> cards;
  SceneKnock knock;
  std::vector<SceneBody> others;  ///< further bodies, unknown to the tracker

  Time start = Time(std::chrono::seconds(1));  ///< of the recording; the path starts there too
  Duration duration = std::chrono::seconds(2);
  uint64_t seed = 1;
};

/// One frame to be taken.
struct SceneShot {
  int camera = 0;
  uint64_t sequence = 0;
  Time true_capture{};
  Time stamp{};  ///< what the frame says
};

/// A whole made-up installation with images. Immutable; shoot() from any thread.
class SceneRig {
 public:
  explicit SceneRig(const SceneRigOptions& options);

  const SceneRigOptions& options() const { return options_; }
  const std::vector<CalibratedCamera>& cameras() const { return cameras_; }
  Rigid3 truth(Time time) const;

  /// In order of stamp, then camera.
  const std::vector<SceneShot>& shots() const { return shots_; }
  /// The same, shots of one stamp together: what replay processes at once.
  std::vector<std::vector<SceneShot>> sets() const;
  FramePtr shoot(const SceneShot& shot) const;
  /// What the shot's frame says of itself.
  FrameInfo info_of(const SceneShot& shot) const;

  /// Share of the object's pixels in the shot's image that nothing hides; 0 if out of the
  /// image.
  double visible_share(const SceneShot& shot) const;

 private:
  std::vector<SceneBody> bodies() const;
  SceneBody card_body(const SceneCard& card, int camera) const;

  SceneRigOptions options_;
  std::vector<CalibratedCamera> cameras_;
  const SceneRenderer& renderer_of(const SceneShot& shot) const;

  std::vector<SceneRenderer> renderers_;  ///< by camera; then that of the knocked one
  std::vector<SceneBody> bodies_;         ///< the object first
  std::vector<SceneShot> shots_;
};

}  // namespace sightline::test
