// SPDX-License-Identifier: Apache-2.0
// Z-buffer (Catmull, 1974): a depth for each pixel; of what is drawn there, the nearest stays.
#include "hidden_surfaces/fill.hpp"
#include "hidden_surfaces/method.hpp"

namespace sightline::hidden_surfaces {
namespace {

class ZBuffer final : public Method {
 public:
  std::string_view name() const override { return "Z-buffer"; }

  void draw(const Scene& scene, Picture& picture) override {
    inverse_depth_.assign(picture.face.size(), 0);
    for (size_t i = 0; i < scene.faces.size(); ++i) {
      const Face& face = scene.faces[i];
      const Plane plane = face.plane();
      if (plane.offset >= 0) continue;  // seen from behind
      std::array<Eigen::Vector2d, 3> corners;
      for (size_t k = 0; k < 3; ++k) corners[k] = scene.view.project(face.corner[k]);
      fill(corners, picture.tile, [&](int x, int y) {
        int32_t& seen = picture.at(x, y);
        double& nearest = inverse_depth_[static_cast<size_t>(&seen - picture.face.data())];
        const double here = plane.inverse_depth(scene.view.ray(x, y));
        if (here <= nearest) return;
        nearest = here;
        seen = static_cast<int32_t>(i);
      });
    }
  }

  size_t bytes() const override { return inverse_depth_.capacity() * sizeof(double); }

 private:
  std::vector<double> inverse_depth_;
};

}  // namespace

std::unique_ptr<Method> make_z_buffer() { return std::make_unique<ZBuffer>(); }

}  // namespace sightline::hidden_surfaces
