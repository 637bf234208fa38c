// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/camera_geometry.hpp"

#include <gtest/gtest.h>

#include "sightline/pipeline/parallel.hpp"

namespace sightline {
namespace {

CalibratedCamera camera_of(double focal) {
  CameraModel::Parameters lens;
  lens.width = 64, lens.height = 48;
  lens.fx = lens.fy = focal;
  lens.cx = 31.5, lens.cy = 23.5;
  return {"camera", CameraModel::create(lens, "test").value(), Rigid3()};
}

TEST(CameraGeometry, AllThreadsShareOneTable) {
  const CameraGeometry geometry(camera_of(60), nullptr, std::vector<float>(64 * 48, 2.0f));
  std::vector<std::shared_ptr<const RayTable>> rays(8);
  std::vector<std::shared_ptr<const StaticDepth>> depth(8);
  run_in_parallel(8, [&](size_t i) {
    depth[i] = geometry.static_depth();
    rays[i] = geometry.rays();
  });
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(rays[i], rays[0]);
    EXPECT_EQ(depth[i], depth[0]);
  }
  ASSERT_NE(depth[0], nullptr);
  EXPECT_FLOAT_EQ(depth[0]->row(10)[10], 0.5f);
}

TEST(CameraGeometry, AnotherLensHasATableOfItsOwn) {
  const CameraGeometry geometry(camera_of(60), nullptr, {});
  EXPECT_EQ(geometry.rays(camera_of(60).model), geometry.rays());
  EXPECT_NE(geometry.rays(camera_of(61).model), geometry.rays());
  EXPECT_EQ(geometry.static_depth(), nullptr);
}

TEST(CameraGeometry, FitsOnlyTheSameLensAtTheSamePlace) {
  const CameraGeometry geometry(camera_of(60), nullptr, {});
  CalibratedCamera moved = camera_of(60);
  EXPECT_TRUE(geometry.fits(moved));
  moved.world_from_camera.translation.x() = 1e-6;
  EXPECT_FALSE(geometry.fits(moved));
  EXPECT_FALSE(geometry.fits(camera_of(61)));
}

}  // namespace
}  // namespace sightline
