// SPDX-License-Identifier: Apache-2.0
#include "observe/shape/revolved_surface.hpp"

#include <gtest/gtest.h>

#include "observe/track/contour_lines.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::observe {
namespace {

std::shared_ptr<const ViewpointModel> views_of(const TriangleMesh& mesh) {
  const auto renderable = std::make_shared<const RenderMesh>(make_render_mesh(mesh));
  ViewpointModelOptions options;
  options.subdivisions = 2;
  return ViewpointModel::build(mesh, mesh_depth_renderer_factory(renderable), options).value();
}

std::shared_ptr<const ViewpointModel> cup() {
  static const auto model =
      views_of(test::make_column_with_box({0.036f, 0, 0}, {0.014f, 0.006f, 0.05f}));
  return model;
}

CameraModel camera() {
  CameraModel::Parameters p;
  p.width = 640;
  p.height = 480;
  p.fx = p.fy = 600;
  p.cx = 320;
  p.cy = 240;
  p.distortion = {-0.12, 0.09, 0.0004, -0.0003, -0.02};
  return CameraModel::create(p, "test").value();
}

// Sum of the squared derivatives of all lines by a turn about the axis [px^2/rad^2].
double turn_information(const std::vector<ContourLine>& lines, const ShapeSymmetry::Axis& axis) {
  Vector6 turn;
  turn << axis.direction, axis.point.cross(axis.direction);
  double sum = 0;
  for (const ContourLine& line : lines) sum += std::pow(line.by_pose.dot(turn), 2);
  return sum;
}

TEST(RevolvedSurface, IsTheBodyOfACupAndNotItsHandle) {
  const RevolvedSurface* revolved = cup()->revolved();
  ASSERT_NE(revolved, nullptr);
  EXPECT_GT(std::abs(revolved->axis().direction.z()), 0.9998) << "1 degree";
  const Eigen::Vector3d& point = revolved->axis().point;
  EXPECT_LT(std::hypot(point.x(), point.y()), 0.0015);
  for (const double turn : {0.5, 2.0, 3.0, 5.0}) {
    EXPECT_TRUE(revolved->contains({0.03 * std::cos(turn), 0.03 * std::sin(turn), 0.01}));
  }
  EXPECT_FALSE(revolved->contains({0.043, 0, 0.01}));
}

TEST(RevolvedSurface, ABoxHasNone) {
  EXPECT_EQ(views_of(make_box({0.16f, 0.10f, 0.12f}))->revolved(), nullptr);
}

// The law: what the limb condition asks for holds, and the profile is the same.
TEST(RevolvedSurface, LimbIsWhereTheCameraGrazesTheSurface) {
  const RevolvedSurface& revolved = *cup()->revolved();
  int turned = 0;
  std::vector<double> off;
  for (size_t i = 0; i < cup()->size(); i += 7) {
    const View view = cup()->view(i);
    const Eigen::Vector3d eye =
        view.camera_from_object.inverse().translation + Eigen::Vector3d(0.02, -0.03, 0.01);
    for (const ContourSample& sample : view.contour) {
      const Eigen::Vector3d point = sample.point.cast<double>();
      if (sample.crease != 0 || !revolved.contains(point)) continue;
      const auto limb = revolved.limb(point, limb_normal(view, sample), eye);
      if (!limb) continue;
      ++turned;
      EXPECT_NEAR(limb->normal.dot((limb->point - eye).normalized()), 0, 1e-9);
      const ShapeSymmetry::Axis& axis = revolved.axis();
      EXPECT_NEAR(axis.direction.dot(limb->point - point), 0, 1e-12);
      const double distance = (limb->point - axis.point).cross(axis.direction).norm();
      off.push_back(std::abs(distance - 0.03));
    }
  }
  EXPECT_GT(turned, 300);
  std::sort(off.begin(), off.end());
  EXPECT_LT(off[off.size() * 9 / 10], 0.0006) << "a pixel of the views is 0.4 mm";
}

// Body points of the nearest view would claim to know the turn to a few degrees, of every frame.
TEST(RevolvedSurface, LinesOfTheBodyDoNotMeasureTurns) {
  const RevolvedSurface& revolved = *cup()->revolved();
  std::vector<ContourLine> as_body, lines;
  double body = 0, claimed = 0, shown = 0;
  for (int i = 0; i < 24; ++i) {
    const Rigid3 pose(
        Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 0.1, 0).normalized()) *
                           Eigen::AngleAxisd(0.26 * i, Eigen::Vector3d::UnitZ())),
        Eigen::Vector3d(0.05, -0.02, 0.6));
    const View view = cup()->view(cup()->nearest(pose));
    place_lines(view, camera(), pose, {}, 3, nullptr, as_body);
    place_lines(view, camera(), pose, {}, 3, &revolved, lines);
    ASSERT_EQ(as_body.size(), lines.size());
    const auto of_handle = [&](const ContourLine& line) {
      return !revolved.contains(line.point_in_object);
    };
    std::vector<ContourLine> handle;
    std::copy_if(lines.begin(), lines.end(), std::back_inserter(handle), of_handle);
    shown += turn_information(handle, revolved.axis());
    std::erase_if(as_body, of_handle);
    std::erase_if(lines, of_handle);
    body += turn_information(as_body, revolved.axis());
    claimed += turn_information(lines, revolved.axis());
  }
  EXPECT_LT(claimed, 0.05 * body);
  EXPECT_GT(shown, 0.5 * body) << "the handle tells, where it shows";
}

}  // namespace
}  // namespace sightline::observe
