// SPDX-License-Identifier: Apache-2.0
// Painter's algorithm: faces from the farthest to the nearest, each over what is there. Its order,
// by the middle of each face, is the usual shortcut of Newell, Newell and Sancha (1972), without
// their tests and splits: large faces beside small ones, and faces that pierce, have none that is
// right.
#include <algorithm>

#include "hidden_surfaces/fill.hpp"
#include "hidden_surfaces/method.hpp"

namespace sightline::hidden_surfaces {
namespace {

class Painter final : public Method {
 public:
  std::string_view name() const override { return "painter's"; }

  void draw(const Scene& scene, Picture& picture) override {
    order_.clear();
    for (size_t i = 0; i < scene.faces.size(); ++i) {
      const Face& face = scene.faces[i];
      if (!face.seen_from_front()) continue;
      const Eigen::Vector3d sum = face.corner[0] + face.corner[1] + face.corner[2];
      order_.push_back({sum.squaredNorm(), static_cast<int32_t>(i)});
    }
    std::sort(order_.begin(), order_.end(),
              [](const Entry& a, const Entry& b) { return a.distance > b.distance; });
    for (const Entry& entry : order_) {
      std::array<Eigen::Vector2d, 3> corners;
      for (size_t k = 0; k < 3; ++k) {
        corners[k] = scene.view.project(scene.faces[static_cast<size_t>(entry.face)].corner[k]);
      }
      fill(corners, picture.tile, [&](int x, int y) { picture.at(x, y) = entry.face; });
    }
  }

  size_t bytes() const override { return order_.capacity() * sizeof(Entry); }

 private:
  struct Entry {
    double distance;  ///< of its middle from the eye, as far as the order matters
    int32_t face;
  };
  std::vector<Entry> order_;
};

}  // namespace

std::unique_ptr<Method> make_painter() { return std::make_unique<Painter>(); }

}  // namespace sightline::hidden_surfaces
