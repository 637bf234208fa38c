// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/angle_refiner.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr int kMaxMisses = 5;           // frames a keyframe is not found in: it has changed
constexpr int kMaxContradictions = 15;  // frames
constexpr int kFewContradictions = 2;
constexpr Duration kFirstPause = 2s, kLongestPause = 64s, kPeace = 10s;
constexpr Duration kContinues = 300ms;  // what is apart now was so before
constexpr Duration kGap = 500ms;        // a head that is not heard may be anywhere by then
constexpr Duration kNoTexture = 300ms;  // until it is looked for again
constexpr Duration kLost = 2s;          // without a picture: the readings get another chance
constexpr double kJump = 0.25 * std::numbers::pi / 180;  // [rad], at least
constexpr Duration kReversedFor = 10min;                 // then it is judged anew
constexpr double kForget = 0.99;                         // of ways, each frame
constexpr double kTurned = 5 * std::numbers::pi / 180;   // [rad] until a way is judged

CameraAxes without_latency_sigma(CameraAxes axes) {
  axes.latency_sigma_s = 0;
  return axes;
}

}  // namespace

std::string_view to_string(RefinerVerdict verdict) {
  switch (verdict) {
    case RefinerVerdict::kNone:
      return "none";
    case RefinerVerdict::kLearning:
      return "learning";
    case RefinerVerdict::kUsed:
      return "used";
    case RefinerVerdict::kRefused:
      return "refused";
    case RefinerVerdict::kJumped:
      return "jumped";
    case RefinerVerdict::kReversed:
      return "reversed";
  }
  return "";
}

std::vector<MovingBox> moving_boxes(const Rig& rig) {
  std::vector<MovingBox> boxes;
  for (const RigObject& object : rig.objects) {
    boxes.push_back({object.named.id, object.mesh->min_corner.cast<double>(),
                     object.mesh->max_corner.cast<double>()});
  }
  return boxes;
}

std::unique_ptr<AngleRefiner> AngleRefiner::create(const CalibratedCamera& camera) {
  if (!camera.axes) return nullptr;
  return std::unique_ptr<AngleRefiner>(new AngleRefiner(camera));
}

AngleRefiner::AngleRefiner(const CalibratedCamera& camera)
    : camera_(camera),
      axes_(without_latency_sigma(*camera.axes)),
      history_(axes_, camera.model.parameters().fx),
      learner_(*camera.axes),
      panorama_(camera_.model, axes_),
      pause_(kFirstPause) {
  note_status();
}
AngleRefiner::~AngleRefiner() = default;

// Each frame brings the readings of the last moments. False: they begin anew (a recording loops).
bool AngleRefiner::take_readings(const CameraPlace& place) {
  const bool again = !place.readings.empty() && place.readings.back().stamp < last_reading_;
  for (const AxisReading& reading : place.readings) {
    if (reading.stamp <= last_reading_ && !again) continue;
    history_.add(reading);
    learner_.add(reading);
  }
  if (!place.readings.empty()) last_reading_ = place.readings.back().stamp;
  return !again;
}

std::optional<EncoderAngles> AngleRefiner::encoder(Time capture, double latency) const {
  const AxesAt at = history_.at(capture + from_seconds(latency - axes_.latency_s));
  if (at.state != AxesState::kKnown) return std::nullopt;
  EncoderAngles out;
  out.angles = {at.pan, at.tilt};
  out.rates = {at.pan_rate, at.tilt_rate};
  out.accelerations.setConstant(axes_.acceleration);
  out.sigmas = {at.pan_sigma, at.tilt_sigma};
  out.latency_s = latency;
  return out;
}

double AngleRefiner::distance(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  const auto ahead = [&](const Eigen::Vector2d& angles) -> Eigen::Vector3d {
    return axes_.world_from_camera(angles.x(), angles.y()).rotation * Eigen::Vector3d::UnitZ();
  };
  return std::acos(std::clamp(ahead(a).dot(ahead(b)), -1.0, 1.0));
}

std::optional<size_t> AngleRefiner::nearest(const Eigen::Vector2d& angles, double within) const {
  std::optional<size_t> best;
  for (size_t i = 0; i < panorama_.size(); ++i) {
    const double apart = distance(learner_.filter().view(i).angles, angles);
    if (apart > within) continue;
    within = apart;
    best = i;
  }
  return best;
}

// A new one, or that which was not used for longest.
size_t AngleRefiner::free_place(size_t but) const {
  if (panorama_.size() < Panorama::kMaxKeyframes) return panorama_.size();
  size_t oldest = but == 0 ? 1 : 0;
  for (size_t i = 0; i < uses_.size(); ++i) {
    if (i != but && uses_[i] < uses_[oldest]) oldest = i;
  }
  return oldest;
}

void AngleRefiner::begin_keyframe(Time capture, const EncoderAngles& encoder,
                                  std::optional<size_t> instead) {
  const size_t index = instead.value_or(free_place(Panorama::kMaxKeyframes));
  if (!panorama_.add(index)) {
    paused_until_ = capture + kNoTexture;
    return;
  }
  learner_.add_keyframe(capture, index, encoder);
  uses_.resize(panorama_.size());
  uses_[index] = now_;
  status_.verdict = RefinerVerdict::kLearning;
}

void AngleRefiner::drop_keyframes(bool latency) {
  panorama_.clear();
  learner_.forget(latency);
  uses_.clear();
  misses_ = 0;
  last_found_ = {};
  held_at_ = {};
  way_from_.reset();
  jumped_ = false;
}

// From one frame to the next: latency turns neither round.
void AngleRefiner::note_way(Time capture, const Eigen::Vector2d& encoder,
                            const Eigen::Vector2d& picture) {
  const bool goes_on = capture - last_found_ < kContinues;
  if (way_from_ && goes_on && !jumped_ && !gap_) {
    for (size_t i = 0; i < ways_.size(); ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      const double by_encoder = encoder(axis) - way_from_->first(axis);
      const double by_picture = picture(axis) - way_from_->second(axis);
      Way& way = ways_[i];
      way.encoder = kForget * way.encoder + by_encoder * by_encoder;
      way.picture = kForget * way.picture + by_picture * by_picture;
      way.both = kForget * way.both + by_encoder * by_picture;
      way.turned = kForget * way.turned + std::abs(by_encoder);
    }
  }
  way_from_ = {encoder, picture};
  judge_way(capture);
}

// Once found it stays: by such readings nothing can be learned that would refute it.
void AngleRefiner::judge_way(Time capture) {
  constexpr double kOpposite = -0.9;  // correlation
  for (size_t i = 0; i < ways_.size(); ++i) {
    const Way& way = ways_[i];
    const double both = std::sqrt(way.encoder * way.picture);
    if (way.turned < kTurned || way.both > kOpposite * both) continue;
    if (way.picture < 0.25 * way.encoder || way.picture > 4 * way.encoder) continue;
    reversed_ = i;
    paused_until_ = capture + kReversedFor;
  }
}

// Where the head was before the gap the picture is looked for first: a jump of readings turns no
// camera. What is found there, and not where the readings say, is followed from then on.
bool AngleRefiner::has_jumped(const FrameInfo& info, const EncoderAngles& encoder) {
  if (held_at_ == Time{} || (!gap_ && !jumped_)) return false;
  const double since = to_seconds(info.capture - held_at_);
  if (info.capture - held_at_ > (jumped_ ? kLost : kGap)) {
    if (jumped_) drop_keyframes(false);
    gap_ = jumped_ = false;
    return false;
  }
  const Eigen::Vector2d there = held_ + held_rates_ * std::min(since, jumped_ ? 0.0 : 0.1);
  gap_ = false;
  const auto index = nearest(there, panorama_.reach());
  const auto picture =
      index ? panorama_.measure(*index, learner_.filter().view(*index), there) : std::nullopt;
  if (!picture) return jumped_;
  const Eigen::Vector2d apart = picture->angles - encoder.angles;
  const Eigen::Vector2d late =
      std::hypot(learner_.filter().latency_sigma(), 0.002) * encoder.rates.cwiseAbs();
  const double slack = 6 * (encoder.sigmas + late).maxCoeff() + kJump;
  jumped_ = apart.cwiseAbs().maxCoeff() > slack;
  held_ = picture->angles;
  held_at_ = info.capture;
  held_rates_.setZero();
  return jumped_;
}

CameraPlacePtr AngleRefiner::not_believed(const CameraPlacePtr& from) const {
  auto out = std::make_shared<CameraPlace>(*from);
  out->state = AxesState::kUnsettled;
  return out;
}

// Where both contradict each other nobody knows which of them is wrong: the encoder is believed,
// and the surroundings are learned anew, later; the second time the latency as well.
void AngleRefiner::learn(Time capture) {
  contradicted_ = learner_.advance();
  if (contradicted_ > 0) agreed_since_ = capture;
  if (contradicted_ >= kMaxContradictions) {
    drop_keyframes(pause_ > kFirstPause);
    paused_until_ = capture + pause_;
    pause_ = std::min(2 * pause_, kLongestPause);
  } else if (capture - agreed_since_ > kPeace) {
    pause_ = kFirstPause;
  }
}

void AngleRefiner::look(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                        std::span<const MovingBox> boxes, const Rigid3& camera_from_world) {
  std::vector<MaskPolygon> hidden;
  for (const MovingBox& box : boxes) {
    if (box.object.index() >= tracks.size() || !tracks[box.object.index()]) continue;
    const PoseAt at = tracks[box.object.index()]->at(frame.info().capture);
    if (at.source == PoseSource::kNone) continue;
    const Rigid3 camera_from_object = camera_from_world * at.estimate.world_from_object;
    MaskPolygon corners;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d corner((i & 1) != 0 ? box.high.x() : box.low.x(),
                                   (i & 2) != 0 ? box.high.y() : box.low.y(),
                                   (i & 4) != 0 ? box.high.z() : box.low.z());
      const auto pixel = camera_.model.project(camera_from_object * corner);
      if (pixel) corners.push_back(*pixel);
    }
    hidden.push_back(std::move(corners));
  }
  const bool half = Panorama::wants_half(camera_.model);
  panorama_.look_at(frame.gray(), half ? frame.half_gray() : PlaneView{}, hidden);
}

std::optional<AngleRefiner::Found> AngleRefiner::find(Time capture, const EncoderAngles& encoder) {
  const bool goes_on = last_found_ != Time{} && capture - last_found_ < kContinues;
  const Eigen::Vector2d start = encoder.angles + (goes_on ? apart_ : Eigen::Vector2d::Zero());
  const auto index = nearest(start, panorama_.reach());
  if (!index) {
    begin_keyframe(capture, encoder, std::nullopt);
    return std::nullopt;
  }
  const auto picture = panorama_.measure(*index, learner_.filter().view(*index), start);
  if (!picture) {
    if (++misses_ >= kMaxMisses) {
      misses_ = 0;
      begin_keyframe(capture, encoder, *index);
    }
    return std::nullopt;
  }
  misses_ = 0;
  uses_[*index] = ++now_;
  note_way(capture, encoder.angles, picture->angles);
  last_found_ = capture;
  apart_ = picture->angles - encoder.angles;
  learner_.add_picture(capture, *index, *picture);
  return Found{*index, *picture};
}

CameraPlacePtr AngleRefiner::place(const CameraPlace& from, const TurnedAngles& angles,
                                   AxesState state) {
  auto out = std::make_shared<CameraPlace>(from);
  out->world_from_camera = axes_.world_from_camera(angles.angles.x(), angles.angles.y());
  const auto jacobian = axes_.jacobian(angles.angles.x());
  out->covariance =
      std::make_shared<const Matrix6>(jacobian * angles.covariance * jacobian.transpose());
  out->state = state;
  status_.sigma = std::sqrt(angles.covariance.diagonal().maxCoeff());
  return out;
}

// As before, but for the latency once that is known.
CameraPlacePtr AngleRefiner::by_encoder(Time capture, const CameraPlacePtr& from) {
  if (!learner_.filter().latency_known()) return from;
  const AxesAt at =
      history_.at(capture + from_seconds(learner_.filter().used_latency() - axes_.latency_s));
  const Eigen::Vector2d late =
      learner_.filter().used_latency_sigma() * Eigen::Vector2d(at.pan_rate, at.tilt_rate);
  TurnedAngles angles;
  angles.angles = {at.pan, at.tilt};
  angles.covariance.diagonal() =
      Eigen::Vector2d(at.pan_sigma, at.tilt_sigma).cwiseAbs2() + late.cwiseAbs2();
  return place(*from, angles, at.state);
}

// Null: it has nothing to add. Until the latency is known the configured one counts; pictures that
// are fitted to one that seems wrong would be drawn along.
CameraPlacePtr AngleRefiner::by_picture(const FrameInfo& info, const EncoderAngles& encoder) {
  if (has_jumped(info, encoder)) {
    status_.verdict = RefinerVerdict::kJumped;
    return not_believed(info.place);
  }
  const auto found = find(info.capture, encoder);
  if (reversed_) return nullptr;
  if (!found) return nullptr;
  // Readings that have come since know better than those by which this frame is judged.
  if (contradicted_ >= kFewContradictions) {
    status_.verdict = RefinerVerdict::kRefused;
    return nullptr;
  }
  if (learner_.filter().latency_suspect()) return nullptr;
  const auto angles = learner_.filter().fuse(encoder, found->keyframe, found->picture);
  status_.verdict = angles ? RefinerVerdict::kUsed : RefinerVerdict::kRefused;
  if (!angles) return nullptr;
  held_ = angles->angles;
  held_rates_ = encoder.rates;
  held_at_ = info.capture;
  const size_t index = free_place(found->keyframe);
  if (!nearest(found->picture.angles, panorama_.spacing()) && panorama_.add(index)) {
    learner_.add_keyframe(info.capture, index, found->keyframe, found->picture);
    uses_.resize(panorama_.size());
    uses_[index] = now_;
  }
  return place(*info.place, *angles, info.place->state);
}

FramePtr AngleRefiner::step(const FramePtr& frame, std::span<const PoseTrackPtr> tracks,
                            std::span<const MovingBox> boxes) {
  const FrameInfo& info = frame->info();
  status_.verdict = RefinerVerdict::kNone;
  if (!info.place) return frame;
  if (!take_readings(*info.place)) drop_keyframes(false);
  if (!info.place->trusted() || info.status == FrameStatus::kDamaged) {
    learner_.forget_waiting();
    last_found_ = {};
    gap_ = true;
    if (reversed_) status_.verdict = RefinerVerdict::kReversed;
    if (jumped_) status_.verdict = RefinerVerdict::kJumped;
    return frame;
  }
  learn(info.capture);
  const auto now = encoder(info.capture, learner_.filter().latency());
  CameraPlacePtr out;
  if (reversed_ && info.capture >= paused_until_) {
    reversed_.reset();
    ways_ = {};
    drop_keyframes(true);
  }
  if (now && info.capture >= paused_until_) {
    look(*frame, tracks, boxes, info.place->world_from_camera.inverse());
    out = by_picture(info, *now);
  }
  if (reversed_) {
    status_.verdict = RefinerVerdict::kReversed;
    out = not_believed(info.place);
  }
  if (!out) out = by_encoder(info.capture, info.place);
  note_status();
  return out == info.place ? frame : Frame::with_place(frame, out);
}

void AngleRefiner::note_status() {
  const TurnFilter& filter = learner_.filter();
  status_.keyframes = panorama_.size();
  status_.latency_s = filter.latency();
  status_.latency_sigma_s = filter.latency_sigma();
  status_.latency_known = filter.latency_known();
  status_.latency_contradicted = filter.latency_contradicted();
}

std::optional<std::string> AngleRefiner::news() {
  const auto is_bad = [](RefinerVerdict verdict) {
    return verdict == RefinerVerdict::kJumped || verdict == RefinerVerdict::kReversed;
  };
  const RefinerVerdict before = std::exchange(told_verdict_, status_.verdict);
  if (is_bad(status_.verdict) && before != status_.verdict) {
    if (status_.verdict == RefinerVerdict::kJumped) {
      return fmt::format(
          "{}: its angles have jumped and its picture has not: it is not measured in until they "
          "agree; look for the encoder's zero",
          camera_.name);
    }
    const char* axis = reversed_ == 0u ? "pan" : "tilt";
    return fmt::format(
        "{}: its picture turns the other way than its {}: it is not measured in; turn the sign of "
        "{}_scale in [camera.axes]",
        camera_.name, axis, axis);
  }
  if (is_bad(before) && !is_bad(status_.verdict)) {
    return fmt::format("{}: its angles are believed again", camera_.name);
  }
  if (status_.latency_contradicted == told_latency_) return std::nullopt;
  told_latency_ = status_.latency_contradicted;
  if (!told_latency_) {
    return fmt::format("{}: its picture agrees with latency_s again", camera_.name);
  }
  return fmt::format(
      "{}: by its picture the angles are {:.1f} ms late (sigma {:.1f} ms), latency_s of "
      "[camera.axes] says {:.1f} ms: the former is used; correct the calibration",
      camera_.name, 1e3 * status_.latency_s, 1e3 * status_.latency_sigma_s,
      1e3 * camera_.axes->latency_s);
}

}  // namespace sightline
