// SPDX-License-Identifier: Apache-2.0
#include "sightline/fuse/estimator.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "fuse/bank/hypothesis_bank.hpp"
#include "fuse/bank/track_state.hpp"
#include "fuse/history.hpp"
#include "fuse/out_of_sequence_buffer.hpp"

namespace sightline {

using fuse::BankState;
using fuse::BufferedSet;
using fuse::OutOfSequenceBuffer;

namespace {

Status require(bool good, const char* name, const char* range) {
  if (good) return {};
  return make_error(ErrorCode::kInvalidInput, "estimator", "option {} must be {}", name, range);
}

bool positive(double value) { return std::isfinite(value) && value > 0; }

Status check(const EstimatorOptions& o) {
  const Duration none{0};
  SL_RETURN_IF_ERROR(require(positive(o.noise.angular), "noise.angular", "positive"));
  SL_RETURN_IF_ERROR(require(positive(o.noise.linear), "noise.linear", "positive"));
  SL_RETURN_IF_ERROR(require(o.gate_probability > 0.5 && o.gate_probability < 1.0,
                             "gate_probability", "above 0.5 and below 1"));
  SL_RETURN_IF_ERROR(
      require(o.min_quality >= 0 && o.min_quality < 1, "min_quality", "from 0 to below 1"));
  SL_RETURN_IF_ERROR(require(o.max_normalized_cost > 1, "max_normalized_cost", "above 1"));
  SL_RETURN_IF_ERROR(require(o.max_iterations >= 1, "max_iterations", "1 or more"));
  SL_RETURN_IF_ERROR(require(o.ring >= none, "ring", "zero or more"));
  SL_RETURN_IF_ERROR(require(o.history >= none, "history", "zero or more"));
  SL_RETURN_IF_ERROR(require(o.ring_capacity >= 1 && o.ring_capacity <= 65536, "ring_capacity",
                             "from 1 to 65536"));
  SL_RETURN_IF_ERROR(
      require(positive(o.max_sigma_translation), "max_sigma_translation", "positive"));
  SL_RETURN_IF_ERROR(
      require(positive(o.systematic_translation), "systematic_translation", "positive"));
  SL_RETURN_IF_ERROR(require(positive(o.systematic_rotation), "systematic_rotation", "positive"));
  SL_RETURN_IF_ERROR(
      require(positive(o.max_sigma_translation_alone), "max_sigma_translation_alone", "positive"));
  SL_RETURN_IF_ERROR(require(positive(o.max_sigma_rotation), "max_sigma_rotation", "positive"));
  SL_RETURN_IF_ERROR(
      require(positive(o.max_sigma_rotation_alone), "max_sigma_rotation_alone", "positive"));
  SL_RETURN_IF_ERROR(require(o.confirm_sets >= 1, "confirm_sets", "1 or more"));
  SL_RETURN_IF_ERROR(require(o.reset_sets >= 1, "reset_sets", "1 or more"));
  SL_RETURN_IF_ERROR(
      require(o.max_hypotheses >= 1 && o.max_hypotheses <= 4, "max_hypotheses", "from 1 to 4"));
  SL_RETURN_IF_ERROR(require(positive(o.drop_margin), "drop_margin", "positive"));
  SL_RETURN_IF_ERROR(require(positive(o.start_sigma_linear), "start_sigma_linear", "positive"));
  SL_RETURN_IF_ERROR(require(positive(o.start_sigma_angular), "start_sigma_angular", "positive"));
  SL_RETURN_IF_ERROR(
      require(positive(o.reacquire_sigma_translation), "reacquire_sigma_translation", "positive"));
  SL_RETURN_IF_ERROR(
      require(positive(o.reacquire_sigma_rotation), "reacquire_sigma_rotation", "positive"));
  SL_RETURN_IF_ERROR(require(positive(o.hold_periods), "hold_periods", "positive"));
  SL_RETURN_IF_ERROR(require(o.max_hold > none, "max_hold", "positive"));
  SL_RETURN_IF_ERROR(require(o.silence >= none, "silence", "zero or more"));
  SL_RETURN_IF_ERROR(require(o.lost_after > none, "lost_after", "positive"));
  return require(o.searching_after >= o.lost_after, "searching_after", "at least lost_after");
}

}  // namespace

struct ObjectEstimator::Impl {
  Impl(const EstimatorOptions& chosen, ObjectId id, const ShapeSymmetry& shape_symmetry)
      : options(chosen),
        object(id),
        bank(chosen, id, shape_symmetry),
        initial(bank.nothing_known()),
        buffer(chosen.ring, chosen.ring_capacity, initial),
        history(chosen.history) {}

  const BankState& newest() const {
    return buffer.empty() ? initial : buffer.entry(buffer.size() - 1).after;
  }
  void replay_from(size_t index);
  void count(const BufferedSet& entry);
  PoseTrackPtr build_track() const;

  EstimatorOptions options;
  ObjectId object;
  fuse::HypothesisBank bank;
  BankState initial;
  OutOfSequenceBuffer buffer;
  fuse::History history;  ///< of sets that left the buffer
  EstimatorCounters counters;
  Time now = Time::min();
  mutable PoseTrackPtr track;
};

void ObjectEstimator::Impl::replay_from(size_t index) {
  for (size_t i = index; i < buffer.size(); ++i) {
    BufferedSet& entry = buffer.entry(i);
    bank.step(buffer.before(i), entry.time, entry.set(), entry.after);
  }
}

void ObjectEstimator::Impl::count(const BufferedSet& entry) {
  counters.accepted += static_cast<uint64_t>(std::popcount(entry.after.published.cameras));
  counters.gated += static_cast<uint64_t>(std::popcount(entry.after.gated));
  counters.starts += entry.after.started ? 1 : 0;
  counters.resets += entry.after.reset ? 1 : 0;
}

// Sets in the buffer and before it, then what silence makes of the newest state.
PoseTrackPtr ObjectEstimator::Impl::build_track() const {
  std::vector<PoseEstimate> estimates;
  estimates.reserve(history.size() + buffer.size() + 2);
  history.append_to(std::max(now, newest().published.time), estimates);
  for (size_t i = 0; i < buffer.size(); ++i) {
    estimates.push_back(buffer.entry(i).after.published);
  }
  if (buffer.empty() && newest().found_before) {  // adopted, and thinned out of the history perhaps
    while (!estimates.empty() && estimates.back().time >= newest().published.time) {
      estimates.pop_back();
    }
    estimates.push_back(newest().published);
  }
  if (newest().found_before) fuse::append_silence(newest(), now, options, estimates);
  return std::make_shared<const PoseTrack>(object, std::move(estimates), options.noise);
}

Result<ObjectEstimator> ObjectEstimator::create(const EstimatorOptions& options, ObjectId object,
                                                const ShapeSymmetry& shape_symmetry) {
  SL_RETURN_IF_ERROR(check(options));
  return ObjectEstimator(std::make_unique<Impl>(options, object, shape_symmetry));
}

ObjectEstimator::ObjectEstimator(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ObjectEstimator::~ObjectEstimator() = default;
ObjectEstimator::ObjectEstimator(ObjectEstimator&&) noexcept = default;
ObjectEstimator& ObjectEstimator::operator=(ObjectEstimator&&) noexcept = default;

UpdateReport ObjectEstimator::process(std::span<const Observation> set) {
  SL_CHECK(!set.empty(), "process() of an empty set has no capture time");
  Impl& impl = *impl_;
  const Time time = set.front().capture;
  for (const Observation& observation : set) {
    SL_CHECK(observation.capture == time, "observations of one set share their capture time");
  }
  ++impl.counters.sets;
  UpdateReport report;
  report.late = !impl.buffer.empty() && time < impl.buffer.entry(impl.buffer.size() - 1).time;
  const OutOfSequenceBuffer::Place place = impl.buffer.insert(time, impl.object, set);
  if (place.placement == OutOfSequenceBuffer::Placement::kTooLate) {
    ++impl.counters.late_dropped;
    report.estimate = impl.newest().published;
    report.dropped = true;
    return report;
  }
  if (place.placement == OutOfSequenceBuffer::Placement::kDuplicate) {
    ++impl.counters.duplicates;
    report.dropped = true;
  } else {
    impl.counters.late_inserted += report.late ? 1 : 0;
    impl.replay_from(place.index);
    impl.count(impl.buffer.entry(place.index));
    impl.track.reset();
  }
  const BankState& after = impl.buffer.entry(place.index).after;
  report.estimate = after.published;
  report.accepted = after.published.cameras;
  report.gated = after.gated;
  report.hypotheses = after.count;
  report.iterations = after.iterations;
  report.residual = after.residual;
  report.reset = after.reset;
  while (impl.buffer.overfull()) {
    impl.history.add(impl.buffer.entry(0).after.published);
    impl.buffer.drop_oldest();
  }
  return report;
}

void ObjectEstimator::advance(Time now) {
  if (now <= impl_->now) return;
  const TrackState before = state();
  impl_->now = now;
  if (state() != before) impl_->track.reset();
}

bool ObjectEstimator::adopt(const PoseTrack& track) {
  Impl& impl = *impl_;
  if (track.empty() || !has_pose(track.newest().state)) return false;
  const PoseEstimate& newest = track.newest();
  impl.initial = impl.bank.known(newest);
  impl.buffer.restart(impl.initial, newest.time);
  impl.history = fuse::History(impl.options.history);
  for (const PoseEstimate& estimate : track.history()) impl.history.add(estimate);
  impl.track.reset();
  return true;
}

void ObjectEstimator::set_doubted(bool doubted) { impl_->bank.set_doubted(doubted); }

void ObjectEstimator::set_possible_swap(bool possible) { impl_->bank.set_possible_swap(possible); }

PoseTrackPtr ObjectEstimator::track() const {
  if (!impl_->track) impl_->track = impl_->build_track();
  return impl_->track;
}

TrackState ObjectEstimator::state() const {
  const BankState& newest = impl_->newest();
  return impl_->now <= newest.published.time ? newest.published.state
                                             : state_in_silence(newest, impl_->now, impl_->options);
}

const EstimatorCounters& ObjectEstimator::counters() const { return impl_->counters; }
const EstimatorOptions& ObjectEstimator::options() const { return impl_->options; }

}  // namespace sightline
