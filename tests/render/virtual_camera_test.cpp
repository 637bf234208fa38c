// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/virtual_camera.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "../support/matchers.hpp"
#include "sightline/image/image.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::FailsWith;
using test::IsOk;

CalibratedCamera camera_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  ViewPoint point;
  point.eye = eye;
  point.target = target;
  point.width = 64;
  point.height = 48;
  return *make_view_camera(point, {}, "camera", "test");
}

std::vector<CalibratedCamera> rig() {
  const Eigen::Vector3d target(0.1, 0.2, 0.3);
  return {camera_at({1, 0, 0.8}, target), camera_at({-0.5, -1.5, 1}, target),
          camera_at({0.2, 1.8, 0.4}, target)};
}

std::vector<OverlayObject> box() {
  OverlayStyle style;
  style.fill_opacity = 0.9f;
  return {{ObjectId(0), "box",
           std::make_shared<const RenderMesh>(make_render_mesh(make_box({0.2f, 0.2f, 0.2f}))),
           style}};
}

PoseTrackPtr track(const Eigen::Vector3d& place, CameraSet cameras) {
  PoseEstimate estimate;
  estimate.state = TrackState::kTracking;
  estimate.time = estimate.last_measured = Time(1s);
  estimate.world_from_object.translation = place;
  estimate.cameras = cameras;
  return std::make_shared<const PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise());
}

bool same(const Image& a, const Image& b) {
  for (int y = 0; y < a.height(); ++y) {
    if (std::memcmp(a.view().y.row(y), b.view().y.row(y), static_cast<size_t>(a.width())) != 0) {
      return false;
    }
  }
  return true;
}

TEST(WhereCamerasLook, IsWhereTheirAxesMeet) {
  EXPECT_TRUE(where_cameras_look(rig()).isApprox(Eigen::Vector3d(0.1, 0.2, 0.3), 2e-3));
  const auto alone = std::vector{camera_at({0, 0, 0}, {0, 5, 0})};
  EXPECT_TRUE(where_cameras_look(alone).isApprox(Eigen::Vector3d(0, 1, 0), 1e-6));
}

TEST(ViewCamera, DefaultSeesTargetAndEveryCamera) {
  const auto cameras = rig();
  const auto view = make_view_camera({}, cameras, "view", "test");
  ASSERT_THAT(view, IsOk());
  const Rigid3 view_from_world = view->world_from_camera.inverse();
  for (const CalibratedCamera& camera : cameras) {
    const auto pixel = view->model.project(view_from_world * camera.world_from_camera.translation);
    ASSERT_TRUE(pixel);
    EXPECT_TRUE(view->model.contains(*pixel));
  }
  const auto middle = view->model.project(view_from_world * where_cameras_look(cameras));
  EXPECT_TRUE(middle->isApprox(Eigen::Vector2d(639.5, 359.5), 1e-6));
}

TEST(ViewCamera, UpIsUpInTheImage) {
  const CalibratedCamera view = camera_at({3, 0, 1}, {0, 0, 0});
  const Rigid3 from_world = view.world_from_camera.inverse();
  EXPECT_LT(view.model.project(from_world * Eigen::Vector3d(0, 0, 0.2))->y(),
            view.model.project(from_world * Eigen::Vector3d(0, 0, 0))->y());
  // Not mirrored: seen from +x, +y lies to the right.
  EXPECT_GT(view.model.project(from_world * Eigen::Vector3d(0, 0.2, 0))->x(),
            view.model.project(from_world * Eigen::Vector3d(0, 0, 0))->x());
}

TEST(ViewCamera, RefusesByName) {
  const auto refused = [](auto change) {
    ViewPoint point;
    point.eye = Eigen::Vector3d(1, 0, 0);
    point.target = Eigen::Vector3d(0, 0, 0);
    change(point);
    return make_view_camera(point, {}, "v", "here");
  };
  EXPECT_THAT(refused([](ViewPoint& p) { p.width = 641; }), FailsWith("here: width and height"));
  EXPECT_THAT(refused([](ViewPoint& p) { p.fov_deg = 170; }), FailsWith("5 to 150 degrees"));
  EXPECT_THAT(refused([](ViewPoint& p) { p.eye = p.target; }), FailsWith("at its target"));
  EXPECT_THAT(refused([](ViewPoint& p) { p.up = {1, 0, 0}; }), FailsWith("along `up`"));
  EXPECT_THAT(refused([](ViewPoint& p) { p.up = {0, 0, 0}; }), FailsWith("no direction"));
  EXPECT_THAT(refused([](ViewPoint& p) { p.eye = Eigen::Vector3d(NAN, 0, 0); }),
              FailsWith("at its target"));
}

TEST(ViewedStates, SayWhoMeasuredLately) {
  const std::vector<PoseTrackPtr> tracks = {track({0, 0, 0}, 0b101), nullptr};
  const std::vector<bool> present = {true, true, false};
  using enum ViewedState;
  EXPECT_EQ(viewed_states(tracks, Time(1100ms), 300ms, present),
            (std::vector{kMeasuring, kWatching, kAbsent}));
  EXPECT_EQ(viewed_states(tracks, Time(2s), 300ms, present),
            (std::vector{kWatching, kWatching, kAbsent}));
}

class VirtualCameraImage : public testing::Test {
 protected:
  VirtualCameraImage() {
    const auto camera = make_view_camera({}, rig(), "view", "test");
    auto made = VirtualCamera::create(*camera, rig(), box(), {}, {});
    SL_CHECK(made.has_value(), "a view");
    view_ = *std::move(made);
    camera_ = std::make_unique<CalibratedCamera>(*camera);
  }

  std::unique_ptr<Image> draw(const PoseTrackPtr& track, std::vector<ViewedState> states,
                              const ScenePoints* points = nullptr) {
    auto image = std::make_unique<Image>(view_->width(), view_->height());
    std::vector<PoseAt> poses;
    const std::vector<PoseTrackPtr> tracks = {track};
    view_->draw(image->mutable_view(), Time(1s), tracks, states, points, poses);
    EXPECT_EQ(poses.size(), 1u);
    return image;
  }

  Eigen::Vector2i pixel(const Eigen::Vector3d& point) const {
    return camera_->model.project(camera_->world_from_camera.inverse() * point)
        ->array()
        .round()
        .cast<int>();
  }

  std::unique_ptr<VirtualCamera> view_;
  std::unique_ptr<CalibratedCamera> camera_;
  const std::vector<ViewedState> watching_ = std::vector(3, ViewedState::kWatching);
};

TEST_F(VirtualCameraImage, ShowsTheObjectWhereItIs) {
  const auto without = draw(nullptr, watching_);
  const Eigen::Vector3d place(0.1, 0.2, 0.3);
  const auto with = draw(track(place, 0), watching_);
  const Eigen::Vector2i at = pixel(place);
  // Green: little of either color difference.
  EXPECT_LT(with->view().u.row(at.y() / 2)[at.x() / 2], 115);
  EXPECT_LT(with->view().v.row(at.y() / 2)[at.x() / 2], 115);
  EXPECT_GT(without->view().u.row(at.y() / 2)[at.x() / 2], 118);
}

TEST_F(VirtualCameraImage, TellsTheStateOfEachCamera) {
  const auto watching = draw(nullptr, watching_);
  auto states = watching_;
  states[1] = ViewedState::kAbsent;
  const auto absent = draw(nullptr, states);
  EXPECT_FALSE(same(*watching, *absent));
  EXPECT_TRUE(same(*watching, *draw(nullptr, watching_)));  // nothing is left of the last image
}

TEST_F(VirtualCameraImage, ColorsPointsByDepth) {
  ScenePoints points;
  const Eigen::Vector3d to_eye =
      (camera_->world_from_camera.translation - Eigen::Vector3d(0.1, 0.2, 0.3)).normalized();
  const Eigen::Vector3d near = Eigen::Vector3d(0.3, 0, 0.3) + 0.5 * to_eye, far(-0.3, 0.3, 0.2);
  for (const Eigen::Vector3d& place : {near, far}) {
    ScenePoint& point = points.points.emplace_back();
    point.point_in_world = place;
    point.kind = PointKind::kEdge;
  }
  const auto image = draw(nullptr, watching_, &points);
  const Eigen::Vector2i green = pixel(near), blue = pixel(far);
  EXPECT_LT(image->view().u.row(green.y() / 2)[green.x() / 2], 100);
  EXPECT_GT(image->view().u.row(blue.y() / 2)[blue.x() / 2], 170);
}

TEST(VirtualCamera, SceneIsSolid) {
  const RenderMesh table = make_render_mesh(make_box({1.0f, 1.0f, 0.1f}));
  const SceneMesh scene{&table, Rigid3()};
  const auto camera = make_view_camera({}, rig(), "view", "test");
  const auto bare = VirtualCamera::create(*camera, rig(), {}, {}, {});
  const auto full = VirtualCamera::create(*camera, rig(), {}, {&scene, 1}, {});
  ASSERT_THAT(full, IsOk());
  Image with(1280, 720), without(1280, 720);
  std::vector<PoseAt> poses;
  const std::vector<ViewedState> states(3, ViewedState::kWatching);
  (*full)->draw(with.mutable_view(), Time(1s), {}, states, nullptr, poses);
  (*bare)->draw(without.mutable_view(), Time(1s), {}, states, nullptr, poses);
  const auto at = camera->model.project(camera->world_from_camera.inverse() *
                                        Eigen::Vector3d(0.31, 0.27, 0.05));
  const int x = static_cast<int>(at->x()), y = static_cast<int>(at->y());
  EXPECT_GT(with.view().y.row(y)[x], without.view().y.row(y)[x] + 30);
}

}  // namespace
}  // namespace sightline
