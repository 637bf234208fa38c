// SPDX-License-Identifier: Apache-2.0
#include "observe/track/silhouettes/silhouette_comparison.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "sightline/image/image.hpp"
#include "sightline/observe/shape/shape_symmetry.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/lens_camera.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

constexpr double kDeg = std::numbers::pi / 180;

// A cup in front of noise, upright; `turn` 0: its handle points to the right.
class Cup {
 public:
  Cup() {
    const TriangleMesh mesh = test::make_column_with_box({0.036f, 0, 0}, {0.014f, 0.006f, 0.05f});
    const auto renderable = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
    object_.views = ViewpointModel::build(mesh, mesh_depth_renderer_factory(renderable)).value();
    object_.shape_symmetry = shape_symmetry_of(*object_.views, {});
    object_.silhouette = object_.depth = mesh_depth_renderer_factory(renderable);
    comparison_.emplace(tracker_, object_);
  }
  static Rigid3 pose(double degrees) {
    const Eigen::Quaterniond upright(Eigen::AngleAxisd(-100 * kDeg, Eigen::Vector3d::UnitX()));
    return Rigid3(upright * Eigen::AngleAxisd(degrees * kDeg, Eigen::Vector3d::UnitZ()),
                  Eigen::Vector3d(0.04, 0.02, 0.7));
  }
  // Object and background have these levels, give or take the noise.
  void draw(const Rigid3& pose, PixelLevels object, PixelLevels background) {
    const auto renderer = object_.depth(tracker_.camera->model);
    const DepthTile tile = renderer->render(pose);
    const MutableI420View view = image_.mutable_view();
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, 6);
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x) {
        const PixelLevels& level = tile.at(x, y) > 0 ? object : background;
        view.y.row(y)[x] = static_cast<uint8_t>(std::clamp(level.y + noise(random), 16.0, 235.0));
        if (x % 2 != 0 || y % 2 != 0) continue;
        view.u.row(y / 2)[x / 2] = level.u;
        view.v.row(y / 2)[x / 2] = level.v;
      }
    }
  }
  const std::vector<double>& compare(const Rigid3& pose) {
    return comparison_->compare(ColorReader(image_.view()), pose, {});
  }
  // By index of the costs.
  Rigid3 turned(const Rigid3& pose, size_t k) const {
    return k == 0 ? pose : pose * object_.shape_symmetry.near_rotations[k - 1];
  }
  size_t turns() const { return object_.shape_symmetry.near_rotations.size(); }

 private:
  TrackerCamera tracker_{std::make_shared<const CalibratedCamera>(test::lens_camera()), {}, {}};
  TrackedObject object_;
  Image image_{640, 480};
  std::optional<SilhouetteComparison> comparison_;
};

// Between the directions of the handles: upside down, this cup is the same.
double handle_angle(const Rigid3& a, const Rigid3& b) {
  const Eigen::Vector3d u = a.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d v = b.rotation * Eigen::Vector3d::UnitX();
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

size_t best_of(const std::vector<double>& costs) {
  return static_cast<size_t>(std::min_element(costs.begin(), costs.end()) - costs.begin());
}

TEST(SilhouetteComparison, AHandleBesideTheBodyTellsTheTurnWhateverWasBelieved) {
  Cup cup;
  ASSERT_GE(cup.turns(), 23u);
  cup.draw(Cup::pose(10), {120, 90, 170}, {130, 128, 128});
  for (const double believed : {10.0, 70.0, 130.0, 190.0, 300.0}) {
    const std::vector<double> costs = cup.compare(Cup::pose(believed));
    ASSERT_EQ(costs.size(), cup.turns() + 1);
    const size_t best = best_of(costs);
    EXPECT_LT(handle_angle(cup.turned(Cup::pose(believed), best), Cup::pose(10)), 25 * kDeg);
    for (size_t k = 0; k < costs.size(); ++k) {
      const double off = handle_angle(cup.turned(Cup::pose(believed), k), Cup::pose(10));
      if (off > 70 * kDeg) {
        EXPECT_GT(costs[k], costs[best] + 3) << off / kDeg;
      }
    }
  }
}

TEST(SilhouetteComparison, AHiddenHandleLeavesTheTurnsThatHideIt) {
  Cup cup;
  // Behind the body, as seen from the camera.
  double hidden = 0, least = 1e9;
  for (double degrees = 0; degrees < 360; degrees += 5) {
    const double away =
        (Cup::pose(degrees) * Eigen::Vector3d(1, 0, 0) - Cup::pose(degrees).translation)
            .dot(-Cup::pose(0).translation.normalized());
    if (away < least) least = away, hidden = degrees;
  }
  cup.draw(Cup::pose(hidden), {120, 90, 170}, {130, 128, 128});
  const std::vector<double> costs = cup.compare(Cup::pose(hidden));
  ASSERT_EQ(costs.size(), cup.turns() + 1);
  const double min = costs[best_of(costs)];
  for (size_t k = 0; k < costs.size(); ++k) {
    const double off = handle_angle(cup.turned(Cup::pose(hidden), k), Cup::pose(hidden));
    if (off < 16 * kDeg) {
      EXPECT_LT(costs[k], min + 2) << off / kDeg;
    }
    if (off > 75 * kDeg && off < 105 * kDeg) {
      EXPECT_GT(costs[k], min + 3) << "it would show";
    }
  }
}

TEST(SilhouetteComparison, TheSameColorsSayNothing) {
  Cup cup;
  cup.draw(Cup::pose(10), {128, 128, 128}, {128, 128, 128});
  EXPECT_TRUE(cup.compare(Cup::pose(10)).empty());
}

TEST(SilhouetteComparison, OutOfTheImageOrFarAwaySaysNothing) {
  Cup cup;
  cup.draw(Cup::pose(10), {120, 90, 170}, {130, 128, 128});
  Rigid3 far = Cup::pose(10), behind = Cup::pose(10), beside = Cup::pose(10);
  far.translation.z() = 8;
  behind.translation.z() = -0.7;
  beside.translation.x() = 3;
  EXPECT_TRUE(cup.compare(far).empty());
  EXPECT_TRUE(cup.compare(behind).empty());
  EXPECT_TRUE(cup.compare(beside).empty());
}

}  // namespace
}  // namespace sightline::observe
