// SPDX-License-Identifier: Apache-2.0
// Binary space partitioning (Fuchs, Kedem and Naylor, 1980): the planes of faces cut space, and the
// faces that cross them, so that for any eye there is an order from far to near without mistakes.
#include <algorithm>
#include <random>

#include "hidden_surfaces/fill.hpp"
#include "hidden_surfaces/method.hpp"

namespace sightline::hidden_surfaces {
namespace {

struct Polygon {
  std::vector<Eigen::Vector3d> corners;
  int32_t face = -1;
};

struct Node {
  Plane plane;
  std::vector<Polygon> polygons;  ///< in the plane
  int front = -1, back = -1;
};

enum class Where { kIn, kFront, kBack, kAcross };

// Corners nearer than this count as in the plane [m]; the planes of a node have unit normals.
constexpr double kThickness = 1e-9;

Where classify(const Polygon& polygon, const Plane& plane) {
  bool front = false, back = false;
  for (const Eigen::Vector3d& corner : polygon.corners) {
    const double side = plane.side(corner);
    front |= side > kThickness;
    back |= side < -kThickness;
  }
  return front && back ? Where::kAcross : front ? Where::kFront : back ? Where::kBack : Where::kIn;
}

void cut(const Polygon& polygon, const Plane& plane, Polygon& front, Polygon& back) {
  front.face = back.face = polygon.face;
  for (size_t i = 0; i < polygon.corners.size(); ++i) {
    const Eigen::Vector3d& a = polygon.corners[i];
    const Eigen::Vector3d& b = polygon.corners[(i + 1) % polygon.corners.size()];
    const double side_a = plane.side(a), side_b = plane.side(b);
    if (side_a >= -kThickness) front.corners.push_back(a);
    if (side_a <= kThickness) back.corners.push_back(a);
    const bool crosses = (side_a > kThickness && side_b < -kThickness) ||
                         (side_a < -kThickness && side_b > kThickness);
    if (!crosses) continue;
    const Eigen::Vector3d between = a + (b - a) * (side_a / (side_a - side_b));
    front.corners.push_back(between);
    back.corners.push_back(between);
  }
}

class Bsp final : public Method {
 public:
  std::string_view name() const override { return "BSP tree"; }

  void prepare(const Scene& scene) override {
    nodes_.clear();
    planes_.clear();
    bytes_ = 0;
    std::vector<Polygon> all;
    for (size_t i = 0; i < scene.faces.size(); ++i) {
      const Face& face = scene.faces[i];
      Plane plane = face.plane();
      const double length = plane.normal.norm();
      plane.normal /= length;
      plane.offset /= length;
      planes_.push_back(plane);
      all.push_back({{face.corner.begin(), face.corner.end()}, static_cast<int32_t>(i)});
    }
    build(std::move(all));
    for (const Node& node : nodes_) {
      bytes_ += sizeof(Node);
      for (const Polygon& polygon : node.polygons) {
        bytes_ += sizeof(Polygon) + polygon.corners.capacity() * sizeof(Eigen::Vector3d);
      }
    }
  }

  void draw(const Scene& scene, Picture& picture) override {
    // With a stack of its own: the tree of a convex body is a chain.
    struct Visit {
      int node;
      bool in_between;  ///< its far side is done
    };
    std::vector<Visit> stack;
    if (!nodes_.empty()) stack.push_back({0, false});
    while (!stack.empty()) {
      const Visit visit = stack.back();
      stack.pop_back();
      const Node& node = nodes_[static_cast<size_t>(visit.node)];
      const bool eye_in_front = node.plane.offset < 0;
      const int far = eye_in_front ? node.back : node.front;
      const int near = eye_in_front ? node.front : node.back;
      if (!visit.in_between) {
        stack.push_back({visit.node, true});
        if (far >= 0) stack.push_back({far, false});
        continue;
      }
      for (const Polygon& polygon : node.polygons) paint(scene, polygon, picture);
      if (near >= 0) stack.push_back({near, false});
    }
  }

  size_t bytes() const override { return bytes_; }

 private:
  struct Work {
    std::vector<Polygon> polygons;
    int parent;
    bool front;
  };

  void build(std::vector<Polygon> all) {
    std::vector<Work> stack;
    stack.push_back({std::move(all), -1, false});
    while (!stack.empty()) {
      Work work = std::move(stack.back());
      stack.pop_back();
      if (work.polygons.empty()) continue;
      const int index = static_cast<int>(nodes_.size());
      Node node;
      node.plane = choose(work.polygons);
      std::vector<Polygon> front, back;
      for (Polygon& polygon : work.polygons) divide(polygon, node, front, back);
      nodes_.push_back(std::move(node));
      if (work.parent >= 0) {
        Node& parent = nodes_[static_cast<size_t>(work.parent)];
        (work.front ? parent.front : parent.back) = index;
      }
      stack.push_back({std::move(front), index, true});
      stack.push_back({std::move(back), index, false});
    }
  }

  static void divide(Polygon& polygon, Node& node, std::vector<Polygon>& front,
                     std::vector<Polygon>& back) {
    switch (classify(polygon, node.plane)) {
      case Where::kIn:
        node.polygons.push_back(std::move(polygon));
        break;
      case Where::kFront:
        front.push_back(std::move(polygon));
        break;
      case Where::kBack:
        back.push_back(std::move(polygon));
        break;
      case Where::kAcross:
        cut(polygon, node.plane, front.emplace_back(), back.emplace_back());
        break;
    }
  }

  // Of some faces the plane that cuts few and leaves halves, judged on some of the others.
  Plane choose(const std::vector<Polygon>& polygons) {
    constexpr int kCandidates = 8, kJudges = 64;
    constexpr int kPriceOfCut = 4;
    std::uniform_int_distribution<size_t> any(0, polygons.size() - 1);
    int lowest = std::numeric_limits<int>::max();
    int32_t best = polygons.front().face;
    for (int c = 0; c < kCandidates; ++c) {
      const int32_t face = polygons[any(random_)].face;
      const Plane& plane = planes_[static_cast<size_t>(face)];
      int balance = 0, cuts = 0;
      for (int j = 0; j < kJudges; ++j) {
        const Where where = classify(polygons[any(random_)], plane);
        balance += where == Where::kFront ? 1 : where == Where::kBack ? -1 : 0;
        cuts += where == Where::kAcross ? 1 : 0;
      }
      const int price = std::abs(balance) + kPriceOfCut * cuts;
      if (price < lowest) {
        lowest = price;
        best = face;
      }
    }
    return planes_[static_cast<size_t>(best)];
  }

  void paint(const Scene& scene, const Polygon& polygon, Picture& picture) {
    if (planes_[static_cast<size_t>(polygon.face)].offset >= 0) return;  // seen from behind
    corners_.clear();
    for (const Eigen::Vector3d& corner : polygon.corners) {
      corners_.push_back(scene.view.project(corner));
    }
    fill(corners_, picture.tile, [&](int x, int y) { picture.at(x, y) = polygon.face; });
  }

  std::vector<Node> nodes_;
  std::vector<Plane> planes_;  ///< of the faces, with unit normals
  std::vector<Eigen::Vector2d> corners_;
  size_t bytes_ = 0;
  std::mt19937 random_{1};
};

}  // namespace

std::unique_ptr<Method> make_bsp() { return std::make_unique<Bsp>(); }

}  // namespace sightline::hidden_surfaces
