// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/scene_watch.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "calibrate/watch/scene_reference.hpp"
#include "calibrate/watch/turn_fit.hpp"

namespace sightline {

using calibrate::PatchTemplate;
using calibrate::SceneLearner;
using calibrate::ScenePair;
using calibrate::ScenePatch;
using calibrate::SceneReference;
using calibrate::TurnFit;

namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 1s;
constexpr Duration kBetweenSearches = 3s;
constexpr Duration kBetweenNames = 10s;  // looks at the rooms of other cameras
constexpr int kSearchRange = 24;         // [px] of the half-size image
constexpr double kFound = 0.8, kRoughlyFound = 0.5, kStillThere = 0.7;  // correlation
constexpr double kSamePlace = 0.7;                                      // [px]
constexpr double kAgreeing = 0.5;                                       // of what was found
constexpr double kFoundShare = 0.3;  // of what should be in the image
constexpr double kStillShare = 0.15;
constexpr int kFewest = 8, kFewestLearned = 12, kFewestNinths = 4;
constexpr double kZoomed = 0.015;
constexpr int kGone = 120;            // looks without a patch before another takes its place
constexpr int kBetweenRenewals = 60;  // looks
constexpr double kAtRest = 0.0009;    // [rad] (0.05 deg)
constexpr double kDark = 20;          // mean gray; nothing is said of an image that is darker
constexpr double kBallMargin = 6;     // [px] of the half-size image

Eigen::Vector2d to_full(const Eigen::Vector2d& half) {
  return 2 * half + Eigen::Vector2d::Constant(0.5);
}
Eigen::Vector2d to_half(const Eigen::Vector2d& full) {
  return 0.5 * (full - Eigen::Vector2d::Constant(0.5));
}

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& v) {
  return v.norm() > 0 ? Eigen::AngleAxisd(v.norm(), v.normalized()).toRotationMatrix()
                      : Eigen::Matrix3d::Identity();
}

double mean_gray(const PlaneView& image) {
  double sum = 0;
  int count = 0;
  for (int y = 0; y < image.height; y += 8) {
    for (int x = 0; x < image.width; x += 8, ++count) sum += image.row(y)[x];
  }
  return sum / std::max(1, count);
}

// A reference that is ready to be looked for.
struct Room {
  Room(SceneReferencePtr from, const CameraModel& lens) : reference(std::move(from)) {
    for (const ScenePatch& patch : reference->patches) {
      templates.emplace_back(patch);
      rays.push_back(lens.unproject(to_full(patch.pixel)).value_or(Eigen::Vector3d::Zero()));
    }
  }
  SceneReferencePtr reference;
  std::vector<PatchTemplate> templates;
  std::vector<Eigen::Vector3d> rays;
};

struct Circle {
  Eigen::Vector2d center;
  double radius = 0;
};

}  // namespace

class SceneWatch::Impl {
 public:
  Impl(CalibratedCamera camera, CameraId id, std::shared_ptr<SceneReferences> references)
      : camera_(std::move(camera)), id_(id), references_(std::move(references)) {
    if (auto known = references_->find(camera_)) adopt(std::move(known));
    learner_.begin({});
  }

  bool due(Time capture) const {
    return last_ == Time::min() || capture >= last_ + kPeriod || capture < last_ - kPeriod;
  }

  std::optional<SceneLook> look(const PlaneView& image, Time capture,
                                std::span<const SceneBall> balls) {
    if (!due(capture) || image.width != camera_.model.width() / 2 ||
        image.height != camera_.model.height() / 2) {
      return std::nullopt;
    }
    last_ = capture;
    mask(balls);
    if (!room_) {
      learn(image);
      return std::nullopt;
    }
    std::optional<TurnFit> fit = find(image, *room_, guess_, false);
    if (!fit && (capture >= next_search_ || capture < next_search_ - kBetweenSearches)) {
      next_search_ = capture + kBetweenSearches;
      fit = find(image, *room_, Eigen::Vector3d::Zero(), true);
      if (!fit) {
        guess_.setZero();
        zoom_ = find_zoom();
      }
    }
    if (!fit) return look_elsewhere(image, capture);
    guess_ = settled_ = fit->turn;
    forget_rival();
    note_found(image, *fit);
    SceneLook look{id_, capture};
    look.turn = fit->turn;
    look.covariance = fit->covariance;
    look.patches = fit->inliers;
    return look;
  }

 private:
  void adopt(SceneReferencePtr reference) {
    room_.emplace(std::move(reference), camera_.model);
    misses_.assign(room_->templates.size(), 0);
  }

  void mask(std::span<const SceneBall> balls) {
    circles_.clear();
    const Rigid3 camera_from_world = camera_.world_from_camera.inverse();
    for (const SceneBall& ball : balls) {
      const Eigen::Vector3d center = camera_from_world * ball.center_in_world;
      const auto pixel = camera_.model.project(center);
      if (!pixel) continue;
      const double focal = std::max(camera_.model.parameters().fx, camera_.model.parameters().fy);
      circles_.push_back(
          {to_half(*pixel), 0.5 * focal * ball.radius / center.norm() + kBallMargin});
    }
  }
  bool masked(const Eigen::Vector2d& pixel) const {
    return std::ranges::any_of(
        circles_, [&](const Circle& c) { return (pixel - c.center).norm() < c.radius; });
  }

  // The room is taken as this camera's once enough of it stands still.
  void learn(const PlaneView& image) {
    if (auto learned = learned_from(image, learner_)) {
      references_->set(camera_, learned);
      adopt(std::move(learned));
    }
  }
  SceneReferencePtr learned_from(const PlaneView& image, SceneLearner& learner) const {
    if (!learner.step(image, [this](const auto& pixel) { return masked(pixel); })) return nullptr;
    SceneReference reference{image.width, image.height, learner.take()};
    if (reference.patches.size() < size_t{kFewestLearned} ||
        calibrate::covered_ninths(reference.patches, image.width, image.height) < kFewestNinths) {
      return nullptr;
    }
    return std::make_shared<const SceneReference>(std::move(reference));
  }

  // Where the patches are; fills pairs_ and of_pair_.
  int match(const PlaneView& image, const Room& room, const Eigen::Vector3d& guess, bool search) {
    pairs_.clear();
    of_pair_.clear();
    int visible = 0;
    const Eigen::Matrix3d now_from_calibrated = rotation_of(-guess);
    for (size_t i = 0; i < room.templates.size(); ++i) {
      const auto expected = camera_.model.project(now_from_calibrated * room.rays[i]);
      if (!expected) continue;
      Eigen::Vector2d at = to_half(*expected);
      if (at.x() < 8 || at.y() < 8 || at.x() > image.width - 9 || at.y() > image.height - 9) {
        continue;
      }
      if (masked(at)) continue;
      ++visible;
      if (search) {
        const auto rough = search_patch(image, room.templates[i], at, kSearchRange);
        if (!rough || rough->score < kRoughlyFound) continue;
        at = rough->pixel;
      }
      const auto found = refine_patch(image, room.templates[i], at);
      if (!found || found->score < kFound || masked(found->pixel)) continue;
      pairs_.push_back({room.rays[i], to_full(found->pixel)});
      of_pair_.push_back(i);
    }
    return visible;
  }

  bool agrees(const TurnFit& fit, const Room& room) const {
    if (fit.inliers < kFewest || fit.inliers < kAgreeing * static_cast<double>(pairs_.size()) ||
        fit.inliers < kFoundShare * visible_) {
      return false;
    }
    std::vector<ScenePatch> spread;
    for (size_t i = 0; i < pairs_.size(); ++i) {
      if (fit.is_inlier[i] != 0) spread.push_back(room.reference->patches[of_pair_[i]]);
    }
    return calibrate::covered_ninths(spread, room.reference->width, room.reference->height) >=
           kFewestNinths;
  }

  std::optional<TurnFit> find(const PlaneView& image, const Room& room,
                              const Eigen::Vector3d& guess, bool search) {
    visible_ = match(image, room, guess, search);
    auto fit = fit_turn(camera_.model, pairs_, guess, false);
    if (fit && !agrees(*fit, room)) fit.reset();
    return fit;
  }
  // Of the pairs of the last search.
  double find_zoom() const {
    const auto fit = fit_turn(camera_.model, pairs_, Eigen::Vector3d::Zero(), true);
    const bool zoomed = fit && agrees(*fit, *room_) && std::abs(fit->zoom - 1) > kZoomed;
    return zoomed ? fit->zoom : 1;
  }

  // Nothing is where it was. Another image that stands still for seconds, with nothing of the room
  // left in it, is another room; somebody before the camera is not.
  std::optional<SceneLook> look_elsewhere(const PlaneView& image, Time capture) {
    if (mean_gray(image) < kDark || still_there(image)) {
      forget_rival();
      return std::nullopt;
    }
    if (!rival_) {
      if (auto learned = learned_from(image, rival_learner_)) {
        rival_.emplace(std::move(learned), camera_.model);
      }
      return std::nullopt;
    }
    if (!find(image, *rival_, Eigen::Vector3d::Zero(), false)) {
      const double zoom = zoom_;
      forget_rival();
      zoom_ = zoom;
      return std::nullopt;
    }
    compare_next_room(image, capture);
    SceneLook look{id_, capture, SceneLook::Kind::kUnfit};
    look.zoom = zoom_;
    look.looks_like = looks_like_;
    return look;
  }

  // Some of the room, where it should be or where it was seen last.
  bool still_there(const PlaneView& image) const {
    return still_at(image, Eigen::Vector3d::Zero()) || still_at(image, settled_);
  }
  bool still_at(const PlaneView& image, const Eigen::Vector3d& turn) const {
    int still = 0, visible = 0;
    const Eigen::Matrix3d now_from_calibrated = rotation_of(-turn);
    for (size_t i = 0; i < room_->templates.size(); ++i) {
      const auto expected = camera_.model.project(now_from_calibrated * room_->rays[i]);
      if (!expected || masked(to_half(*expected))) continue;
      ++visible;
      const auto found = refine_patch(image, room_->templates[i], to_half(*expected));
      still += found && found->score > kStillThere &&
                       (found->pixel - to_half(*expected)).norm() < kSamePlace
                   ? 1
                   : 0;
    }
    return still >= std::max(4.0, kStillShare * visible);
  }

  // Whose room is it? One at a look, as each is searched for all over the image; then a pause.
  void compare_next_room(const PlaneView& image, Time capture) {
    if (capture < next_names_ && capture >= next_names_ - kBetweenNames) return;
    const auto others = references_->others(camera_);
    if (compared_rooms_ == 0) most_alike_ = {};
    if (compared_rooms_ < others.size()) {
      const auto& [name, reference] = others[compared_rooms_++];
      const Room room(reference, camera_.model);
      const auto fit = find(image, room, Eigen::Vector3d::Zero(), true);
      if (fit && fit->inliers > most_alike_.second) most_alike_ = {name, fit->inliers};
    }
    if (looks_like_.empty()) looks_like_ = most_alike_.first;
    if (compared_rooms_ < others.size()) return;
    looks_like_ = most_alike_.first;
    compared_rooms_ = 0;
    next_names_ = capture + kBetweenNames;
  }

  void forget_rival() {
    rival_.reset();
    rival_learner_.begin({});
    looks_like_.clear();
    next_names_ = Time::min();
    compared_rooms_ = 0;
    zoom_ = 1;
  }

  // A room changes in the course of a day.
  void note_found(const PlaneView& image, const TurnFit& fit) {
    for (int& misses : misses_) ++misses;
    for (size_t i = 0; i < pairs_.size(); ++i) {
      if (fit.is_inlier[i] != 0) misses_[of_pair_[i]] = 0;
    }
    if (fit.turn.norm() > kAtRest) {
      renewing_ = false;
      return;
    }
    if (!renewing_) {
      if (++since_renewal_ < kBetweenRenewals) return;
      since_renewal_ = 0;
      renewing_ = true;
      std::vector<char> taken(size_t{calibrate::kSceneColumns} * calibrate::kSceneRows, 0);
      for (size_t i = 0; i < misses_.size(); ++i) {
        if (misses_[i] < kGone) taken[cell_of(room_->reference->patches[i])] = 1;
      }
      learner_.begin(std::move(taken));
    }
    if (!learner_.step(image, [this](const auto& pixel) { return masked(pixel); })) return;
    renewing_ = false;
    renew(learner_.take(), fit.turn);
  }

  size_t cell_of(const ScenePatch& patch) const {
    return static_cast<size_t>(
        calibrate::scene_cell(patch.pixel, room_->reference->width, room_->reference->height));
  }

  void renew(std::vector<ScenePatch> learned, const Eigen::Vector3d& turn) {
    SceneReference next = *room_->reference;
    next.patches.clear();
    std::vector<char> replaced(size_t{calibrate::kSceneColumns} * calibrate::kSceneRows, 0);
    for (ScenePatch& patch : learned) {
      replaced[cell_of(patch)] = 1;
      // Where it would be for a camera that has not turned: what is renewed does not walk away.
      const auto ray = camera_.model.unproject(to_full(patch.pixel));
      if (!ray) continue;
      const auto pixel = camera_.model.project(rotation_of(turn) * *ray);
      if (!pixel) continue;
      patch.pixel = to_half(*pixel);
      next.patches.push_back(patch);
    }
    if (next.patches.empty()) return;
    for (size_t i = 0; i < misses_.size(); ++i) {
      const ScenePatch& patch = room_->reference->patches[i];
      if (replaced[cell_of(patch)] == 0) next.patches.push_back(patch);
    }
    next.patches.resize(std::min(next.patches.size(), replaced.size()));
    auto reference = std::make_shared<const SceneReference>(std::move(next));
    references_->set(camera_, reference);
    adopt(std::move(reference));
  }

  const CalibratedCamera camera_;
  const CameraId id_;
  const std::shared_ptr<SceneReferences> references_;
  std::optional<Room> room_, rival_;
  SceneLearner learner_, rival_learner_;
  std::vector<int> misses_;  // by patch of room_
  std::vector<ScenePair> pairs_;
  std::vector<size_t> of_pair_;  // patches
  int visible_ = 0;
  std::vector<Circle> circles_;
  Eigen::Vector3d guess_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d settled_ = Eigen::Vector3d::Zero();  // the last turn that was found
  double zoom_ = 1;
  std::string looks_like_;
  size_t compared_rooms_ = 0;                 // of others, in this turn
  std::pair<std::string, int> most_alike_{};  // of these, and its patches
  bool renewing_ = false;
  int since_renewal_ = 0;
  Time last_ = Time::min(), next_search_ = Time::min(), next_names_ = Time::min();
};

SceneWatch::SceneWatch(CalibratedCamera camera, CameraId id,
                       std::shared_ptr<SceneReferences> references)
    : impl_(std::make_unique<Impl>(std::move(camera), id, std::move(references))) {}
SceneWatch::~SceneWatch() = default;
SceneWatch::SceneWatch(SceneWatch&&) noexcept = default;

bool SceneWatch::due(Time capture) const { return impl_->due(capture); }

std::optional<SceneLook> SceneWatch::look(const PlaneView& half_gray, Time capture,
                                          std::span<const SceneBall> balls) {
  return impl_->look(half_gray, capture, balls);
}

}  // namespace sightline
