// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/occlusion_learner.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "hidden_cells.hpp"
#include "still_colors.hpp"
#include "surface_colors.hpp"

namespace sightline {
namespace {

using observe::CellColor;
using observe::CellEvidence;
using observe::CellReader;
using observe::CellRect;
using observe::HiddenCells;
using observe::StillColors;
using observe::SurfaceColors;

constexpr Duration kOthersWithin = std::chrono::milliseconds(100);
constexpr double kMostOffPx = 4;  // one sigma of the pose, in this picture
constexpr int kKeepOff = 5;       // cells around an object that are no part of the still scene
constexpr int kPublished = 8;     // cells around an object: it moves until it is drawn

// Densities of a colour, relative to one that is exactly what was expected.
constexpr float kSurface = 0.6f;      // on the object's surface: seen less exactly than the scene
constexpr float kWrongColor = 3e-4f;  // of a place of it that was seen, in quite another colour
constexpr float kOther = 0.003f;      // of something else that happens to be there
constexpr float kMostEvidence = 3;    // of one cell, as a logarithm
constexpr float kClearly = 25;  // squared sigmas from the still scene: something is in front of it
constexpr float kStill = 9;
constexpr int kHalf = 2;             // cells to either side whose evidence is averaged
constexpr int kFewestCells = 6;      // of these
constexpr float kCannotTell = 0.9f;  // logarithms below say nothing
// The same for a place of the surface that was never seen ...
constexpr float kUnchanged = -2.5f;    // where a varied scene looks as ever
constexpr float kPlain = -0.36f;       // where a plain one does, as the object might by chance
constexpr float kCovered = 1.9f;       // where the scene does not
constexpr float kNotItsColor = -2.0f;  // in an upset picture, of a colour that the object has not
constexpr float kUpset = 0.5f;         // share of the picture that is not as it was

float likeness(float squared) {
  const float heavy = 1 / (1 + 0.25f * squared);
  return heavy * heavy;
}

/// One object in one frame: its projection, cell by cell.
struct Projection {
  bool there = false;   ///< the object has a pose, and some of it is in the picture
  bool judged = false;  ///< ... which the other cameras hold
  CellRect rect;
  Rigid3 object_from_camera;
  std::vector<float> depth;     ///< 1/z; 0: not covered
  std::vector<uint8_t> inside;  ///< covered, and so are all neighbours

  int width() const { return rect.right - rect.left; }
  size_t at(int x, int y) const {
    return static_cast<size_t>(y - rect.top) * static_cast<size_t>(width()) +
           static_cast<size_t>(x - rect.left);
  }
  float depth_at(int x, int y) const { return there && rect.contains(x, y) ? depth[at(x, y)] : 0; }
};

}  // namespace

class OcclusionLearner::Impl {
 public:
  Impl(const CalibratedCamera& camera, CameraId id, std::vector<HideableObject> objects)
      : camera_(camera),
        id_(id),
        camera_from_world_(camera.world_from_camera.inverse()),
        width_(camera.model.width() / HiddenDepth::kStep),
        height_(camera.model.height() / HiddenDepth::kStep),
        still_(width_, height_),
        cells_(width_, height_) {
    for (HideableObject& object : objects) {
      objects_.push_back(std::make_unique<Object>(std::move(object), camera.model));
    }
    trace_rays();
  }

  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks);
  HiddenDepthPtr hidden() const { return hidden_; }
  const Look& look() const { return look_; }

 private:
  struct Object {
    Object(HideableObject given, const CameraModel& camera)
        : known(std::move(given)),
          renderer(known.depth(camera)),
          surface(known.center, known.radius) {}
    HideableObject known;
    std::unique_ptr<DepthRenderer> renderer;
    SurfaceColors surface;
    Projection now;
    CellRect before;  ///< where it was judged last
  };

  void trace_rays();
  bool place(Object& object, const PoseTrack* track, Time capture);
  bool held_by_others(const PoseTrack& track, const PoseAt& at, Time capture) const;
  void project(Object& object, const Rigid3& world_from_object);
  CellRect grown(const CellRect& rect, int by) const;
  bool behind_another(const Object& object, int x, int y, float depth) const;
  Eigen::Vector3f point_on(const Object& object, int x, int y, float depth) const;
  void weigh(Object& object, const CellReader& frame);
  std::optional<float> weigh_cell(const Object& object, int x, int y, float depth,
                                  const CellColor& color, bool& still) const;
  std::optional<float> guess_still(const Object& object, int x, int y,
                                   const CellColor& color) const;
  void spread(const Object& object);
  void judge_upset(const Projection& now);
  std::optional<float> guess_upset(const Object& object, const CellColor& color) const;
  CellEvidence mean_evidence(const Projection& projection, int x, int y) const;
  void judge(Object& object);
  void remember(Object& object, const CellReader& frame);
  void forget_passing(Object& object);
  void publish(Time time);

  const CalibratedCamera camera_;
  const CameraId id_;
  const Rigid3 camera_from_world_;
  const int width_, height_;
  StillColors still_;
  HiddenCells cells_;
  std::vector<std::unique_ptr<Object>> objects_;
  std::vector<Eigen::Vector2f> rays_;  ///< x/z, y/z of the middle of every cell

  // Of the object that is judged, by its projection's cells.
  std::vector<float> evidence_;
  std::vector<uint8_t> says_, is_still_, guessed_, spread_;
  std::vector<CellRect> busy_;

  std::array<std::shared_ptr<HiddenDepth>, 4> buffers_;
  HiddenDepthPtr hidden_;
  bool upset_ = false;  ///< in the newest frame the whole picture was not as it used to be
  Look look_;
};

void OcclusionLearner::Impl::trace_rays() {
  rays_.resize(static_cast<size_t>(width_) * static_cast<size_t>(height_));
  size_t i = 0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const auto ray = camera_.model.unproject({2 * x + 0.5, 2 * y + 0.5});
      if (ray && ray->z() > 0) rays_[i] = (ray->head<2>() / ray->z()).cast<float>();
      ++i;
    }
  }
}

CellRect OcclusionLearner::Impl::grown(const CellRect& rect, int by) const {
  return {std::max(0, rect.left - by), std::max(0, rect.top - by),
          std::min(width_, rect.right + by), std::min(height_, rect.bottom + by)};
}

// The pose must stand without this camera's word.
bool OcclusionLearner::Impl::held_by_others(const PoseTrack& track, const PoseAt& at,
                                            Time capture) const {
  if (at.estimate.state != TrackState::kTracking) return false;
  CameraSet others = 0;
  for (auto past = track.history().rbegin(); past != track.history().rend(); ++past) {
    if (capture - past->time > kOthersWithin) break;
    if (past->time - capture <= kOthersWithin) others |= past->cameras;
  }
  if ((others & ~camera_bit(id_)) == 0) return false;
  const Eigen::Vector3d center = camera_from_world_ * at.estimate.world_from_object.translation;
  const double px = camera_.model.parameters().fx * at.estimate.sigma_translation();
  return px < kMostOffPx * std::max(center.z(), 1e-3);
}

// False if nobody knows where the object is: then any cell may show it.
bool OcclusionLearner::Impl::place(Object& object, const PoseTrack* track, Time capture) {
  object.now.there = object.now.judged = false;
  object.now.rect = {};
  if (track == nullptr || track->empty()) return false;
  const PoseAt at = track->at(capture);
  if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) return false;
  project(object, at.estimate.world_from_object);
  object.now.judged = object.now.there && held_by_others(*track, at, capture);
  return at.estimate.state != TrackState::kCoasting;
}

void OcclusionLearner::Impl::project(Object& object, const Rigid3& world_from_object) {
  Projection& now = object.now;
  const Rigid3 camera_from_object = camera_from_world_ * world_from_object;
  const DepthTile tile = object.renderer->render(camera_from_object);
  now.there = tile.width > 0;
  if (!now.there) return;
  now.object_from_camera = camera_from_object.inverse();
  now.rect = grown(
      {tile.x / 2, tile.y / 2, (tile.x + tile.width + 1) / 2, (tile.y + tile.height + 1) / 2}, 0);
  const size_t count = static_cast<size_t>(std::max(0, now.width())) *
                       static_cast<size_t>(std::max(0, now.rect.bottom - now.rect.top));
  now.depth.assign(count, 0.0f);
  now.inside.assign(count, 0);
  size_t i = 0;
  for (int y = now.rect.top; y < now.rect.bottom; ++y) {
    for (int x = now.rect.left; x < now.rect.right; ++x, ++i) {
      const float a = tile.at(2 * x, 2 * y), b = tile.at(2 * x + 1, 2 * y);
      const float c = tile.at(2 * x, 2 * y + 1), d = tile.at(2 * x + 1, 2 * y + 1);
      if (std::min({a, b, c, d}) > 0) now.depth[i] = 0.25f * (a + b + c + d);
    }
  }
  for (int y = now.rect.top; y < now.rect.bottom; ++y) {
    for (int x = now.rect.left; x < now.rect.right; ++x) {
      bool inside = true;
      for (int ny = y - 1; ny <= y + 1 && inside; ++ny) {
        for (int nx = x - 1; nx <= x + 1 && inside; ++nx) inside = now.depth_at(nx, ny) > 0;
      }
      now.inside[now.at(x, y)] = inside ? 1 : 0;
    }
  }
}

bool OcclusionLearner::Impl::behind_another(const Object& object, int x, int y, float depth) const {
  return std::any_of(objects_.begin(), objects_.end(), [&](const auto& other) {
    return other.get() != &object && other->now.depth_at(x, y) > depth;
  });
}

Eigen::Vector3f OcclusionLearner::Impl::point_on(const Object& object, int x, int y,
                                                 float depth) const {
  const Eigen::Vector2f& ray =
      rays_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
  const Eigen::Vector3d in_camera =
      Eigen::Vector3d(static_cast<double>(ray.x()), static_cast<double>(ray.y()), 1) /
      static_cast<double>(depth);
  return (object.now.object_from_camera * in_camera).cast<float>();
}

// Logarithm of how much better the object explains a cell than the scene or anything else does.
// Empty: nothing is known to compare with.
std::optional<float> OcclusionLearner::Impl::weigh_cell(const Object& object, int x, int y,
                                                        float depth, const CellColor& color,
                                                        bool& still) const {
  const bool scene_known = still_.known(x, y);
  const float off = scene_known ? still_.distance(x, y, color) : 0;
  still = scene_known && off < kStill;
  const size_t place = object.surface.at(point_on(object, x, y, depth));
  if (!object.surface.known(place)) {
    if (still) return guess_still(object, x, y, color);
    if (upset_) return guess_upset(object, color);
    if (!scene_known) return std::nullopt;
    return kCovered;
  }
  const float scene = scene_known ? std::max(kOther, likeness(off)) : kOther;
  const float surface = kSurface * likeness(object.surface.distance(place, color)) + kWrongColor;
  const float better = std::log(surface / scene);
  if (std::abs(better) < kCannotTell) return std::nullopt;
  return std::clamp(better, -kMostEvidence, kMostEvidence);
}

// The scene looks as ever; whether the object could look like that here is not known.
std::optional<float> OcclusionLearner::Impl::guess_still(const Object& object, int x, int y,
                                                         const CellColor& color) const {
  if (object.surface.has(color)) return std::nullopt;
  return still_.varied(x, y) ? kUnchanged : kPlain;
}

// What hides the object at a cell hides it as well at those beside it that look the same, as far as
// they look as ever and nothing is known of the object's surface there.
void OcclusionLearner::Impl::spread(const Object& object) {
  const Projection& now = object.now;
  const auto take = [&](int x, int y, int from_x, int from_y) {
    const size_t i = now.at(x, y);
    if (!guessed_[i] || !now.rect.contains(from_x, from_y)) return;
    const size_t from = now.at(from_x, from_y);
    const bool hidden =
        now.depth[from] > 0 && (spread_[from] || cells_.scene_hides(from_x, from_y, now.depth[i]));
    if (hidden && still_.alike(x, y, from_x, from_y)) spread_[i] = 1;
  };
  for (int y = now.rect.top; y < now.rect.bottom; ++y) {
    for (int x = now.rect.left; x < now.rect.right; ++x) {
      take(x, y, x - 1, y);
      take(x, y, x, y - 1);
    }
  }
  for (int y = now.rect.bottom - 1; y >= now.rect.top; --y) {
    for (int x = now.rect.right - 1; x >= now.rect.left; --x) {
      take(x, y, x + 1, y);
      take(x, y, x, y + 1);
      const size_t i = now.at(x, y);
      if (!spread_[i]) continue;
      evidence_[i] = kUnchanged;
      says_[i] = 1;
    }
  }
}

// The whole picture has changed, so that a change here says nothing.
std::optional<float> OcclusionLearner::Impl::guess_upset(const Object& object,
                                                         const CellColor& color) const {
  if (!object.surface.well_known()) return std::nullopt;
  if (object.surface.has(color)) return std::nullopt;
  return kNotItsColor;
}

void OcclusionLearner::Impl::weigh(Object& object, const CellReader& frame) {
  const Projection& now = object.now;
  evidence_.assign(now.depth.size(), 0.0f);
  says_.assign(now.depth.size(), 0);
  is_still_.assign(now.depth.size(), 0);
  guessed_.assign(now.depth.size(), 0);
  spread_.assign(now.depth.size(), 0);
  for (int y = now.rect.top; y < now.rect.bottom; ++y) {
    for (int x = now.rect.left; x < now.rect.right; ++x) {
      const size_t i = now.at(x, y);
      if (now.inside[i] == 0 || behind_another(object, x, y, now.depth[i])) continue;
      bool still = false;
      const auto says = weigh_cell(object, x, y, now.depth[i], frame.at(x, y), still);
      is_still_[i] = still ? 1 : 0;
      guessed_[i] =
          still && !object.surface.known(object.surface.at(point_on(object, x, y, now.depth[i])))
              ? 1
              : 0;
      if (!says) continue;
      evidence_[i] = *says;
      says_[i] = 1;
    }
  }
  spread(object);
  if (upset_) judge_upset(now);
}

// Where most of what is known of the object does not show in a picture that has changed as a whole,
// something covers the camera: what looks right then does so by chance.
void OcclusionLearner::Impl::judge_upset(const Projection& now) {
  size_t with = 0, against = 0;
  for (const float evidence : evidence_) {
    with += evidence > 0 ? 1 : 0;
    against += evidence < 0 ? 1 : 0;
  }
  if (against <= with) return;
  for (size_t i = 0; i < now.inside.size(); ++i) {
    if (now.inside[i] == 0) continue;
    evidence_[i] = kNotItsColor;
    is_still_[i] = 0;
    says_[i] = 1;
  }
}

CellEvidence OcclusionLearner::Impl::mean_evidence(const Projection& now, int x, int y) const {
  float sum = 0;
  int count = 0, still = 0;
  for (int ny = std::max(now.rect.top, y - kHalf); ny <= std::min(now.rect.bottom - 1, y + kHalf);
       ++ny) {
    for (int nx = std::max(now.rect.left, x - kHalf); nx <= std::min(now.rect.right - 1, x + kHalf);
         ++nx) {
      const size_t i = now.at(nx, ny);
      sum += evidence_[i];
      count += says_[i];
      still += is_still_[i];
    }
  }
  if (count < kFewestCells) return {};
  return {sum / (kMostEvidence * static_cast<float>(count)), 2 * still > count};
}

void OcclusionLearner::Impl::judge(Object& object) {
  const Projection& now = object.now;
  ++look_.judged;
  for (int y = now.rect.top; y < now.rect.bottom; ++y) {
    for (int x = now.rect.left; x < now.rect.right; ++x) {
      const float depth = now.depth[now.at(x, y)];
      if (depth <= 0) continue;
      const auto change = cells_.judge(x, y, depth, mean_evidence(now, x, y));
      look_.learned += change == HiddenCells::Change::kLearned ? 1 : 0;
      look_.forgotten += change == HiddenCells::Change::kForgotten ? 1 : 0;
      look_.hidden += cells_.hides(x, y, depth) ? 1 : 0;
      ++look_.cells;
    }
  }
}

// Only what has visibly come between the scene and the camera is the object's surface.
void OcclusionLearner::Impl::remember(Object& object, const CellReader& frame) {
  const Projection& now = object.now;
  for (int y = now.rect.top; y < now.rect.bottom; ++y) {
    for (int x = now.rect.left; x < now.rect.right; ++x) {
      const size_t i = now.at(x, y);
      if (says_[i] == 0 || evidence_[i] <= 0 || !still_.known(x, y)) continue;
      if (cells_.hides(x, y, now.depth[i])) continue;
      const CellColor color = frame.at(x, y);
      if (still_.distance(x, y, color) < kClearly) continue;
      object.surface.learn(object.surface.at(point_on(object, x, y, now.depth[i])), color);
    }
  }
}

void OcclusionLearner::Impl::forget_passing(Object& object) {
  const CellRect& before = object.before;
  for (int y = before.top; y < before.bottom; ++y) {
    for (int x = before.left; x < before.right; ++x) {
      if (object.now.depth_at(x, y) <= 0) cells_.left(x, y);
    }
  }
  object.before = object.now.rect;
}

void OcclusionLearner::Impl::publish(Time time) {
  CellRect all;
  for (const auto& object : objects_) {
    if (!object->now.there || object->now.rect.empty()) continue;
    const CellRect rect = grown(object->now.rect, kPublished);
    all = all.empty()
              ? rect
              : CellRect{std::min(all.left, rect.left), std::min(all.top, rect.top),
                         std::max(all.right, rect.right), std::max(all.bottom, rect.bottom)};
  }
  hidden_.reset();
  if (all.empty()) return;
  // One that no reader holds any more, so that nothing allocates.
  const auto free = std::find_if(buffers_.begin(), buffers_.end(), [](const auto& buffer) {
    return buffer == nullptr || buffer.use_count() == 1;
  });
  const std::shared_ptr<HiddenDepth> out =
      free != buffers_.end() && *free != nullptr ? *free : std::make_shared<HiddenDepth>();
  if (free != buffers_.end()) *free = out;
  out->time = time;
  if (cells_.publish(all, *out)) hidden_ = out;
}

void OcclusionLearner::Impl::step(const Frame& frame, std::span<const PoseTrackPtr> tracks) {
  const FrameInfo& info = frame.info();
  if (info.status != FrameStatus::kGood || info.width != camera_.model.width() ||
      info.height != camera_.model.height()) {
    return;
  }
  look_ = {};
  bool all_placed = true;
  busy_.clear();
  for (auto& object : objects_) {
    const auto track = std::find_if(tracks.begin(), tracks.end(), [&](const PoseTrackPtr& t) {
      return t && t->object() == object->known.id;
    });
    all_placed &= place(*object, track == tracks.end() ? nullptr : track->get(), info.capture);
    if (object->now.there) busy_.push_back(grown(object->now.rect, kKeepOff));
  }
  const CellReader reader(frame.i420());
  if (all_placed) {
    still_.learn(reader, busy_);
    const bool was_upset = std::exchange(upset_, still_.changed() > kUpset);
    if (was_upset && !upset_) cells_.forget_passing();
  }
  for (auto& object : objects_) {
    if (object->now.judged) {
      weigh(*object, reader);
      judge(*object);
      if (!upset_) remember(*object, reader);
    }
    forget_passing(*object);
  }
  publish(info.capture);
}

Result<std::unique_ptr<OcclusionLearner>> OcclusionLearner::create(
    const CalibratedCamera& camera, CameraId id, std::vector<HideableObject> objects) {
  for (const HideableObject& object : objects) {
    if (object.depth && object.radius > 0 && std::isfinite(object.radius)) continue;
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "learning what hides objects needs the mesh of each of them");
  }
  return std::unique_ptr<OcclusionLearner>(
      new OcclusionLearner(std::make_unique<Impl>(camera, id, std::move(objects))));
}

OcclusionLearner::OcclusionLearner(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
OcclusionLearner::~OcclusionLearner() = default;

void OcclusionLearner::step(const Frame& frame, std::span<const PoseTrackPtr> tracks) {
  impl_->step(frame, tracks);
}
HiddenDepthPtr OcclusionLearner::hidden() const { return impl_->hidden(); }
const OcclusionLearner::Look& OcclusionLearner::look() const { return impl_->look(); }

}  // namespace sightline
