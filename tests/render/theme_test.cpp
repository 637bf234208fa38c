// SPDX-License-Identifier: Apache-2.0
// Themes on bright, dark and cluttered images. SIGHTLINE_THEME_SHEET=FILE.ppm writes what is
// seen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>

#include "overlay_scene.hpp"
#include "render_support.hpp"
#include "test_images.hpp"

namespace sightline {
namespace {

using namespace test;  // NOLINT: the tests' own helpers

constexpr int kWidth = 400, kHeight = 260;

/// Panels, cables and labels of any brightness.
void clutter(const MutableI420View& to) {
  Dice dice(77);
  for (int i = 0; i < 260; ++i) {
    const int x0 = static_cast<int>(dice.uniform(-20, kWidth)),
              y0 = static_cast<int>(dice.uniform(-20, kHeight));
    const int w = static_cast<int>(dice.uniform(2, 70)), h = static_cast<int>(dice.uniform(2, 50));
    const auto luma = static_cast<uint8_t>(dice.uniform(16, 235));
    const auto u = static_cast<uint8_t>(dice.uniform(100, 156)),
               v = static_cast<uint8_t>(dice.uniform(100, 156));
    for (int y = std::max(y0, 0); y < std::min(y0 + h, kHeight); ++y) {
      for (int x = std::max(x0, 0); x < std::min(x0 + w, kWidth); ++x) {
        to.y.row(y)[x] = luma;
        to.u.row(y / 2)[x / 2] = u;
        to.v.row(y / 2)[x / 2] = v;
      }
    }
  }
}

/// Three of the object: tracked and half behind a wall, degraded, coasting; and one that is lost.
class Shown {
 public:
  explicit Shown(const OverlayStyle& style) : scene_(kWidth, kHeight) {
    scene_.build_wall({-0.21, 0, 0.5}, {0.13f, 1.0f, 0.01f});
    std::vector<OverlayObject> objects;
    const std::array<std::pair<Rigid3, TrackState>, 3> placed = {
        std::pair{pose_at(-0.25, 0.0, 0.9), TrackState::kTracking},
        {pose_at(0.0, 0.17, 0.95), TrackState::kDegraded},
        {pose_at(0.27, -0.06, 0.95), TrackState::kCoasting}};
    for (const auto& [pose, state] : placed) {
      objects.push_back({ObjectId(7), "kit", scene_.mesh, style});
      tracks_.push_back(track_of({estimate_at(pose, state)}));
      poses_.push_back(pose);
    }
    objects.push_back({ObjectId(7), "tool", scene_.mesh, style});
    tracks_.push_back(nullptr);
    renderer_ =
        *CameraRenderer::create(scene_.camera, CameraId(0), objects, scene_.rays, scene_.depth, {});
  }
  void draw(Image& image) {
    std::vector<PoseAt> poses;
    renderer_->draw(image.mutable_view(), time_from_ns(kCapture), tracks_, poses);
  }
  /// Pixels on the silhouette of one of them.
  std::vector<std::pair<int, int>> edge(size_t object) const {
    RasterTile tile;
    MeshRasterizer(scene_.rays).render(*scene_.mesh, poses_[object], 2, tile);
    std::vector<std::pair<int, int>> out;
    for (int y = 1; y + 1 < tile.height(); ++y) {
      for (int x = 1; x + 1 < tile.width(); ++x) {
        const bool inside = tile.inverse_depth(y)[x] > 0;
        const bool all = tile.inverse_depth(y - 1)[x] > 0 && tile.inverse_depth(y + 1)[x] > 0 &&
                         tile.inverse_depth(y)[x - 1] > 0 && tile.inverse_depth(y)[x + 1] > 0;
        if (inside && !all) out.emplace_back(tile.rect().x + x, tile.rect().y + y);
      }
    }
    return out;
  }

 private:
  OverlayScene scene_;
  std::vector<PoseTrackPtr> tracks_;
  std::vector<Rigid3> poses_;
  std::unique_ptr<CameraRenderer> renderer_;
};

/// How far luma and chroma differ within three pixels of one.
bool stands_out(const I420View& view, int at_x, int at_y) {
  int low[3] = {255, 255, 255}, high[3] = {0, 0, 0};
  for (int y = std::max(at_y - 3, 0); y <= std::min(at_y + 3, kHeight - 1); ++y) {
    for (int x = std::max(at_x - 3, 0); x <= std::min(at_x + 3, kWidth - 1); ++x) {
      const int values[3] = {view.y.row(y)[x], view.u.row(y / 2)[x / 2], view.v.row(y / 2)[x / 2]};
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], values[k]);
        high[k] = std::max(high[k], values[k]);
      }
    }
  }
  return high[0] - low[0] >= 45 || high[1] - low[1] >= 35 || high[2] - low[2] >= 35;
}

/// On plain images from black to white the outline of every state is told from what is around it.
TEST(Themes, StandOutOnDarkAndOnBright) {
  for (const std::string_view name : theme_names()) {
    Shown shown(*theme_style(name));
    for (const int luma : {16, 50, 90, 130, 170, 210, 235}) {
      GrayImage image(kWidth, kHeight, luma);
      shown.draw(image);
      for (size_t object = 1; object < 3; ++object) {
        const auto edge = shown.edge(object);
        ASSERT_GT(edge.size(), 100u);
        const auto seen = std::ranges::count_if(
            edge, [&](const auto& p) { return stands_out(image.view(), p.first, p.second); });
        // A coasting object's outline has gaps.
        const double wanted = object == 2 ? 0.5 : 0.97;
        EXPECT_GE(static_cast<double>(seen) / static_cast<double>(edge.size()), wanted)
            << name << " on luma " << luma << ", object " << object;
      }
    }
  }
}

void write_ppm(const I420View& view, const std::string& path) {
  std::ofstream out(path, std::ios::binary);
  out << "P6\n" << view.width() << " " << view.height() << "\n255\n";
  for (int y = 0; y < view.height(); ++y) {
    for (int x = 0; x < view.width(); ++x) {
      const double luma = 1.164 * (view.y.row(y)[x] - 16);
      const double u = view.u.row(y / 2)[x / 2] - 128, v = view.v.row(y / 2)[x / 2] - 128;
      for (const double c : {luma + 1.596 * v, luma - 0.392 * u - 0.813 * v, luma + 2.017 * u})
        out.put(static_cast<char>(static_cast<uint8_t>(std::clamp(c, 0.0, 255.0))));
    }
  }
}

void copy_into(const I420View& from, const MutableI420View& to, int x, int y) {
  const auto plane = [](const PlaneView& source, const MutablePlaneView& target, int column,
                        int row) {
    for (int i = 0; i < source.height; ++i)
      std::memcpy(target.row(row + i) + column, source.row(i), static_cast<size_t>(source.width));
  };
  plane(from.y, to.y, x, y);
  plane(from.u, to.u, x / 2, y / 2);
  plane(from.v, to.v, x / 2, y / 2);
}

TEST(Themes, ContactSheet) {
  const auto names = theme_names();
  GrayImage sheet(3 * kWidth, static_cast<int>(names.size()) * kHeight, 128);
  for (size_t row = 0; row < names.size(); ++row) {
    Shown shown(*theme_style(names[row]));
    for (int column = 0; column < 3; ++column) {
      GrayImage image(kWidth, kHeight, column == 0 ? 222 : 28);
      if (column == 2) clutter(image.mutable_view());
      GrayImage before(kWidth, kHeight, 0);
      copy_into(image.view(), before.mutable_view(), 0, 0);
      shown.draw(image);
      EXPECT_FALSE(same_pixels(image.view(), before.view())) << names[row];
      copy_into(image.view(), sheet.mutable_view(), column * kWidth,
                static_cast<int>(row) * kHeight);
    }
  }
  if (const char* path = std::getenv("SIGHTLINE_THEME_SHEET")) write_ppm(sheet.view(), path);
}

}  // namespace
}  // namespace sightline
