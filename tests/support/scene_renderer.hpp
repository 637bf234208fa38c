// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/frame.hpp"
#include "support/backdrop.hpp"
#include "support/ray_mesh.hpp"

namespace sightline::test {

/// What a surface looks like; solid patterns in the body's own frame.
struct Paint {
  enum class Kind : uint8_t {
    kPlain,    ///< `color`
    kFaces,    ///< the mesh's face colors
    kPrinted,  ///< patches, stripes and speckles of several scales, for textured objects
  };
  Kind kind = Kind::kPlain;
  Eigen::Vector3f color = {0.45f, 0.28f, 0.10f};  ///< linear RGB
  float gloss = 0.08f;                            ///< of a broad highlight
  uint32_t seed = 1;
};

/// A body that moves on its own path; no pose: it is not there.
struct SceneBody {
  std::shared_ptr<const RayMesh> shape;
  Paint paint;
  std::function<std::optional<Rigid3>(Time)> world_from_body;
};

/// How a camera turns light into levels.
struct Sensor {
  double exposure = 1.0;    ///< factor on the light
  double shutter = 0;       ///< [s] around the capture time; 0: sharp
  double read_noise = 2.0;  ///< one sigma of every channel [levels of 255]
  double shot_noise = 1.5;  ///< the same at full light, growing with its root
  double gamma = 2.2;       ///< 1: linear
};

/// One camera's images of a room and the bodies in it, by rays through the exact lens; shares
/// nothing with the product's rasterizer. Sixteen samples per pixel where the image has edges or
/// motion, spread over the pixel and the shutter, and four elsewhere in a body's box.
/// Deterministic. Making one costs about a second (the backdrop); immutable afterwards.
class SceneRenderer {
 public:
  /// `blur_px`: of the lens, one sigma; 0: none.
  SceneRenderer(CalibratedCamera camera, std::shared_ptr<const Backdrop> backdrop,
                double blur_px = 0.7);
  ~SceneRenderer();
  SceneRenderer(SceneRenderer&&) noexcept;

  const CalibratedCamera& camera() const { return camera_; }

  /// The image whose exposure is centerd on `capture`. `noise_seed` chooses the noise. Size and
  /// format of `info` are filled in, the rest of it stays.
  FramePtr shoot(const std::vector<SceneBody>& bodies, Time capture, const Sensor& sensor,
                 uint64_t noise_seed, FrameInfo info) const;

  /// Pixels (on a grid of 2 px) in which `body` is in front / would be if it were alone.
  struct Visible {
    int shown = 0, whole = 0;
  };
  Visible visible(const std::vector<SceneBody>& bodies, size_t body, Time time) const;

 private:
  struct Placed;
  struct Box;
  using Light = std::vector<Eigen::Vector3f>;  // of every pixel
  Eigen::Vector3f ray(float x, float y) const;
  std::vector<Placed> place(const std::vector<SceneBody>& bodies, Time capture,
                            double shutter) const;
  Box box_of(const Placed& placed) const;
  Eigen::Vector3f sample(const std::vector<Placed>& bodies, float x, float y, int moment,
                         const Eigen::Vector3f& behind, int& hit) const;
  void expose(const std::vector<Placed>& bodies, const Box& box, const Light& behind,
              Light& light) const;

  CalibratedCamera camera_;
  std::vector<Eigen::Vector3f> rays_;  // of the pixels' corners, z = 1, camera frame
  double blur_px_;
  std::shared_ptr<const Backdrop> backdrop_;
  struct Room;  // the backdrop as it is and as the lens shows it, made when first asked for
  const Room& room() const;
  std::unique_ptr<Room> room_;
};

/// A frame from levels (RGB, row by row) as a camera would deliver it: I420, BT.601 limited range.
FramePtr frame_of_rgb(const std::vector<uint8_t>& rgb, const FrameInfo& info);

}  // namespace sightline::test
