// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/turn/turn_learner.hpp"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr double kSteps = 3.5;  // sigmas of a reading in a step of its rounding
constexpr Duration kGap = std::chrono::milliseconds(200);     // between readings: nothing between
constexpr Duration kWaits = std::chrono::seconds(1);          // for readings
constexpr Duration kReadings = std::chrono::seconds(3);       // kept once the latency is known
constexpr Duration kMostReadings = std::chrono::seconds(60);  // and before
constexpr size_t kMaxReadings = 8192, kMaxWaiting = 128, kMaxKept = 400;
constexpr size_t kSettledAfter = 40;     // updates
constexpr double kSettledSigma = 0.001;  // [s]
constexpr double kMoved = 0.0005;        // [s]: taken elsewhere
constexpr int kTurns = 6;
constexpr double kBendOver = 0.03;  // [s]

double largest_scale(const CameraAxes& axes) {
  return std::max(std::abs(axes.pan_scale), std::abs(axes.tilt_scale));
}

}  // namespace

TurnLearner::TurnLearner(const CameraAxes& axes)
    : axes_(axes),
      options_{axes.latency_s, axes.latency_sigma_s, kSteps * axes.sigma * largest_scale(axes)},
      filter_(options_),
      taken_at_(axes.latency_s) {}

void TurnLearner::add(const AxisReading& reading) {
  if (!readings_.empty() && reading.stamp <= readings_.back().stamp) {
    if (reading.stamp == readings_.back().stamp) return;
    readings_.clear();
  }
  readings_.push_back(reading);
  const Duration kept = keeps_ ? kMostReadings : kReadings;
  while (readings_.size() > kMaxReadings || reading.stamp - readings_.front().stamp > kept) {
    readings_.pop_front();
  }
}

// Along the chord between two readings; its bend by two more, some hundredths of a second off.
std::optional<EncoderAngles> TurnLearner::read(Time capture, double latency_s) const {
  const auto at = [this](Time stamp, Eigen::Vector2d* rate,
                         double* step_s) -> std::optional<Eigen::Vector2d> {
    const auto after = std::lower_bound(readings_.begin(), readings_.end(), stamp,
                                        [](const AxisReading& r, Time t) { return r.stamp < t; });
    if (after == readings_.begin() || after == readings_.end()) return std::nullopt;
    const AxisReading &a = *std::prev(after), &b = *after;
    if (b.stamp - a.stamp > kGap) return std::nullopt;
    const double step = to_seconds(b.stamp - a.stamp);
    const Eigen::Vector2d from(a.pan, a.tilt), to(b.pan, b.tilt);
    if (rate != nullptr) *rate = (to - from) / step;
    if (step_s != nullptr) *step_s = step;
    return Eigen::Vector2d(from + to_seconds(stamp - a.stamp) / step * (to - from));
  };
  const Time stamp = capture + from_seconds(latency_s);
  const Duration off = from_seconds(kBendOver);
  EncoderAngles out;
  double step = 0;
  const auto here = at(stamp, &out.rates, &step);
  if (!here) return std::nullopt;
  const auto before = at(stamp - off, nullptr, nullptr), after = at(stamp + off, nullptr, nullptr);
  const Eigen::Array2d scale(axes_.pan_scale, axes_.tilt_scale);
  out.accelerations.setConstant(axes_.acceleration);
  if (before && after) {
    out.accelerations += ((*before - 2 * *here + *after) / (kBendOver * kBendOver)).cwiseAbs();
    // Over a longer time the rate is less torn by rounding.
    out.rates = (*after - *before) / (2 * kBendOver);
  }
  out.angles = here->array() * scale;
  out.rates = out.rates.array() * scale;
  out.accelerations = out.accelerations.array() * scale.abs();
  const double own = axes_.sigma * axes_.sigma + axes_.backlash * axes_.backlash / 12;
  const double between = axes_.acceleration * step * step / 8;
  out.sigmas = std::sqrt(own + between * between) * scale.abs();
  out.latency_s = latency_s;
  return out;
}

void TurnLearner::add_keyframe(Time capture, size_t index, const EncoderAngles& encoder) {
  std::erase_if(waiting_, [&](const Event& event) { return event.keyframe == index; });
  Event event;
  event.kind = Kind::kByEncoder;
  event.capture = capture;
  event.keyframe = index;
  event.encoder = encoder;
  apply(filter_, event, filter_.latency(), 0);
  keep(event);
  // It is a picture of itself.
  PictureAngles self;
  self.angles = filter_.view(index).angles;
  add_picture(capture, index, self);
}

void TurnLearner::add_keyframe(Time capture, size_t index, size_t by,
                               const PictureAngles& picture) {
  std::erase_if(waiting_, [&](const Event& event) { return event.keyframe == index; });
  Event event;
  event.kind = Kind::kByPicture;
  event.capture = capture;
  event.keyframe = index;
  event.by = by;
  event.view = filter_.view(by);
  event.picture = picture;
  apply(filter_, event, filter_.latency(), 0);
  keep(event);
}

void TurnLearner::add_picture(Time capture, size_t keyframe, const PictureAngles& picture) {
  Event event;
  event.capture = capture;
  event.keyframe = event.by = keyframe;
  event.view = filter_.view(keyframe);
  event.picture = picture;
  waiting_.push_back(event);
  if (waiting_.size() > kMaxWaiting) waiting_.pop_front();
}

// The keyframe may be known better by now than when the picture was measured by it.
TurnFilter::UpdateResult TurnLearner::apply(TurnFilter& filter, const Event& event,
                                            double latency_s, double reach_s) const {
  if (event.kind == Kind::kByEncoder) {
    const auto known = read(event.capture, latency_s);
    filter.add_by_encoder(event.keyframe, known.value_or(event.encoder));
    return TurnFilter::UpdateResult::kApplied;
  }
  const KeyframeView view = filter.view(event.by);
  PictureAngles picture = event.picture;
  picture.angles += picture.by_keyframe * (view.angles - event.view.angles) +
                    picture.by_depth * (view.inverse_depth - event.view.inverse_depth);
  if (event.kind == Kind::kByPicture) {
    filter.add_by_picture(event.keyframe, event.by, picture);
    return TurnFilter::UpdateResult::kApplied;
  }
  const auto known = read(event.capture, latency_s);
  if (!known) return TurnFilter::UpdateResult::kNothingNew;
  return filter.learn(*known, event.keyframe, picture, event.frame_s, reach_s);
}

void TurnLearner::keep(const Event& event) {
  if (!keeps_) return;
  kept_.push_back(event);
  const bool settled = kept_.size() >= kSettledAfter && filter_.latency_sigma() < kSettledSigma;
  if (!settled && kept_.size() < kMaxKept) return;
  keeps_ = false;
  kept_ = {};
}

void TurnLearner::learn_anew() {
  for (int turn = 0; turn < kTurns; ++turn) {
    const double moved = std::abs(filter_.latency() - taken_at_);
    if (moved < kMoved) return;
    // What is left of being wrong shrinks by the square of it, but for the first try.
    const double reach =
        std::hypot(filter_.latency_sigma(), turn == 0 ? 0.5 * moved : 0.25 * moved);
    taken_at_ = filter_.latency();
    TurnFilter anew(options_);
    for (const Event& event : kept_) apply(anew, event, taken_at_, reach);
    filter_ = anew;
  }
}

int TurnLearner::advance() {
  while (!waiting_.empty() && !readings_.empty()) {
    Event event = waiting_.front();
    const double latency = keeps_ ? taken_at_ : filter_.latency();
    const Duration needed = from_seconds(std::max(latency, filter_.latency()) + kBendOver);
    const Time newest = readings_.back().stamp;
    if (event.capture + needed > newest) {
      if (newest - event.capture < kWaits) break;
      waiting_.pop_front();
      continue;
    }
    waiting_.pop_front();
    event.frame_s = last_ == Time{} ? 1.0 : to_seconds(event.capture - last_);
    last_ = event.capture;
    const double off = filter_.latency() - latency;
    const double reach = std::hypot(filter_.latency_sigma(), off);
    const auto result = apply(filter_, event, latency, reach);
    if (result == TurnFilter::UpdateResult::kContradicted) {
      ++contradicted_;
      continue;
    }
    contradicted_ = 0;
    if (result == TurnFilter::UpdateResult::kNothingNew || !keeps_) continue;
    keep(event);
    learn_anew();
  }
  return contradicted_;
}

void TurnLearner::forget(bool latency) {
  waiting_.clear();
  contradicted_ = 0;
  kept_.clear();
  keeps_ = latency;
  if (latency) {
    filter_ = TurnFilter(options_);
    taken_at_ = axes_.latency_s;
  } else {
    filter_.clear_keyframes();
    filter_.doubt_latency();
  }
}

}  // namespace sightline
