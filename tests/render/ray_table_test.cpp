// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/raster/ray_table.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "render/render_support.hpp"

namespace sightline {
namespace {

std::array<CameraModel::Parameters, 6> lenses() {
  return {test::lens_a(),        test::lens_c(),       test::lens_fisheye(),
          test::lens_rational(), test::lens_folding(), test::lens(641, 359, 400, {})};
}

class RayTableTest : public testing::TestWithParam<size_t> {
 protected:
  RayTableTest() : model(test::camera(lenses()[GetParam()])) {
    static std::array<std::shared_ptr<const RayTable>, 6> tables;
    if (!tables[GetParam()]) tables[GetParam()] = RayTable::build(model);
    rays = tables[GetParam()];
  }
  CameraModel model;
  std::shared_ptr<const RayTable> rays;
};

INSTANTIATE_TEST_SUITE_P(Lenses, RayTableTest, testing::Range(size_t{0}, lenses().size()));

TEST_P(RayTableTest, HoldsTheRaysOfTheCameraModel) {
  // The whole border of the region with rays is walked: a pixel has a ray exactly if the model
  // gives it one below 89 degrees.
  const double widest = std::tan(89.0 * std::numbers::pi / 180);
  for (int y = 0; y < model.height(); y += 5) {
    for (int x = 0; x < model.width(); x += 3) {
      const auto ray = model.unproject({x, y});
      const double z = ray ? ray->z() : 0;
      const bool known = z > 0 && ray->head<2>().norm() / z <= widest;
      const float rx = rays->x_row(y)[x];
      const float ry = rays->y_row(y)[x];
      ASSERT_EQ(std::isfinite(rx), known) << x << "," << y;
      ASSERT_EQ(std::isfinite(ry), known) << x << "," << y;
      if (!known) continue;
      const double tolerance = 1e-7 * (1 + ray->head<2>().norm() / z);
      ASSERT_NEAR(double{rx}, ray->x() / z, tolerance);
      ASSERT_NEAR(double{ry}, ray->y() / z, tolerance);
    }
  }
}

TEST_P(RayTableTest, ExactRaysProjectBackToTheirPixel) {
  test::Dice dice(3);
  int seen = 0;
  for (int i = 0; i < 500; ++i) {
    const int x = static_cast<int>(dice.uniform(0, model.width() - 1));
    const int y = static_cast<int>(dice.uniform(0, model.height() - 1));
    const auto ray = rays->exact_ray(x, y);
    ASSERT_EQ(ray.has_value(), std::isfinite(rays->x_row(y)[x]));
    if (!ray) continue;
    ++seen;
    const auto pixel = rays->project(*ray);
    ASSERT_TRUE(pixel.has_value());
    EXPECT_LT((*pixel - Eigen::Vector2d(x, y)).norm(), 1e-9);
  }
  EXPECT_GT(seen, 100);
}

TEST_P(RayTableTest, PaddingHoldsNoRays) {
  for (int y = 0; y < rays->even_height(); ++y) {
    for (int x = y < model.height() ? model.width() : 0; x < rays->even_width() + 16; ++x)
      ASSERT_TRUE(std::isnan(rays->x_row(y)[x]) && std::isnan(rays->y_row(y)[x])) << x << "," << y;
  }
}

TEST_P(RayTableTest, BlocksBoundTheirRays) {
  for (int y = 0; y < model.height(); ++y) {
    for (int x = 0; x < model.width(); ++x) {
      const float rx = rays->x_row(y)[x];
      if (std::isnan(rx)) continue;
      const auto& b = rays->block(x / RayTable::kBlock, y / RayTable::kBlock);
      ASSERT_TRUE(rx >= b.min_x && rx <= b.max_x);
      ASSERT_TRUE(rays->y_row(y)[x] >= b.min_y && rays->y_row(y)[x] <= b.max_y);
    }
  }
}

TEST_P(RayTableTest, LinesBendNoMoreThanTheBound) {
  test::Dice dice(4);
  const double limit = rays->project_limit();
  int checked = 0;
  for (int i = 0; i < 3000; ++i) {
    const double s = dice.uniform(0, 1 - 1 / std::hypot(1, limit));
    const double r = std::sqrt(s * (2 - s)) / (1 - s);
    const double a = dice.uniform(0, 2 * std::numbers::pi);
    const double length = dice.uniform(0.001, 0.2) * (1 + r * r);
    const double b = dice.uniform(0, 2 * std::numbers::pi);
    const Eigen::Vector2d p(r * std::cos(a), r * std::sin(a));
    const Eigen::Vector2d q = p + length * Eigen::Vector2d(std::cos(b), std::sin(b));
    const auto start = rays->project(p);
    const auto end = rays->project(q);
    if (!start || !end) continue;
    const double r_max = std::max(p.norm(), q.norm());
    const double r_min = std::max(0.0, std::min(p.norm(), q.norm()) - length);
    const double bound = rays->curvature_bound(r_min, r_max) * length * length / 8;
    for (const double t : {0.25, 0.5, 0.75}) {
      const auto middle = rays->project(p + t * (q - p));
      ASSERT_TRUE(middle.has_value());
      EXPECT_LE((*middle - (*start + t * (*end - *start))).norm(), bound + 1e-6);
    }
    ++checked;
  }
  EXPECT_GT(checked, 500);
}

TEST_P(RayTableTest, TheLookupStaysWithinItsError) {
  const RayTable::RadialLookup& lookup = rays->lookup();
  EXPECT_LT(lookup.error_px, 0.05f);
  test::Dice dice(5);
  for (int i = 0; i < 2000; ++i) {
    const double limit = rays->project_limit();
    const double s = dice.uniform(0, 1 - 1 / std::hypot(1, limit));
    const double r = std::sqrt(s * (2 - s)) / (1 - s);
    const double a = dice.uniform(0, 2 * std::numbers::pi);
    const float x = static_cast<float>(r * std::cos(a));
    const float y = static_cast<float>(r * std::sin(a));
    const auto pixel = rays->project({double{x}, double{y}});
    if (!pixel) continue;
    const float r2 = x * x + y * y;
    const float at = std::min((1 - 1 / std::sqrt(1 + r2)) * lookup.scale,
                              static_cast<float>(RayTable::RadialLookup::kCells));
    const auto cell = static_cast<size_t>(at);
    const float f = lookup.value[cell] + (at - static_cast<float>(cell)) * lookup.step[cell];
    const float u = lookup.fx * (x * f + 2 * lookup.p1 * x * y + lookup.p2 * (r2 + 2 * x * x));
    const float v = lookup.fy * (y * f + lookup.p1 * (r2 + 2 * y * y) + 2 * lookup.p2 * x * y);
    EXPECT_NEAR(double{u + lookup.cx}, pixel->x(), double{lookup.error_px});
    EXPECT_NEAR(double{v + lookup.cy}, pixel->y(), double{lookup.error_px});
  }
}

}  // namespace
}  // namespace sightline
