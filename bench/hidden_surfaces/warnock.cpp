// SPDX-License-Identifier: Apache-2.0
// Warnock's subdivision (1969): a window in which it is plain what is seen is filled; any other is
// cut in four, down to single pixels.
#include <algorithm>

#include "hidden_surfaces/fill.hpp"
#include "hidden_surfaces/method.hpp"

namespace sightline::hidden_surfaces {
namespace {

struct Candidate {
  int32_t face;
  Plane plane;
  std::array<Eigen::Vector2d, 3> corners;
};

// Pixel centers x .. x + size - 1, y .. y + size - 1.
struct Window {
  int x, y, size;
};

enum class Relation { kOutside, kInside, kAround };

double edge(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double x, double y) {
  return (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
}

// Of faces that are seen from the front the inside lies at the negative side of each edge.
Relation relate(const Candidate& candidate, const Window& window) {
  const double x1 = window.x + window.size - 1, y1 = window.y + window.size - 1;
  const auto& c = candidate.corners;
  const auto [left, right] = std::minmax({c[0].x(), c[1].x(), c[2].x()});
  const auto [top, bottom] = std::minmax({c[0].y(), c[1].y(), c[2].y()});
  if (right < window.x || left > x1 || bottom < window.y || top > y1) return Relation::kOutside;
  bool around = true;
  for (size_t i = 0; i < 3; ++i) {
    const Eigen::Vector2d &a = c[i], &b = c[(i + 1) % 3];
    int inside = 0;
    for (const double x : {double(window.x), x1}) {
      for (const double y : {double(window.y), y1}) inside += edge(a, b, x, y) <= 0 ? 1 : 0;
    }
    if (inside == 0) return Relation::kOutside;
    around &= inside == 4;
  }
  return around ? Relation::kAround : Relation::kInside;
}

class Warnock final : public Method {
 public:
  std::string_view name() const override { return "Warnock's"; }

  void draw(const Scene& scene, Picture& picture) override {
    scene_ = &scene;
    picture_ = &picture;
    held_ = most_ = 0;
    std::vector<Candidate> all;
    for (size_t i = 0; i < scene.faces.size(); ++i) {
      const Face& face = scene.faces[i];
      if (!face.seen_from_front()) continue;
      Candidate candidate{static_cast<int32_t>(i), face.plane(), {}};
      for (size_t k = 0; k < 3; ++k) candidate.corners[k] = scene.view.project(face.corner[k]);
      all.push_back(candidate);
    }
    most_ = all.capacity() * sizeof(Candidate);
    std::vector<const Candidate*> seen;
    for (const Candidate& candidate : all) seen.push_back(&candidate);
    int size = 1;
    while (size < std::max(picture.tile.width, picture.tile.height)) size *= 2;
    held_ = most_;
    divide({picture.tile.x, picture.tile.y, size}, seen);
  }

  size_t bytes() const override { return most_; }

 private:
  // `above`: what the window of which this one is a part could not leave out.
  void divide(const Window& window, const std::vector<const Candidate*>& above) {
    const Tile& tile = picture_->tile;
    if (window.x >= tile.x + tile.width || window.y >= tile.y + tile.height) return;
    std::vector<const Candidate*> here;
    const Candidate* front = nullptr;  // of those that go all around the window
    double wall = 0;                   // nothing that is always behind this can be seen
    for (const Candidate* candidate : above) {
      const Relation relation = relate(*candidate, window);
      if (relation == Relation::kOutside) continue;
      here.push_back(candidate);
      if (relation != Relation::kAround) continue;
      const double farthest = reach(*candidate, window).first;
      if (farthest > wall) {
        wall = farthest;
        front = candidate;
      }
    }
    if (front != nullptr) {
      std::erase_if(here, [&](const Candidate* other) {
        return other != front && reach(*other, window).second < wall;
      });
    }
    if (here.empty()) return;
    const size_t bytes = here.capacity() * sizeof(void*);
    held_ += bytes;
    most_ = std::max(most_, held_);
    if (here.size() == 1) {
      fill_one(*here.front(), window);
    } else if (window.size == 1) {
      decide(window.x, window.y, here);
    } else {
      const int half = window.size / 2;
      for (const int dy : {0, half}) {
        for (const int dx : {0, half}) divide({window.x + dx, window.y + dy, half}, here);
      }
    }
    held_ -= bytes;
  }

  // Smallest and largest 1/z of a face's plane in the window: at its corners.
  std::pair<double, double> reach(const Candidate& candidate, const Window& window) const {
    const double x1 = window.x + window.size - 1, y1 = window.y + window.size - 1;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const double x : {double(window.x), x1}) {
      for (const double y : {double(window.y), y1}) {
        const double here = candidate.plane.inverse_depth(scene_->view.ray(x, y));
        low = std::min(low, here);
        high = std::max(high, here);
      }
    }
    return {low, high};
  }

  void fill_one(const Candidate& candidate, const Window& window) {
    const Tile& all = picture_->tile;
    Tile part{window.x, window.y, window.size, window.size};
    part.width = std::min(part.width, all.x + all.width - part.x);
    part.height = std::min(part.height, all.y + all.height - part.y);
    fill(candidate.corners, part, [&](int x, int y) { picture_->at(x, y) = candidate.face; });
  }

  void decide(int x, int y, const std::vector<const Candidate*>& candidates) {
    double nearest = 0;
    for (const Candidate* candidate : candidates) {
      const double here = candidate->plane.inverse_depth(scene_->view.ray(x, y));
      if (here <= nearest) continue;
      nearest = here;
      picture_->at(x, y) = candidate->face;
    }
  }

  const Scene* scene_ = nullptr;
  Picture* picture_ = nullptr;
  size_t held_ = 0, most_ = 0;
};

}  // namespace

std::unique_ptr<Method> make_warnock() { return std::make_unique<Warnock>(); }

}  // namespace sightline::hidden_surfaces
