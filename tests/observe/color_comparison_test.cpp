// SPDX-License-Identifier: Apache-2.0
#include "observe/track/symmetry/color_comparison.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "observe/track/colors/appearance.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/geometry/mesh_surface.hpp"
#include "sightline/image/image.hpp"
#include "sightline/pipeline/mesh_color_renderer.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/render/mesh/mesh_paint.hpp"
#include "support/lens_camera.hpp"

namespace sightline::observe {
namespace {

constexpr double kPi = std::numbers::pi;
const Eigen::Vector3f kShell(0.35f, 0.37f, 0.40f), kOrange(0.9f, 0.42f, 0.08f);

void add_quad(const std::array<Eigen::Vector3f, 4>& corners, const Eigen::Vector3f& color,
              TriangleMesh& mesh, MeshSurface& surface) {
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), corners.begin(), corners.end());
  for (const std::array<uint32_t, 3>& f :
       {std::array<uint32_t, 3>{0, 1, 2}, std::array<uint32_t, 3>{0, 2, 3}}) {
    mesh.faces.push_back({first + f[0], first + f[1], first + f[2]});
    mesh.face_colors.push_back(color);
    SurfaceTriangle triangle;
    triangle.corners = {corners[f[0]], corners[f[1]], corners[f[2]]};
    for (auto& place : triangle.places) place.setZero();
    triangle.color = color;
    triangle.corner_colors.fill(color);
    surface.triangles.push_back(triangle);
  }
}

// 120 x 80 x 60 mm, with a label of 36 x 24 mm on the side that looks along +y, off its middle.
struct LabeledBox {
  LabeledBox() {
    const Eigen::Vector3f h(0.06f, 0.04f, 0.03f);
    for (int axis = 0; axis < 3; ++axis) {
      for (const float sign : {-1.0f, 1.0f}) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        std::array<Eigen::Vector3f, 4> corners;
        for (size_t i = 0; i < 4; ++i) {
          corners[i][axis] = sign * h[axis];
          const bool right = (i == 1 || i == 2) == (sign > 0);
          corners[i][u] = right ? h[u] : -h[u];
          corners[i][v] = i < 2 ? -h[v] : h[v];
        }
        add_quad(corners, kShell, mesh, surface);
      }
    }
    const float y = 0.0404f;
    add_quad({Eigen::Vector3f{0.04f, y, -0.02f},
              {0.004f, y, -0.02f},
              {0.004f, y, 0.004f},
              {0.04f, y, 0.004f}},
             kOrange, mesh, surface);
    mesh = finish_mesh(std::move(mesh), "labeled box", {}).value();
  }
  TriangleMesh mesh;
  MeshSurface surface;
};

/// What the picture shows of a material.
struct Look {
  PixelLevels shell{95, 126, 126}, label{130, 88, 178};
  bool label_shown = true;
  double shade = 0;  ///< of the luma, across the image
  double noise = 4;
};

class Scene {
 public:
  Scene() {
    static const LabeledBox box;
    static const auto mesh = [] {
      RenderMesh painted = make_render_mesh(box.mesh);
      paint_mesh(box.surface, {}, painted);
      return std::make_shared<const RenderMesh>(std::move(painted));
    }();
    static const std::shared_ptr<const ViewpointModel> views =
        ViewpointModel::build(box.mesh, mesh_depth_renderer_factory(mesh)).value();
    object_.views = views;
    object_.colors = mesh_color_renderer_factory(mesh);
    comparison_.emplace(tracker_, object_);
  }

  // The label's side looks at the camera if `turn` is 0, away from it if it is pi.
  static Rigid3 pose(double turn, double distance = 0.75) {
    const Eigen::Quaterniond facing(Eigen::AngleAxisd(-kPi / 2 - 0.35, Eigen::Vector3d::UnitX()));
    return Rigid3(facing * Eigen::AngleAxisd(turn + 0.3, Eigen::Vector3d::UnitZ()),
                  Eigen::Vector3d(0.04, 0.02, distance));
  }
  static std::vector<Rigid3> family(const Rigid3& pose) {
    std::vector<Rigid3> out = {pose};
    for (int axis = 0; axis < 3; ++axis) {
      out.push_back(pose *
                    Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(kPi, Eigen::Vector3d::Unit(axis))),
                           Eigen::Vector3d::Zero()));
    }
    return out;
  }

  void draw(const Rigid3& pose, const Look& look) {
    const auto renderer = object_.colors(tracker_.camera->model);
    const ColorTile tile = renderer->render(pose);
    const MutableI420View view = image_.mutable_view();
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, look.noise);
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x) {
        PixelLevels level{150, 140, 110};
        if (tile.depth.at(x, y) > 0) {
          const ptrdiff_t at = (y - tile.depth.y) * tile.stride + x - tile.depth.x;
          const bool label = tile.color[2][at] > 145;
          level = label && look.label_shown ? look.label : look.shell;
          level.y = static_cast<uint8_t>(level.y * (1 + look.shade * (x - 320) / 200.0));
          level.y = static_cast<uint8_t>(level.y * (tile.side[at] % 5 + 6) / 10);
        }
        view.y.row(y)[x] = static_cast<uint8_t>(std::clamp(level.y + noise(random), 16.0, 235.0));
        if (x % 2 != 0 || y % 2 != 0) continue;
        view.u.row(y / 2)[x / 2] = level.u;
        view.v.row(y / 2)[x / 2] = level.v;
      }
    }
  }
  const std::vector<double>& compare(const std::vector<Rigid3>& poses) {
    return comparison_->compare(image_.view(), poses, {});
  }

 private:
  TrackerCamera tracker_{std::make_shared<const CalibratedCamera>(test::lens_camera()), {}, {}};
  TrackedObject object_;
  Image image_{640, 480};
  std::optional<ColorComparison> comparison_;
};

size_t best_of(const std::vector<double>& costs) {
  return static_cast<size_t>(std::min_element(costs.begin(), costs.end()) - costs.begin());
}

TEST(ColorComparison, ALabelTellsTheHalfTurnWhicheverIsBelieved) {
  Scene scene;
  scene.draw(Scene::pose(0), {});
  const std::vector<Rigid3> members = Scene::family(Scene::pose(0));
  for (size_t believed = 0; believed < members.size(); ++believed) {
    const std::vector<Rigid3> poses = Scene::family(members[believed]);
    const std::vector<double> costs = scene.compare(poses);
    ASSERT_EQ(costs.size(), 4u) << believed;
    const size_t best = best_of(costs);
    EXPECT_LT(rotation_angle(poses[best], Scene::pose(0)), 0.01) << believed;
    for (size_t k = 0; k < costs.size(); ++k) {
      if (k == best) continue;
      EXPECT_GT(costs[k], costs[best] + 2) << believed << " " << k;
    }
  }
}

TEST(ColorComparison, ItHoldsUnderOtherLightAndAShadow) {
  Scene scene;
  const std::vector<Rigid3> poses = Scene::family(
      Scene::pose(0) * Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitZ())),
                              Eigen::Vector3d::Zero()));
  for (const Look& look : {Look{{60, 122, 134}, {72, 108, 154}, true, 0.3, 4},
                           Look{{150, 120, 132}, {190, 84, 182}, true, -0.3, 8}}) {
    scene.draw(Scene::pose(0), look);
    const std::vector<double> costs = scene.compare(poses);
    ASSERT_EQ(costs.size(), 4u);
    EXPECT_LT(rotation_angle(poses[best_of(costs)], Scene::pose(0)), 0.01);
  }
}

TEST(ColorComparison, ColorsThatAreNotTheObjectsSayNothing) {
  Scene scene;
  const Look plain{{95, 126, 126}, {}, false, 0.2, 4}, blue{{95, 126, 126}, {110, 170, 100}};
  for (const Look& look : {plain, blue}) {
    scene.draw(Scene::pose(0), look);
    for (const Rigid3& believed : Scene::family(Scene::pose(0))) {
      EXPECT_TRUE(scene.compare(Scene::family(believed)).empty());
    }
  }
}

TEST(ColorComparison, WhereNoPoseShowsItsLabelNothingIsSaid) {
  Scene scene;
  scene.draw(Scene::pose(kPi), {});  // it looks away
  for (const Rigid3& believed : Scene::family(Scene::pose(kPi))) {
    EXPECT_TRUE(scene.compare(Scene::family(believed)).empty());
  }
}

TEST(ColorComparison, OutOfTheImageOrTooSmallNothingIsSaid) {
  Scene scene;
  scene.draw(Scene::pose(0, 8), {});
  EXPECT_TRUE(scene.compare(Scene::family(Scene::pose(0, 8))).empty());
  EXPECT_TRUE(scene
                  .compare(Scene::family(
                      Rigid3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(5, 0, 0.7))))
                  .empty());
}

TEST(ColorComparison, AnObjectThatFillsTheImageIsLookedAtCoarser) {
  Scene scene;
  scene.draw(Scene::pose(0, 0.3), {});
  const std::vector<Rigid3> poses = Scene::family(Scene::pose(kPi, 0.3));
  const std::vector<double> costs = scene.compare(poses);
  ASSERT_EQ(costs.size(), 4u);
  EXPECT_LT(rotation_angle(poses[best_of(costs)], Scene::pose(0, 0.3)), 0.01);
}

}  // namespace
}  // namespace sightline::observe
