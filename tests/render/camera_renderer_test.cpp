// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/camera_renderer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "overlay_scene.hpp"
#include "render/overlay/marks.hpp"
#include "render_support.hpp"
#include "sightline/geometry/rolling_shutter.hpp"
#include "test_images.hpp"

namespace sightline {
namespace {

using namespace test;  // NOLINT: the tests' own helpers

constexpr int kGray = 128;

/// Draws one object with one style at one pose into a gray image.
class Drawn {
 public:
  Drawn(const OverlayScene& scene, const OverlayStyle& style, const PoseTrackPtr& track)
      : image_(scene.camera.model.width(), scene.camera.model.height(), kGray),
        renderer_(*scene.try_renderer(style)) {
    renderer_->draw(image_.mutable_view(), time_from_ns(kCapture), std::span(&track, 1), poses);
  }
  Drawn(const OverlayScene& scene, const OverlayStyle& style, const Rigid3& pose,
        TrackState state = TrackState::kTracking)
      : Drawn(scene, style, track_of({estimate_at(pose, state)})) {}

  I420View view() const { return image_.view(); }
  std::vector<std::pair<int, int>> changed() const { return differing_luma(view(), kGray); }
  CameraRenderer& renderer() { return *renderer_; }
  GrayImage& image() { return image_; }

  std::vector<PoseAt> poses;

 private:
  GrayImage image_;
  std::unique_ptr<CameraRenderer> renderer_;
};

/// The raster mask of the scene's mesh at a pose.
struct Mask {
  RasterTile tile;
  Mask(const OverlayScene& scene, const Rigid3& pose) {
    MeshRasterizer(scene.rays)
        .render(*scene.mesh, scene.camera.world_from_camera.inverse() * pose, 0, tile);
  }
  bool covers(int x, int y) const {
    return tile.rect().contains(x, y) &&
           tile.inverse_depth(y - tile.rect().y)[x - tile.rect().x] > 0;
  }
  bool near(int x, int y, int reach) const {
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        if (covers(x + dx, y + dy)) return true;
      }
    }
    return false;
  }
  TileRect bounds(int width, int height) const {
    int left = width, top = height, right = -1, bottom = -1;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (!covers(x, y)) continue;
        left = std::min(left, x);
        right = std::max(right, x);
        top = std::min(top, y);
        bottom = std::max(bottom, y);
      }
    }
    return {left, top, right + 1 - left, bottom + 1 - top};
  }
};

bool is_hue(const I420View& view, int x, int y, Yuv color, int reach = 40) {
  const int u = view.u.row(y / 2)[x / 2];
  const int v = view.v.row(y / 2)[x / 2];
  return std::abs(u - color.u) < reach && std::abs(v - color.v) < reach;
}

TEST(CameraRenderer, OpaqueFillIsTheRasterMask) {
  const OverlayScene scene;
  OverlayStyle style = only({"fill"});
  style.fill_opacity = 1;
  for (const Rigid3& pose : {pose_at(0.02, 0.01, 0.7), pose_at(-0.28, 0.2, 0.6)}) {
    const Drawn drawn(scene, style, pose);
    const Mask mask(scene, pose);
    int covered = 0;
    for_each_luma(drawn.view(), [&](int x, int y, int luma) {
      // A face may happen to be shaded as gray as the background; chroma tells.
      const bool changed = luma != kGray || is_hue(drawn.view(), x, y, to_yuv(style.color));
      if (mask.covers(x, y)) {
        EXPECT_TRUE(changed) << x << "," << y;
        ++covered;
      } else {
        EXPECT_EQ(luma, kGray) << x << "," << y;
      }
    });
    EXPECT_GT(covered, 500);
  }
}

TEST(CameraRenderer, DrawsEveryTheme) {
  const OverlayScene scene;
  EXPECT_FALSE(theme_style("nonsense").has_value());
  std::vector<size_t> changed;
  for (const std::string_view name : theme_names()) {
    const auto style = theme_style(name);
    ASSERT_TRUE(style.has_value()) << name;
    changed.push_back(Drawn(scene, *style, pose_at(0, 0, 0.8)).changed().size());
    EXPECT_GT(changed.back(), 500u) << name;
  }
  std::ranges::sort(changed);
  EXPECT_EQ(std::ranges::unique(changed).size(), 0u) << "two themes look the same";
}

TEST(CameraRenderer, HaloIsAsDarkAsAsked) {
  const OverlayScene scene;
  OverlayStyle style = only({"outline", "box2d"});
  size_t last = 0;
  for (const float halo : {0.0f, 0.4f, 0.9f}) {
    style.halo_opacity = halo;
    const Drawn drawn(scene, style, pose_at(0, 0, 0.8));
    size_t darkness = 0;
    for_each_luma(drawn.view(), [&](int, int, int luma) {
      if (luma < kGray) darkness += static_cast<size_t>(kGray - luma);
    });
    if (halo == 0) {
      EXPECT_EQ(darkness, 0u);
    } else {
      EXPECT_GT(darkness, last + 10'000);
    }
    last = darkness;
  }
}

TEST(CameraRenderer, OutlineAndFillStayAtTheObject) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0.05, -0.03, 0.8);
  const Drawn drawn(scene, only({"fill", "outline"}), pose);
  const Mask mask(scene, pose);
  EXPECT_GT(drawn.changed().size(), 1000u);
  for (const auto& [x, y] : drawn.changed()) EXPECT_TRUE(mask.near(x, y, 3)) << x << "," << y;
}

TEST(CameraRenderer, CircleIsCenteredOnTheObject) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0.08, 0.03, 0.9);
  const Drawn drawn(scene, only({"circle"}), pose);
  const Eigen::Vector2d center = *scene.camera.model.project(pose.translation);
  double min = 1e9;
  double max = 0;
  for (const auto& [x, y] : drawn.changed()) {
    const double r = (Eigen::Vector2d(x, y) - center).norm();
    min = std::min(min, r);
    max = std::max(max, r);
  }
  EXPECT_LT(max - min, 6);
  // The silhouette of the bounding sphere: f R / sqrt(z^2 - R^2), near the middle of the image.
  const double radius = scene.mesh->radius;
  EXPECT_NEAR(0.5 * (min + max), 288 * radius / std::sqrt(0.81 - radius * radius), 3);
}

TEST(CameraRenderer, Box2dSurroundsTheMask) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(-0.04, 0.02, 0.8);
  const Drawn drawn(scene, only({"box2d"}), pose);
  const TileRect mask = Mask(scene, pose).bounds(320, 240);
  int left = 320, top = 240, right = -1, bottom = -1;
  for (const auto& [x, y] : drawn.changed()) {
    left = std::min(left, x);
    right = std::max(right, x);
    top = std::min(top, y);
    bottom = std::max(bottom, y);
    EXPECT_FALSE(mask.contains(x, y));
  }
  EXPECT_NEAR(left, mask.x - 6, 1);
  EXPECT_NEAR(top, mask.y - 6, 1);
  EXPECT_NEAR(right, mask.x + mask.width + 5, 1);
  EXPECT_NEAR(bottom, mask.y + mask.height + 5, 1);
}

TEST(CameraRenderer, Box3dPassesThroughTheProjectedCorners) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0.1, -0.05, 0.7);
  const Drawn drawn(scene, only({"box3d"}), pose);
  int bright = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d at(corner & 1 ? 0.1 : -0.1, corner & 2 ? 0.07 : -0.07,
                             corner & 4 ? 0.05 : -0.05);
    const Eigen::Vector2d pixel = *scene.camera.model.project(pose * at);
    const auto x = static_cast<int>(std::lround(pixel.x()));
    const auto y = static_cast<int>(std::lround(pixel.y()));
    bright += drawn.view().y.row(y)[x] > 150 ? 1 : 0;
  }
  EXPECT_GE(bright, 7);  // a corner behind the others may fall into a gap of its dashes
}

TEST(CameraRenderer, WireframeLeavesOutHiddenLines) {
  const OverlayScene scene;
  // Seen square on, the far face's edges lie inside the near face's.
  const Rigid3 pose(Eigen::Quaterniond::Identity(), {0, 0, 0.5});
  const Drawn drawn(scene, only({"wireframe"}), pose);
  EXPECT_GT(drawn.changed().size(), 300u);
  const TileRect mask = Mask(scene, pose).bounds(320, 240);
  for (const auto& [x, y] : drawn.changed()) {
    const int inside = std::min(
        {x - mask.x, mask.x + mask.width - 1 - x, y - mask.y, mask.y + mask.height - 1 - y});
    EXPECT_LE(inside, 3) << x << "," << y;
  }
}

TEST(CameraRenderer, AxesPointWhereTheyShould) {
  const OverlayScene scene;
  const Rigid3 pose(Eigen::Quaterniond::Identity(), {0, 0, 0.5});
  const Drawn drawn(scene, only({"axes"}), pose);
  const auto at = [&](double share, const Eigen::Vector3d& axis) {
    return *scene.camera.model.project(pose * (share * 0.9 * double{scene.mesh->radius} * axis));
  };
  const Eigen::Vector2d x = at(0.7, Eigen::Vector3d::UnitX());
  const Eigen::Vector2d y = at(0.7, Eigen::Vector3d::UnitY());
  EXPECT_TRUE(is_hue(drawn.view(), static_cast<int>(x.x()), static_cast<int>(x.y() + 0.5),
                     to_yuv({255, 60, 60}), 50));
  EXPECT_TRUE(is_hue(drawn.view(), static_cast<int>(y.x() + 0.5), static_cast<int>(y.y()),
                     to_yuv({60, 230, 60}), 50));
  EXPECT_GT(x.x(), scene.camera.model.parameters().cx + 5);
  EXPECT_GT(y.y(), scene.camera.model.parameters().cy + 5);
}

TEST(CameraRenderer, TrailFadesAlongThePath) {
  const OverlayScene scene;
  std::vector<PoseEstimate> history;
  for (int k = 10; k >= 0; --k) {
    history.push_back(estimate_at(pose_at(0.02 * (10 - k) - 0.1, 0, 0.8), TrackState::kTracking,
                                  kCapture - k * 100'000'000));
  }
  const Drawn drawn(scene, only({"trail"}), track_of(history));
  const auto brightness = [&](size_t k) {
    const Eigen::Vector2d p = *scene.camera.model.project(history[k].world_from_object.translation);
    const int y = static_cast<int>(std::lround(p.y()));
    const int x = static_cast<int>(std::lround(p.x())) - 2;
    return std::max(
        {drawn.view().y.row(y - 1)[x], drawn.view().y.row(y)[x], drawn.view().y.row(y + 1)[x]});
  };
  EXPECT_GT(brightness(9), brightness(5) + 5);
  EXPECT_GT(brightness(5), brightness(2) + 5);
  EXPECT_GT(brightness(2), kGray);
}

TEST(CameraRenderer, EveryStateLooksDifferent) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0, 0, 0.8);
  const OverlayStyle style = only({"circle", "outline", "box3d"});
  const Drawn tracking(scene, style, pose, TrackState::kTracking);
  const Drawn degraded(scene, style, pose, TrackState::kDegraded);
  const Drawn coasting(scene, style, pose, TrackState::kCoasting);
  EXPECT_FALSE(same_pixels(tracking.view(), degraded.view()));
  EXPECT_FALSE(same_pixels(tracking.view(), coasting.view()));
  const auto of_hue = [](const Drawn& drawn, Rgb color) {
    int count = 0;
    for (const auto& [x, y] : drawn.changed()) {
      count += is_hue(drawn.view(), x, y, to_yuv(color)) ? 1 : 0;
    }
    return count;
  };
  EXPECT_GT(of_hue(tracking, style.color), 500);
  EXPECT_EQ(of_hue(tracking, style.degraded_color), 0);
  EXPECT_GT(of_hue(degraded, style.degraded_color), 500);
  EXPECT_GT(of_hue(coasting, style.coasting_color), 200);
  // Dashes touch fewer pixels than solid lines.
  EXPECT_LT(10 * coasting.changed().size(), 8 * tracking.changed().size());
}

TEST(CameraRenderer, WithoutAPoseNoModelOnlyTheCornerSaysSo) {
  const OverlayScene scene;
  PoseEstimate lost = estimate_at(pose_at(0, 0, 0.8), TrackState::kLost);
  for (const PoseTrackPtr& track : {PoseTrackPtr{}, track_of({}), track_of({lost}),
                                    track_of({estimate_at(pose_at(0, 0, 0.8), TrackState::kTracking,
                                                          kCapture - 2'000'000'000)})}) {
    const Drawn drawn(scene, OverlayStyle{}, track);
    EXPECT_FALSE(drawn.changed().empty());
    for (const auto& [x, y] : drawn.changed()) EXPECT_TRUE(x < 200 && y < 40) << x << "," << y;
    ASSERT_EQ(drawn.poses.size(), 1u);
    EXPECT_EQ(drawn.poses[0].source, PoseSource::kNone);
    EXPECT_FALSE(has_pose(drawn.poses[0].estimate.state));
    EXPECT_EQ(drawn.poses[0].estimate.object, ObjectId(7));
    EXPECT_EQ(to_ns(drawn.poses[0].estimate.time), kCapture);
    OverlayStyle quiet;
    quiet.status = false;
    EXPECT_TRUE(Drawn(scene, quiet, track).changed().empty());
  }
}

TEST(CameraRenderer, LastSeenOnlyIfAsked) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0.05, 0, 0.8);
  for (const bool asked : {false, true}) {
    Drawn drawn(scene, asked ? only({"last_seen", "circle"}) : only({"circle"}), pose);
    drawn.image().clear(kGray);
    const PoseTrackPtr lost =
        track_of({estimate_at(pose, TrackState::kTracking),
                  estimate_at(pose, TrackState::kLost, kCapture + 1'000'000)});
    drawn.renderer().draw(drawn.image().mutable_view(), time_from_ns(kCapture + 900'000'000),
                          std::span(&lost, 1), drawn.poses);
    EXPECT_EQ(drawn.changed().empty(), !asked);
  }
}

TEST(CameraRenderer, PosesAreThoseOfTheCaptureTime) {
  const OverlayScene scene;
  const PoseTrackPtr track =
      track_of({estimate_at(pose_at(0, 0, 0.8), TrackState::kTracking, kCapture - 10'000'000),
                estimate_at(pose_at(0.02, 0, 0.8), TrackState::kTracking, kCapture + 10'000'000)});
  const Drawn drawn(scene, only({"circle"}), track);
  ASSERT_EQ(drawn.poses.size(), 1u);
  EXPECT_EQ(drawn.poses[0].source, PoseSource::kInterpolated);
  EXPECT_NEAR(drawn.poses[0].estimate.world_from_object.translation.x(), 0.01, 1e-9);
}

TEST(CameraRenderer, WhatMovesIsDrawnWhereARollingShutterShowsIt) {
  const OverlayScene scene;
  OverlayScene rolling;
  rolling.camera.readout_s = 0.04;
  const OverlayStyle style = only({"fill"});
  PoseEstimate moving = estimate_at(pose_at(0.02, 0.15, 0.7), TrackState::kTracking);
  moving.twist << 0, 0, 2, 0.8, 0.1, 0;
  const double delay = row_delay_s(rolling.camera, moving.world_from_object.translation);
  ASSERT_GT(delay, 0.005);
  const Drawn drawn(rolling, style, track_of({moving}));
  const Drawn there(scene, style, moving.world_from_object * Rigid3::exp(moving.twist * delay));
  EXPECT_EQ(drawn.changed(), there.changed());
  EXPECT_NE(drawn.changed(), Drawn(scene, style, moving.world_from_object).changed());
  // What is told of it is its pose at the frame's time.
  EXPECT_EQ(difference(drawn.poses[0].estimate.world_from_object, moving.world_from_object).norm(),
            0);
}

TEST(CameraRenderer, XrayOnlyWhereTheSceneIsNearer) {
  OverlayScene scene;
  const Rigid3 pose = pose_at(0, 0, 0.8);
  OverlayStyle style = only({"fill", "outline", "box3d", "wireframe"});
  style.fill_opacity = 1;
  // A wall before the left half of the image.
  scene.build_wall({-0.5, 0, 0.5}, {1.0f, 2.0f, 0.02f});
  const Drawn halved(scene, style, pose);
  const double edge = scene.camera.model.parameters().cx;
  const Mask mask(scene, pose);
  int hidden = 0;
  int seen = 0;
  for_each_luma(halved.view(), [&](int x, int y, int) {
    if (!mask.covers(x, y) || std::abs(x - edge) < 6) return;
    const bool xray = is_hue(halved.view(), x, y, to_yuv(style.xray_color), 90) &&
                      halved.view().v.row(y / 2)[x / 2] > 130;
    const bool plain = halved.view().v.row(y / 2)[x / 2] < 100;
    EXPECT_EQ(plain, x > edge) << x << "," << y;
    if (x < edge && mask.near(x, y, 0)) hidden += xray ? 1 : 0;
    seen += plain ? 1 : 0;
  });
  EXPECT_GT(hidden, 1000);
  EXPECT_GT(seen, 1000);
  // A wall behind the object hides nothing.
  OverlayScene open;
  const Drawn free(open, style, pose);
  open.build_wall({0, 0, 1.2}, {4.0f, 4.0f, 0.02f});
  const Drawn behind(open, style, pose);
  EXPECT_TRUE(same_pixels(free.view(), behind.view()));
}

TEST(CameraRenderer, ToleranceGrowsWithTheUncertainty) {
  OverlayScene scene;
  const Rigid3 pose = pose_at(0, 0, 0.8);
  const OverlayStyle style = only({"fill"});
  // 70 mm before the object's center, some millimeters before its nearest corner.
  scene.build_wall({0, 0, 0.66}, {1.0f, 1.0f, 0.002f});
  PoseEstimate sure = estimate_at(pose, TrackState::kTracking);
  PoseEstimate unsure = sure;
  unsure.covariance(5, 5) = 0.2 * 0.2;
  const Drawn hidden(scene, style, track_of({sure}));
  const Drawn shown(scene, style, track_of({unsure}));
  const auto center = *scene.camera.model.project(pose.translation);
  const auto x = static_cast<int>(center.x()) / 2;
  const auto y = static_cast<int>(center.y()) / 2;
  EXPECT_GT(hidden.view().v.row(y)[x], 128);
  EXPECT_LT(shown.view().v.row(y)[x], 128);
}

/// Middle of the arrow's colored pixels.
Eigen::Vector2d middle_of_hue(const Drawn& drawn, Rgb color) {
  Eigen::Vector2d sum(0, 0);
  int count = 0;
  for (const auto& [x, y] : drawn.changed()) {
    if (!is_hue(drawn.view(), x, y, to_yuv(color))) continue;
    sum += Eigen::Vector2d(x, y);
    ++count;
  }
  return count > 0 ? Eigen::Vector2d(sum / count) : Eigen::Vector2d(-1, -1);
}

TEST(CameraRenderer, ArrowPointsToWhereTheObjectIs) {
  const OverlayScene scene;
  OverlayStyle style;
  struct Case {
    Eigen::Vector3d at;
    int x, y;  // -1 left or top, 0 middle, 1 right or bottom
  };
  for (const Case& c :
       {Case{{-2, 0, 1}, -1, 0}, Case{{2, 0, 1}, 1, 0}, Case{{0, -2, 1}, 0, -1},
        Case{{0, 2, 1}, 0, 1}, Case{{-2, 0.1, -1}, -1, 0}, Case{{2, 0, -0.3}, 1, 0},
        Case{{0, 0, -1}, 0, 1}, Case{{3, 3 * 0.75, 1}, 1, 1}, Case{{0.001, 0, -5}, 1, 0}}) {
    const Drawn drawn(scene, style, pose_at(c.at.x(), c.at.y(), c.at.z()));
    const Eigen::Vector2d at = middle_of_hue(drawn, style.color);
    const auto expect = [&](double value, int where, int size) {
      if (where < 0) {
        EXPECT_LT(value, 25) << c.at.transpose();
      } else if (where > 0) {
        EXPECT_GT(value, size - 26) << c.at.transpose();
      } else {
        EXPECT_NEAR(value, 0.5 * size, 20) << c.at.transpose();
      }
    };
    expect(at.x(), c.x, 320);
    expect(at.y(), c.y, 240);
    EXPECT_EQ(drawn.poses[0].source, PoseSource::kEstimated);
    style.offscreen = false;
    EXPECT_TRUE(Drawn(scene, style, pose_at(c.at.x(), c.at.y(), c.at.z())).changed().empty());
    style.offscreen = true;
  }
}

OverlayStyle everything() {
  OverlayStyle style;
  for (const std::string_view name : style_names()) *style_flag(style, name) = true;
  return style;
}

TEST(CameraRenderer, AnyPlaceAndSizeIsDrawnInsideAndAlikeInNv12) {
  for (const auto& [width, height] : {std::pair{320, 240}, std::pair{321, 239}, std::pair{17, 9}}) {
    OverlayScene scene(width, height);
    scene.build_wall({-0.5, 0, 0.5}, {1.0f, 2.0f, 0.02f});
    auto renderer = *scene.try_renderer(everything());
    auto other = *scene.try_renderer(everything());
    for (const Eigen::Vector3d& at :
         {Eigen::Vector3d(0, 0, 0.8), Eigen::Vector3d(0, 0, 0.2), Eigen::Vector3d(0, 0, 0.02),
          Eigen::Vector3d(0, 0, -0.02), Eigen::Vector3d(0.3, 0.25, 0.5),
          Eigen::Vector3d(-0.35, -0.2, 0.6), Eigen::Vector3d(0, 0, -3), Eigen::Vector3d(0, 0, 0),
          Eigen::Vector3d(0, 0, 900), Eigen::Vector3d(1e5, -1e5, 1e-4)}) {
      for (const TrackState state : {TrackState::kTracking, TrackState::kCoasting}) {
        GrayImage i420(width, height, kGray);
        Nv12Image nv12(width, height, kGray);
        const PoseTrackPtr track = track_of(
            {estimate_at(pose_at(at.x() - 0.05, at.y(), at.z()), state, kCapture - 50'000'000),
             estimate_at(pose_at(at.x(), at.y(), at.z()), state)});
        std::vector<PoseAt> poses;
        renderer->draw(i420.mutable_view(), time_from_ns(kCapture), std::span(&track, 1), poses);
        other->draw(nv12.mutable_view(), time_from_ns(kCapture), std::span(&track, 1), poses);
        EXPECT_TRUE(same_pixels(i420.view(), nv12.view())) << at.transpose();
        if (width > 100 && at.z() > 0.1 && at.z() < 10) {
          EXPECT_FALSE(differing_luma(i420.view(), kGray).empty()) << at.transpose();
        }
      }
    }
  }
}

TEST(CameraRenderer, PosesThatAreNoNumbersDoNoHarm) {
  const OverlayScene scene;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const double odd : {kNan, kInf, -kInf, 1e300}) {
    PoseEstimate estimate = estimate_at(pose_at(0, 0, 0.8), TrackState::kTracking);
    estimate.world_from_object.translation.x() = odd;
    Drawn(scene, everything(), track_of({estimate}));
    estimate = estimate_at(pose_at(0, 0, 0.8), TrackState::kTracking);
    estimate.covariance.setConstant(odd);
    Drawn(scene, everything(), track_of({estimate}));
  }
  SUCCEED();
}

TEST(CameraRenderer, SameInputSameBytes) {
  OverlayScene scene;
  scene.build_wall({-0.5, 0, 0.5}, {1.0f, 2.0f, 0.02f});
  const PoseTrackPtr track = track_of({estimate_at(pose_at(0, 0, 0.8), TrackState::kTracking)});
  Drawn first(scene, everything(), track);
  const Drawn second(scene, everything(), track);
  EXPECT_TRUE(same_pixels(first.view(), second.view()));
  // Neither the frames before nor what else was drawn leaves a trace.
  const PoseTrackPtr elsewhere =
      track_of({estimate_at(pose_at(0.1, 0.1, 0.3), TrackState::kCoasting)});
  first.renderer().draw(first.image().mutable_view(), time_from_ns(kCapture),
                        std::span(&elsewhere, 1), first.poses);
  first.image().clear(kGray);
  first.renderer().draw(first.image().mutable_view(), time_from_ns(kCapture), std::span(&track, 1),
                        first.poses);
  EXPECT_TRUE(same_pixels(first.view(), second.view()));
}

TEST(CameraRenderer, TheNearerObjectLiesOnTop) {
  const OverlayScene scene;
  OverlayStyle red = only({"fill"});
  red.fill_opacity = 1;
  red.color = {255, 40, 40};
  OverlayStyle blue = red;
  blue.color = {40, 40, 255};
  auto renderer = *CameraRenderer::create(
      scene.camera, CameraId(3),
      {{ObjectId(0), "near", scene.mesh, red}, {ObjectId(1), "far", scene.mesh, blue}}, scene.rays,
      nullptr, {});
  EXPECT_EQ(renderer->camera(), CameraId(3));
  const std::vector<PoseTrackPtr> tracks = {
      track_of({estimate_at(pose_at(0, 0, 0.7), TrackState::kTracking)}),
      track_of({estimate_at(pose_at(0, 0, 0.9), TrackState::kTracking)})};
  GrayImage image(320, 240, kGray);
  std::vector<PoseAt> poses;
  renderer->draw(image.mutable_view(), time_from_ns(kCapture), tracks, poses);
  const Eigen::Vector2d center = *scene.camera.model.project(Eigen::Vector3d(0, 0, 0.7));
  EXPECT_TRUE(is_hue(image.view(), static_cast<int>(center.x()), static_cast<int>(center.y()),
                     to_yuv(red.color), 50));
  EXPECT_EQ(poses.size(), 2u);
}

TEST(CameraRenderer, ObjectsHideEachOther) {
  const OverlayScene scene;
  OverlayStyle style = only({"fill"});
  style.fill_opacity = 1;
  style.color = {40, 230, 60};
  style.xray_color = {225, 90, 255};
  OverlayStyle invisible = bare_style();  // it hides whether or not it is drawn itself
  auto renderer = *CameraRenderer::create(
      scene.camera, CameraId(3),
      {{ObjectId(0), "far", scene.mesh, style}, {ObjectId(1), "near", scene.mesh, invisible}},
      scene.rays, nullptr, {});
  const auto occluded_share = [&](const Rigid3& near) {
    const std::vector<PoseTrackPtr> tracks = {
        track_of({estimate_at(pose_at(0, 0, 0.9), TrackState::kTracking)}),
        track_of({estimate_at(near, TrackState::kTracking)})};
    GrayImage image(320, 240, kGray);
    std::vector<PoseAt> poses;
    renderer->draw(image.mutable_view(), time_from_ns(kCapture), tracks, poses);
    double seen = 0, hidden = 0;
    for (int y = 0; y < 240; y += 2) {
      for (int x = 0; x < 320; x += 2) {
        const int v = image.view().v.row(y / 2)[x / 2];  // green below, magenta above the middle
        if (v > 134) ++hidden;
        if (v < 122) ++seen;
      }
    }
    return hidden / std::max(1.0, seen + hidden);
  };
  EXPECT_EQ(occluded_share(pose_at(0.4, 0, 0.6)), 0);         // beside it
  EXPECT_EQ(occluded_share(pose_at(0, 0, 1.5)), 0);           // behind it
  EXPECT_GT(occluded_share(pose_at(0, 0, 0.6)), 0.95);        // all before it
  const double half = occluded_share(pose_at(0.06, 0, 0.6));  // partly
  EXPECT_GT(half, 0.05);
  EXPECT_LT(half, 0.95);
}

TEST(CameraRenderer, RefusesWhatDoesNotFit) {
  OverlayScene scene;
  const OverlayScene other(160, 120);
  const auto create = [&](std::shared_ptr<const RayTable> rays,
                          std::shared_ptr<const StaticDepth> depth,
                          std::shared_ptr<const RenderMesh> mesh, const OverlayStyle& style,
                          const RenderOptions& options = {}) {
    const auto made = CameraRenderer::create(scene.camera, CameraId(0),
                                             {{ObjectId(0), "box", std::move(mesh), style}},
                                             std::move(rays), std::move(depth), options);
    return made ? std::string() : made.error().message();
  };
  const OverlayStyle plain = only({"fill"});
  EXPECT_EQ(create(scene.rays, nullptr, scene.mesh, plain), "");
  EXPECT_NE(create(other.rays, nullptr, scene.mesh, plain), "");
  EXPECT_NE(create(nullptr, nullptr, scene.mesh, plain), "");
  OverlayScene small(160, 120);
  small.build_wall({0, 0, 2}, {1, 1, 1});
  EXPECT_NE(create(scene.rays, small.depth, scene.mesh, plain), "");
  EXPECT_NE(create(scene.rays, nullptr, nullptr, plain), "");
  const auto with = [&](auto change) {
    OverlayStyle style = plain;
    change(style);
    return create(scene.rays, nullptr, scene.mesh, style);
  };
  EXPECT_NE(with([](OverlayStyle& s) { s.fill_opacity = 1.5f; }), "");
  EXPECT_NE(with([](OverlayStyle& s) { s.outline_px = 1; }), "");
  EXPECT_NE(with([](OverlayStyle& s) { s.line_px = NAN; }), "");
  EXPECT_NE(with([](OverlayStyle& s) { s.font_px = 3; }), "");
  EXPECT_NE(with([](OverlayStyle& s) { s.trail_seconds = -1; }), "");
  RenderOptions no_font;
  no_font.font_file = "/nowhere/a.ttf";
  EXPECT_EQ(create(scene.rays, nullptr, scene.mesh, plain, no_font), "");  // writes no text
  EXPECT_NE(
      create(scene.rays, nullptr, scene.mesh, only({"label"}), no_font).find("/nowhere/a.ttf"),
      std::string::npos);
}

/// Against many poses drawn from the covariance itself.
TEST(Ellipse, CovarianceIsThatOfSampledPoses) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0.1, -0.05, 0.8);
  const Eigen::Vector3d point(0.03, -0.02, 0.01);
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance.diagonal() << 4e-5, 1e-5, 2e-5, 1e-6, 4e-6, 9e-6;
  const auto predicted = marks::pixel_covariance(scene.camera.model, pose, covariance, point);
  ASSERT_TRUE(predicted.has_value());
  Dice dice(9);
  const auto normal = [&] {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += dice.uniform(0, 1);
    return sum;
  };
  Eigen::Matrix2d sampled = Eigen::Matrix2d::Zero();
  const Eigen::Vector2d mean = *scene.camera.model.project(pose * point);
  constexpr int kSamples = 20'000;
  for (int i = 0; i < kSamples; ++i) {
    Vector6 d;
    for (int k = 0; k < 6; ++k) d[k] = std::sqrt(covariance(k, k)) * normal();
    const Eigen::Vector2d off = *scene.camera.model.project(pose * Rigid3::exp(d) * point) - mean;
    sampled += off * off.transpose() / kSamples;
  }
  EXPECT_LT((sampled - *predicted).norm(), 0.04 * predicted->norm());
}

TEST(Ellipse, GrowsWithTheUncertaintyAndStaysVisible) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0, 0, 0.8);
  const auto width = [&](double sigma) {
    PoseEstimate estimate = estimate_at(pose, TrackState::kTracking);
    estimate.covariance.setZero();
    estimate.covariance.diagonal().segment<3>(3).setConstant(sigma * sigma);
    const auto changed = Drawn(scene, only({"ellipse"}), track_of({estimate})).changed();
    int low = 1 << 20, high = 0;
    for (const auto& [x, y] : changed) {
      low = std::min(low, x);
      high = std::max(high, x);
    }
    return high - low;
  };
  EXPECT_GE(width(0), 3);
  EXPECT_LE(width(0), 12);
  // Two sigmas to either side, at 0.9 * 320 / 0.8 px to a meter.
  EXPECT_NEAR(width(0.05), 4 * 0.05 * 360, 10);
}

TEST(Cross, MarksTheCenterAndLeavesItOpen) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0, 0, 0.8);
  const Drawn drawn(scene, only({"cross"}), pose);
  const Eigen::Vector2d center =
      *scene.camera.model.project(pose * scene.mesh->center.cast<double>());
  ASSERT_FALSE(drawn.changed().empty());
  for (const auto& [x, y] : drawn.changed()) {
    const double away = std::hypot(x - center.x(), y - center.y());
    EXPECT_LT(away, 12);
    EXPECT_GT(away, 1);
  }
}

TEST(Wireframe, HiddenLinesAreDashedIfAsked) {
  const OverlayScene scene;
  const Rigid3 pose = pose_at(0, 0, 0.8);
  OverlayStyle style = only({"wireframe"});
  const size_t without = Drawn(scene, style, pose).changed().size();
  style.hidden_lines = true;
  const size_t with = Drawn(scene, style, pose).changed().size();
  // A box turned so: nine edges are seen, three are not.
  EXPECT_GT(with, without + without / 10);
  EXPECT_LT(with, 2 * without);
}

}  // namespace
}  // namespace sightline
