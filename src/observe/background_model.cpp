// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/background_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "change_map.hpp"
#include "known_places.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr Duration kFirstPeriod = 30ms, kPeriod = 100ms;  // between frames that are learned from
constexpr Duration kFirst = 2s;                           // every row is learned from at first
constexpr int kPhases = 4;                                // rows take turns later
constexpr int kLeastFrames = 10;
constexpr int kMature = 8;            // sights of a pixel from which its background is believed
constexpr double kMatureShare = 0.6;  // of the pixels
constexpr double kNewShare = 0.5;     // of the pixels: the scene itself has changed
constexpr int kRelearnAfter = 5;      // such frames
constexpr int kSlow = 32;             // sights over which the mean is taken
constexpr int16_t kUnit = 64;         // per level
constexpr int kFirstSpread = 3 * kUnit;
constexpr int kLeastSpread = kUnit;  // one sigma of half-size pixels of a quiet camera
constexpr int kMostAge = 250;

struct Planes {
  PlaneView y, u, v;
  bool same_size() const {
    return u.width >= y.width && u.height >= y.height && v.width >= y.width && v.height >= y.height;
  }
};

Planes planes_of(const Frame& frame) {
  const I420View full = frame.i420();
  return {frame.half_grey(), full.u, full.v};
}

// What was seen at every pixel: values in 1/64 levels at the light of the first frame.
struct Sights {
  std::array<std::vector<int16_t>, 3> mean;
  std::vector<uint8_t> age;  ///< how often
  void resize(size_t size) {
    for (auto& plane : mean) plane.assign(size, 0);
    age.assign(size, 0);
  }
};

struct Value {
  int y, u, v;
};

// 1/n as a fraction of 2^15.
constexpr std::array<int, kSlow + 1> reciprocals() {
  std::array<int, kSlow + 1> out{};
  for (int n = 1; n <= kSlow; ++n) out[static_cast<size_t>(n)] = (1 << 15) / n;
  return out;
}
constexpr auto kReciprocal = reciprocals();

int16_t moved(int16_t from, int to, int part) {
  return static_cast<int16_t>(from + (((to - from) * part) >> 15));
}

}  // namespace

class BackgroundModel::Impl {
 public:
  Impl(const CalibratedCamera& camera, const BackgroundOptions& options)
      : camera_(camera), options_(options) {
    // Later a pixel is looked at every kPhases-th time.
    const double sights = to_seconds(options.absorb) / (kPhases * to_seconds(kPeriod));
    oldest_ = std::clamp(static_cast<int>(sights), kMature + 1, kMostAge);
  }

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
    mark_known_places(camera_, known, width_, height_, hidden_);
    light_ = measure_light(planes);
    const bool all = info.capture - first_ < kFirst;
    if (!all) phase_ = (phase_ + 1) % kPhases;
    size_t fresh = 0, seen = 0;
    for (int y = all ? 0 : phase_; y < height_; y += all ? 1 : kPhases) {
      learn_row(planes, y, fresh, seen);
    }
    last_ = info.capture;
    ++frames_;
    watch_scene(fresh, seen);
  }

  bool ready() const {
    return frames_ >= kLeastFrames && last_ - first_ >= options_.learn && mature_ && new_ == 0;
  }

  bool foreground(const Frame& frame, std::span<const KnownObject> others,
                  ForegroundMap& out) const {
    out.width = out.height = 0;
    out.classes.clear();
    out.share = 0;
    if (!ready() || !usable(frame.info())) return false;
    const Planes planes = planes_of(frame);
    if (planes.y.width != width_ || planes.y.height != height_) return false;
    mark_known_places(camera_, others, width_, height_, unknown_);
    for (size_t i = 0; i < unknown_.size(); ++i) {
      unknown_[i] = static_cast<uint8_t>(unknown_[i] | (main_.age[i] < kMature / 2));
    }
    const UsualPicture usual{width_,
                             height_,
                             {main_.mean[0].data(), main_.mean[1].data(), main_.mean[2].data()},
                             {spread_[0].data(), spread_[1].data()},
                             quiet_,
                             unknown_.data()};
    changes_.compute({planes.y, planes.u, planes.v}, usual, measure_light(planes), out);
    return out.share <= kNewShare;
  }

 private:
  // A recording that begins again; frames may come a little out of order.
  bool rewound(Time capture) const { return capture < last_ - 1s; }

  bool usable(const FrameInfo& info) const {
    return info.status != FrameStatus::kDamaged && info.width == camera_.model.width() &&
           info.height == camera_.model.height();
  }

  void start(const Planes& planes, Time capture) {
    width_ = planes.y.width;
    height_ = planes.y.height;
    const size_t size = static_cast<size_t>(width_) * static_cast<size_t>(height_);
    main_.resize(size);
    rival_.resize(size);
    for (auto& plane : spread_) plane.assign(size, kFirstSpread);
    first_ = capture;
    frames_ = phase_ = new_ = 0;
    mature_ = false;
    quiet_ = {kFirstSpread, kFirstSpread};
  }

  // Luma by which the frame is brighter than the background, as a factor above black: the median
  // over a grid of pixels, so that less than half of the picture may be hidden. Pictures are not
  // linear in the light, but a factor on the light is one on the picture too (a power law), about
  // black.
  float measure_light(const Planes& planes) const {
    constexpr int kSteps = 2048;  // of 1/512
    counts_.fill(0);
    int total = 0;
    for (int y = 2; y < height_; y += 4) {
      const uint8_t* row = planes.y.row(y);
      for (int x = 2; x < width_; x += 4) {
        const size_t i = index(x, y);
        const int usual = main_.mean[0][i] - kBlack * kUnit;
        const int now = row[x] - kBlack;
        if (main_.age[i] == 0 || usual < 24 * kUnit || now < 2 || row[x] > 230) continue;
        const int step = std::min(kSteps - 1, now * kUnit * 512 / usual);
        ++counts_[static_cast<size_t>(step)];
        ++total;
      }
    }
    if (total < 50) return 1;
    int below = 0, step = 0;
    while (below + counts_[static_cast<size_t>(step)] <= total / 2) {
      below += counts_[static_cast<size_t>(step++)];
    }
    return std::clamp((static_cast<float>(step) + 0.5f) / 512, 0.25f, 4.0f);
  }

  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }

  void learn_row(const Planes& planes, int y, size_t& fresh, size_t& seen) {
    const uint8_t *luma = planes.y.row(y), *u = planes.u.row(y), *v = planes.v.row(y);
    const int part = static_cast<int>(256.0f * kUnit / light_);
    for (int x = 0; x < width_; ++x) {
      const size_t i = index(x, y);
      if (hidden_[i] != 0) continue;
      const Value value{light_free(luma[x], kBlack, part), light_free(u[x], kGrey, part),
                        light_free(v[x], kGrey, part)};
      ++seen;
      if (main_.age[i] == 0 || alike(main_, i, value)) {
        confirm(i, value);
      } else {
        ++fresh;
        contest(i, value);
      }
    }
  }

  // What the level would be in the light of the first frame, 1/64 levels.
  static int light_free(int level, int zero, int part) {
    return std::min(32000, zero * kUnit + (((level - zero) * part) >> 8));
  }

  bool alike(const Sights& sights, size_t i, const Value& value) const {
    const int luma = 4 * std::max<int>(spread_[0][i], quiet_[0]);
    const int chroma = 4 * std::max<int>(spread_[1][i], quiet_[1]);
    return std::abs(value.y - sights.mean[0][i]) < luma &&
           std::abs(value.u - sights.mean[1][i]) < chroma &&
           std::abs(value.v - sights.mean[2][i]) < chroma;
  }

  static void take(Sights& sights, size_t i, const Value& value, int oldest) {
    const int n = std::min(sights.age[i] + 1, kSlow);
    const int part = kReciprocal[static_cast<size_t>(n)];
    const std::array<int, 3> values = {value.y, value.u, value.v};
    for (size_t k = 0; k < 3; ++k) {
      sights.mean[k][i] =
          n == 1 ? static_cast<int16_t>(values[k]) : moved(sights.mean[k][i], values[k], part);
    }
    sights.age[i] = static_cast<uint8_t>(std::min(sights.age[i] + 1, oldest));
  }

  void confirm(size_t i, const Value& value) {
    if (main_.age[i] > 0) {
      // Mean absolute deviation, as sigma of a normal distribution: times 1.25.
      const int luma = std::abs(value.y - main_.mean[0][i]) * 5 / 4;
      const int chroma =
          (std::abs(value.u - main_.mean[1][i]) + std::abs(value.v - main_.mean[2][i])) * 5 / 8;
      const int part = kReciprocal[static_cast<size_t>(std::min(main_.age[i] + 3, kSlow))];
      spread_[0][i] = moved(spread_[0][i], luma, part);
      spread_[1][i] = moved(spread_[1][i], chroma, part);
    }
    take(main_, i, value, oldest_);
    if (rival_.age[i] > 0) --rival_.age[i];
  }

  // What has been seen for longer is the background.
  void contest(size_t i, const Value& value) {
    if (rival_.age[i] > 0 && !alike(rival_, i, value)) {
      if (--rival_.age[i] > 0) return;
    }
    take(rival_, i, value, kMostAge);
    if (rival_.age[i] <= main_.age[i]) return;
    for (size_t k = 0; k < 3; ++k) main_.mean[k][i] = rival_.mean[k][i];
    main_.age[i] = static_cast<uint8_t>(std::min<int>(rival_.age[i], oldest_));
    rival_.age[i] = 0;
  }

  void watch_scene(size_t fresh, size_t seen) {
    const bool is_new = static_cast<double>(fresh) > kNewShare * static_cast<double>(seen);
    new_ = is_new && frames_ > kLeastFrames ? new_ + 1 : 0;
    if (new_ == kRelearnAfter) {
      for (uint8_t& age : main_.age) age = std::min<uint8_t>(age, 2);
      mature_ = false;
    }
    if (!mature_ || frames_ % 16 == 0) measure_quiet();
  }

  // The usual spread: that of a single pixel is uncertain while it is young.
  void measure_quiet() {
    size_t mature = 0, counted = 0;
    for (size_t k = 0; k < 2; ++k) {
      counts_.fill(0);
      mature = counted = 0;
      for (size_t i = 0; i < main_.age.size(); i += 5) {
        ++counted;
        if (main_.age[i] < kMature) continue;
        ++mature;
        ++counts_[static_cast<size_t>(std::clamp<int>(spread_[k][i], 0, 2047))];
      }
      size_t below = 0;
      int middle = 0;
      while (mature > 0 &&
             below + static_cast<size_t>(counts_[static_cast<size_t>(middle)]) <= mature / 2) {
        below += static_cast<size_t>(counts_[static_cast<size_t>(middle++)]);
      }
      if (mature > 0) quiet_[k] = std::max(kLeastSpread, middle);
    }
    mature_ = static_cast<double>(mature) >= kMatureShare * static_cast<double>(counted);
  }

  const CalibratedCamera camera_;
  const BackgroundOptions options_;
  int oldest_ = 0;
  int width_ = 0, height_ = 0;
  Sights main_, rival_;
  std::array<std::vector<int16_t>, 2> spread_;  ///< one sigma of luma and of chroma, 1/64 levels
  std::array<int, 2> quiet_{};                  ///< their medians
  std::vector<uint8_t> hidden_;
  float light_ = 1;
  Time first_{}, last_{};
  int frames_ = 0, phase_ = 0;
  int new_ = 0;  ///< frames in a row that look like another scene
  bool mature_ = false;
  mutable std::array<int, 2048> counts_{};
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
