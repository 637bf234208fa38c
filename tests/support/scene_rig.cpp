// SPDX-License-Identifier: Apache-2.0
#include "support/scene_rig.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

namespace sightline::test {
namespace {

constexpr double kCardDistance = 0.25;  // [m] from the camera
constexpr double kCardReach = 0.13;     // [m] half its side

CalibratedCamera camera_at(const SceneRigOptions& options, size_t index) {
  const double angle = options.azimuths_deg[index] * std::numbers::pi / 180;
  const Eigen::Vector3d from =
      options.distance * Eigen::Vector3d(std::cos(options.elevation) * std::cos(angle),
                                         std::cos(options.elevation) * std::sin(angle),
                                         std::sin(options.elevation));
  Eigen::Matrix3d axes;
  axes.col(2) = -from.normalized();
  axes.col(0) = axes.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  const std::string name = fmt::format("cam{}", index);
  return {name, CameraModel::create(options.lens, name).value(),
          Rigid3(Eigen::Quaterniond(axes), from), 0.0};
}

}  // namespace

SceneRig::SceneRig(const SceneRigOptions& options) : options_(options) {
  SL_CHECK(options.shape != nullptr && options.path, "a rig needs a shape and a path");
  const auto backdrop = std::make_shared<const Backdrop>(options.backdrop);
  for (size_t i = 0; i < options.azimuths_deg.size(); ++i) {
    cameras_.push_back(camera_at(options, i));
    renderers_.emplace_back(cameras_.back(), backdrop, options.blur_px);
  }
  if (options.knock.camera >= 0) {
    CalibratedCamera knocked = cameras_.at(static_cast<size_t>(options.knock.camera));
    knocked.world_from_camera = knocked.world_from_camera * Rigid3::exp(options.knock.by);
    renderers_.emplace_back(knocked, backdrop, options.blur_px);
  }
  bodies_ = bodies();
  for (int camera = 0; camera < static_cast<int>(cameras_.size()); ++camera) {
    const auto index = static_cast<size_t>(camera);
    const double phase = options.phases.empty() ? 0 : options.phases[index];
    const Duration skew = options.skews.empty() ? Duration(0) : options.skews[index];
    const auto frames = static_cast<uint64_t>(to_seconds(options.duration) * options.rate_hz + 0.5);
    for (uint64_t sequence = 0; sequence < frames; ++sequence) {
      const double periods = static_cast<double>(sequence) + phase;
      const Time capture = options.start + from_seconds(periods / options.rate_hz);
      shots_.push_back({camera, sequence, capture, capture + skew});
    }
  }
  std::stable_sort(shots_.begin(), shots_.end(), [](const SceneShot& a, const SceneShot& b) {
    return std::tuple(a.stamp, a.camera) < std::tuple(b.stamp, b.camera);
  });
}

Rigid3 SceneRig::truth(Time time) const { return options_.path(Time(time - options_.start)); }

std::vector<SceneBody> SceneRig::bodies() const {
  std::vector<SceneBody> all;
  all.push_back({options_.shape, options_.paint,
                 [path = options_.path, start = options_.start](
                     Time time) -> std::optional<Rigid3> { return path(Time(time - start)); }});
  for (const SceneCard& card : options_.cards) {
    for (int camera = 0; camera < static_cast<int>(cameras_.size()); ++camera) {
      if (card.camera < 0 || card.camera == camera) all.push_back(card_body(card, camera));
    }
  }
  all.insert(all.end(), options_.others.begin(), options_.others.end());
  return all;
}

SceneBody SceneRig::card_body(const SceneCard& card, int camera) const {
  static const auto shape = std::make_shared<const RayMesh>(
      make_box({static_cast<float>(2 * kCardReach), static_cast<float>(2 * kCardReach), 0.002f}));
  SceneBody body;
  body.shape = shape;
  body.paint.kind = Paint::Kind::kPrinted;
  body.paint.seed = static_cast<uint32_t>(91 + camera);
  const Rigid3 world_from_camera = cameras_[static_cast<size_t>(camera)].world_from_camera;
  body.world_from_body = [=, start = options_.start](Time time) -> std::optional<Rigid3> {
    const Duration at = time - start;
    if (at < card.from - card.slide || at > card.to + card.slide) return std::nullopt;
    const Duration away = std::max({Duration(0), card.from - at, at - card.to});
    const double out = card.slide.count() > 0 ? to_seconds(away) / to_seconds(card.slide) : 0;
    const double x = -2 * kCardReach * (out + 1 - card.share);
    return world_from_camera * Rigid3(Eigen::Quaterniond::Identity(), {x, 0, kCardDistance});
  };
  return body;
}

std::vector<std::vector<SceneShot>> SceneRig::sets() const {
  std::vector<std::vector<SceneShot>> sets;
  for (const SceneShot& shot : shots_) {
    if (sets.empty() || sets.back().front().stamp != shot.stamp) sets.emplace_back();
    sets.back().push_back(shot);
  }
  return sets;
}

FrameInfo SceneRig::info_of(const SceneShot& shot) const {
  FrameInfo info;
  info.camera = CameraId(static_cast<uint32_t>(shot.camera));
  info.sequence = shot.sequence;
  info.capture = shot.stamp;
  info.arrival = shot.stamp + options_.delay;
  info.width = options_.lens.width;
  info.height = options_.lens.height;
  return info;
}

const SceneRenderer& SceneRig::renderer_of(const SceneShot& shot) const {
  const bool knocked = shot.camera == options_.knock.camera &&
                       shot.true_capture - options_.start >= options_.knock.from;
  return knocked ? renderers_.back() : renderers_[static_cast<size_t>(shot.camera)];
}

FramePtr SceneRig::shoot(const SceneShot& shot) const {
  Sensor sensor = options_.sensor;
  if (options_.exposure) sensor.exposure *= options_.exposure(shot.camera, shot.true_capture);
  const uint64_t noise =
      options_.seed * 1'000'003 + static_cast<uint64_t>(shot.camera) * 100'003 + shot.sequence;
  return renderer_of(shot).shoot(bodies_, shot.true_capture, sensor, noise, info_of(shot));
}

double SceneRig::visible_share(const SceneShot& shot) const {
  const auto seen = renderer_of(shot).visible(bodies_, 0, shot.true_capture);
  return seen.whole > 0 ? static_cast<double>(seen.shown) / seen.whole : 0.0;
}

}  // namespace sightline::test
