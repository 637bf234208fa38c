// SPDX-License-Identifier: Apache-2.0
// Ray casting (Appel, 1968): the nearest face on the ray of each pixel, through a tree of boxes
// that is split in the middle of its longest side.
#include <algorithm>
#include <limits>

#include "hidden_surfaces/method.hpp"
#include "hidden_surfaces/ray_triangle.hpp"

namespace sightline::hidden_surfaces {
namespace {

struct Box {
  Eigen::Array3d low = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array3d high = -low;

  void add(const Eigen::Vector3d& point) {
    low = low.min(point.array());
    high = high.max(point.array());
  }
  // The ray from the eye; 0 < distance < limit.
  bool meets(const Eigen::Array3d& inverse_ray, double limit) const {
    const Eigen::Array3d a = low * inverse_ray, b = high * inverse_ray;
    return std::max(0.0, a.min(b).maxCoeff()) <= std::min(limit, a.max(b).minCoeff());
  }
};

struct Node {
  Box box;
  uint32_t first = 0;  ///< leaf: into the order; else the second child (the first follows the node)
  uint32_t count = 0;  ///< 0: not a leaf
};

class RayCasting final : public Method {
 public:
  std::string_view name() const override { return "ray casting"; }

  void prepare(const Scene& scene) override {
    scene_ = &scene;
    nodes_.clear();
    order_.clear();
    middles_.clear();
    for (size_t i = 0; i < scene.faces.size(); ++i) {
      const auto& corner = scene.faces[i].corner;
      middles_.push_back((corner[0] + corner[1] + corner[2]) / 3);
      if (scene.faces[i].seen_from_front()) order_.push_back(static_cast<int32_t>(i));
    }
    if (!order_.empty()) build(0, static_cast<uint32_t>(order_.size()));
  }

  void draw(const Scene& scene, Picture& picture) override {
    const Tile& tile = picture.tile;
    for (int y = tile.y; y < tile.y + tile.height; ++y) {
      for (int x = tile.x; x < tile.x + tile.width; ++x) {
        picture.at(x, y) = cast(scene.view.ray(x, y));
      }
    }
  }

  size_t bytes() const override {
    return nodes_.capacity() * sizeof(Node) + order_.capacity() * sizeof(int32_t) +
           middles_.capacity() * sizeof(Eigen::Vector3d);
  }

 private:
  void build(uint32_t first, uint32_t count) {
    constexpr uint32_t kLeaf = 4;
    const auto index = nodes_.size();
    nodes_.emplace_back();
    Box box, middles;
    for (uint32_t i = first; i < first + count; ++i) {
      const auto face = static_cast<size_t>(order_[i]);
      for (const Eigen::Vector3d& corner : scene_->faces[face].corner) box.add(corner);
      middles.add(middles_[face]);
    }
    nodes_[index].box = box;
    if (count <= kLeaf) {
      nodes_[index].first = first;
      nodes_[index].count = count;
      return;
    }
    Eigen::Index axis = 0;
    (middles.high - middles.low).maxCoeff(&axis);
    const uint32_t half = count / 2;
    std::nth_element(order_.begin() + first, order_.begin() + first + half,
                     order_.begin() + first + count, [&](int32_t a, int32_t b) {
                       return middles_[static_cast<size_t>(a)][axis] <
                              middles_[static_cast<size_t>(b)][axis];
                     });
    build(first, half);
    nodes_[index].first = static_cast<uint32_t>(nodes_.size());
    build(first + half, count - half);
  }

  int32_t cast(const Eigen::Vector3d& ray) const {
    const Eigen::Array3d inverse_ray = ray.array().inverse();
    double distance = std::numeric_limits<double>::infinity();
    int32_t nearest = -1;
    std::array<uint32_t, 64> stack{};
    size_t depth = nodes_.empty() ? 0 : 1;
    while (depth > 0) {
      const uint32_t index = stack[--depth];
      const Node& node = nodes_[index];
      if (!node.box.meets(inverse_ray, distance)) continue;
      if (node.count == 0) {
        stack[depth++] = node.first;
        stack[depth++] = index + 1;
        continue;
      }
      for (uint32_t i = node.first; i < node.first + node.count; ++i) {
        const auto hit = hit_distance(scene_->faces[static_cast<size_t>(order_[i])], ray);
        if (!hit || *hit >= distance) continue;
        distance = *hit;
        nearest = order_[i];
      }
    }
    return nearest;
  }

  const Scene* scene_ = nullptr;
  std::vector<Node> nodes_;
  std::vector<int32_t> order_;
  std::vector<Eigen::Vector3d> middles_;
};

}  // namespace

std::unique_ptr<Method> make_ray_casting() { return std::make_unique<RayCasting>(); }

std::vector<std::unique_ptr<Method>> all_methods() {
  std::vector<std::unique_ptr<Method>> methods;
  methods.push_back(make_z_buffer());
  methods.push_back(make_painter());
  methods.push_back(make_bsp());
  methods.push_back(make_warnock());
  methods.push_back(make_ray_casting());
  return methods;
}

}  // namespace sightline::hidden_surfaces
