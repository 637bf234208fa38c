// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/image/image.hpp"

namespace sightline::compare {

/// The scene that every contestant draws: a bumpy torus, 256 px wide, turning, into an I420 frame.
struct Scene {
  CameraModel camera;
  TriangleMesh mesh;
  std::vector<Rigid3> poses;
  std::shared_ptr<Image> frame;
};

/// One way to draw it. `frame(k)` draws pose k; empty: cannot be had here, `note` says why.
struct Contestant {
  std::string name;
  std::function<void(size_t)> frame;
  std::string note;
};

std::vector<Contestant> opencv_contestants(const Scene& scene);
Contestant gl_contestant(const Scene& scene);

/// CPU milliseconds a frame that an element costs in a pipeline of I420 frames of this size, net of
/// the pipeline without it.
struct ElementCost {
  std::string name;
  std::optional<double> cpu_ms;
};
std::vector<ElementCost> gstreamer_costs(int width, int height, int frames);

}  // namespace sightline::compare
