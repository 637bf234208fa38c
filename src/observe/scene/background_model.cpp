// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/scene/background_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "observe/scene/background_cells.hpp"
#include "observe/scene/change_map.hpp"
#include "observe/scene/known_places.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using observe::BackgroundCells;
using observe::ChangeMap;
using observe::kBlack;
using observe::mark_known_places;

constexpr Duration kFirstPeriod = 30ms, kPeriod = 100ms;  // between frames that are learned from
constexpr Duration kFirst = 2s;                           // every row is learned from at first
constexpr int kPhases = 4;                                // rows take turns later
constexpr int kMinFrames = 10;
constexpr double kMatureShare = 0.6;   // of the pixels, before anything is said
constexpr double kChangedShare = 0.5;  // of the pixels: the scene itself has changed
constexpr int kRelearnAfter = 5;       // such frames
constexpr int kUnit = BackgroundCells::kUnit;

struct Planes {
  PlaneView y, u, v;
  bool same_size() const {
    return u.width >= y.width && u.height >= y.height && v.width >= y.width && v.height >= y.height;
  }
};

Planes planes_of(const Frame& frame) {
  const I420View full = frame.i420();
  return {frame.half_gray(), full.u, full.v};
}

// Later a pixel is observed every kPhases-th time only.
int max_age(const BackgroundOptions& options) {
  const double observations = to_seconds(options.absorb) / (kPhases * to_seconds(kPeriod));
  return std::clamp(static_cast<int>(observations), BackgroundCells::kMature + 1,
                    BackgroundCells::kMaxAge);
}

}  // namespace

class BackgroundModel::Impl {
 public:
  Impl(const CalibratedCamera& camera, const BackgroundOptions& options)
      : camera_(camera), options_(options), cells_(max_age(options)) {}

  bool wants(Time capture) const {
    if (frames_ == 0 || rewound(capture)) return true;
    return capture - last_ >= (capture - first_ < kFirst ? kFirstPeriod : kPeriod);
  }

  void learn(const Frame& frame, std::span<const KnownObject> known) {
    const FrameInfo& info = frame.info();
    if (!usable(info) || !wants(info.capture)) return;
    const Planes planes = planes_of(frame);
    if (!planes.same_size()) return;
    if (frames_ == 0 || rewound(info.capture)) start(planes, info.capture);
    mark_known_places(camera_, known, cells_.width(), cells_.height(), occupied_);
    light_ = measure_light(planes);
    const bool all = info.capture - first_ < kFirst;
    if (!all) phase_ = (phase_ + 1) % kPhases;
    const int light_part = static_cast<int>(256.0f * kUnit / light_);
    size_t changed = 0, observed = 0;
    for (int y = all ? 0 : phase_; y < cells_.height(); y += all ? 1 : kPhases) {
      const BackgroundCells::Learned row =
          cells_.learn_row(y, {planes.y.row(y), planes.u.row(y), planes.v.row(y)},
                           occupied_.data() + cells_.index(0, y), light_part);
      changed += row.changed;
      observed += row.observed;
    }
    last_ = info.capture;
    ++frames_;
    watch_scene(changed, observed);
  }

  bool ready() const {
    return frames_ >= kMinFrames && last_ - first_ >= options_.learn && mature_ &&
           changed_frames_ == 0;
  }

  bool foreground(const Frame& frame, std::span<const KnownObject> others,
                  ForegroundMap& out) const {
    out.width = out.height = 0;
    out.classes.clear();
    out.share = 0;
    if (!ready() || !usable(frame.info())) return false;
    const Planes planes = planes_of(frame);
    if (planes.y.width != cells_.width() || planes.y.height != cells_.height()) return false;
    mark_known_places(camera_, others, cells_.width(), cells_.height(), unknown_);
    for (size_t i = 0; i < unknown_.size(); ++i) {
      unknown_[i] = static_cast<uint8_t>(unknown_[i] | (cells_.known(i) ? 0 : 1));
    }
    changes_.compute({planes.y, planes.u, planes.v}, cells_, unknown_, measure_light(planes), out);
    return out.share <= kChangedShare;
  }

 private:
  // A recording that begins again; frames may come a little out of order.
  bool rewound(Time capture) const { return capture < last_ - 1s; }

  bool usable(const FrameInfo& info) const {
    return info.status != FrameStatus::kDamaged && info.width == camera_.model.width() &&
           info.height == camera_.model.height();
  }

  void start(const Planes& planes, Time capture) {
    cells_.reset(planes.y.width, planes.y.height);
    first_ = capture;
    frames_ = phase_ = changed_frames_ = 0;
    mature_ = false;
  }

  // Luma by which the frame is brighter than the background, as a factor above black: the median
  // over a grid of pixels, so that less than half of the image may be hidden. Images are not
  // linear in the light, but a factor on the light is one on the image too (a power law), about
  // black.
  float measure_light(const Planes& planes) const {
    constexpr int kSteps = 2048;  // of 1/512
    std::array<int, kSteps> histogram{};
    int total = 0;
    for (int y = 2; y < cells_.height(); y += 4) {
      const uint8_t* row = planes.y.row(y);
      const int16_t* mean = cells_.mean_row(0, y);
      for (int x = 2; x < cells_.width(); x += 4) {
        const int usual = mean[x] - kBlack * kUnit;
        const int now = row[x] - kBlack;
        if (cells_.age(cells_.index(x, y)) == 0 || usual < 24 * kUnit || now < 2 || row[x] > 230) {
          continue;
        }
        const int step = std::min(kSteps - 1, now * kUnit * 512 / usual);
        ++histogram[static_cast<size_t>(step)];
        ++total;
      }
    }
    if (total < 50) return 1;
    int below = 0, step = 0;
    while (below + histogram[static_cast<size_t>(step)] <= total / 2) {
      below += histogram[static_cast<size_t>(step++)];
    }
    return std::clamp((static_cast<float>(step) + 0.5f) / 512, 0.25f, 4.0f);
  }

  void watch_scene(size_t changed, size_t observed) {
    const bool most = static_cast<double>(changed) > kChangedShare * static_cast<double>(observed);
    changed_frames_ = most && frames_ > kMinFrames ? changed_frames_ + 1 : 0;
    if (changed_frames_ == kRelearnAfter) {
      cells_.relearn();
      mature_ = false;
    }
    if (!mature_ || frames_ % 16 == 0) mature_ = cells_.measure_min_spread() >= kMatureShare;
  }

  const CalibratedCamera camera_;
  const BackgroundOptions options_;
  BackgroundCells cells_;
  std::vector<uint8_t> occupied_;  ///< by known objects: not learned from
  float light_ = 1;
  Time first_{}, last_{};
  int frames_ = 0, phase_ = 0;
  int changed_frames_ = 0;  ///< in a row, in which most of the scene has changed
  bool mature_ = false;
  mutable std::vector<uint8_t> unknown_;
  mutable ChangeMap changes_;
};

Result<std::unique_ptr<BackgroundModel>> BackgroundModel::create(const CalibratedCamera& camera,
                                                                 const BackgroundOptions& options) {
  if (options.learn <= Duration(0) || options.absorb <= Duration(0)) {
    return make_error(ErrorCode::kInvalidInput, "background of camera " + camera.name,
                      "learn and absorb must be longer than zero");
  }
  return std::unique_ptr<BackgroundModel>(
      new BackgroundModel(std::make_unique<Impl>(camera, options)));
}

BackgroundModel::BackgroundModel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BackgroundModel::~BackgroundModel() = default;

bool BackgroundModel::wants(Time capture) const { return impl_->wants(capture); }
void BackgroundModel::learn(const Frame& frame, std::span<const KnownObject> known) {
  impl_->learn(frame, known);
}
bool BackgroundModel::ready() const { return impl_->ready(); }
bool BackgroundModel::foreground(const Frame& frame, std::span<const KnownObject> others,
                                 ForegroundMap& out) const {
  if (impl_->foreground(frame, others, out)) return true;
  out.classes.clear();
  return false;
}

}  // namespace sightline
