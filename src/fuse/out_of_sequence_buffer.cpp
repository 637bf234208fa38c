// SPDX-License-Identifier: Apache-2.0
#include "fuse/out_of_sequence_buffer.hpp"

#include <algorithm>

namespace sightline::fuse {
namespace {

Observation* observation_of(BufferedSet& entry, CameraId camera) {
  const auto end = entry.slots.begin() + static_cast<ptrdiff_t>(entry.used);
  const auto found = std::find_if(entry.slots.begin(), end,
                                  [camera](const Observation& o) { return o.camera == camera; });
  return found == end ? nullptr : &*found;
}

// In order of cameras, so that the sum over cameras does not depend on who came first.
void add(const Observation& observation, BufferedSet& entry) {
  if (entry.used == entry.slots.size()) entry.slots.emplace_back();
  entry.slots[entry.used++] = observation;
  for (size_t i = entry.used - 1; i > 0 && entry.slots[i].camera < entry.slots[i - 1].camera; --i) {
    std::swap(entry.slots[i], entry.slots[i - 1]);
  }
}

}  // namespace

OutOfSequenceBuffer::OutOfSequenceBuffer(Duration span, int capacity, const BankState& initial)
    : span_(span), capacity_(static_cast<size_t>(capacity)), base_(initial) {
  entries_.reserve(capacity_ + 2);
  spare_.reserve(capacity_ + 2);
}

void OutOfSequenceBuffer::restart(const BankState& base, Time time) {
  while (!entries_.empty()) drop_oldest();
  base_ = base;
  base_time_ = time;
  has_base_ = true;
}

std::unique_ptr<BufferedSet> OutOfSequenceBuffer::new_entry(Time time) {
  std::unique_ptr<BufferedSet> entry;
  if (spare_.empty()) {
    entry = std::make_unique<BufferedSet>();
  } else {
    entry = std::move(spare_.back());
    spare_.pop_back();
  }
  entry->time = time;
  return entry;
}

OutOfSequenceBuffer::Place OutOfSequenceBuffer::insert(Time time, ObjectId object,
                                                       std::span<const Observation> set) {
  if (has_base_ && time <= base_time_) return {Placement::kTooLate, 0};
  if (!entries_.empty() && time < entries_.back()->time - span_) return {Placement::kTooLate, 0};
  auto position = std::lower_bound(
      entries_.begin(), entries_.end(), time,
      [](const std::unique_ptr<BufferedSet>& entry, Time t) { return entry->time < t; });
  const auto index = static_cast<size_t>(position - entries_.begin());
  const bool joins = position != entries_.end() && (*position)->time == time;
  if (!joins) entries_.insert(position, new_entry(time));
  BufferedSet& entry = *entries_[index];
  bool anything_new = !joins;
  for (const Observation& observation : set) {
    if (observation.object != object) continue;
    Observation* const known = observation_of(entry, observation.camera);
    // A slower search of the same frame may have found what the first one did not, or that the
    // first one was measured about a wrong pose.
    const bool sees_more = known != nullptr && !observation.terms.empty() &&
                           (known->terms.empty() || (observation.refutes && !known->refutes));
    if (known != nullptr && !sees_more) continue;
    if (sees_more) {
      *known = observation;
    } else {
      add(observation, entry);
    }
    anything_new = true;
    if (observation.refutes) forget_refinements_after(index);
  }
  const bool nothing_new = !anything_new;
  return {nothing_new ? Placement::kDuplicate : Placement::kPlaced, index};
}

// They were measured about a pose that is given up.
void OutOfSequenceBuffer::forget_refinements_after(size_t index) {
  for (size_t i = index + 1; i < entries_.size(); ++i) {
    BufferedSet& entry = *entries_[i];
    for (size_t k = 0; k < entry.used; ++k) {
      Observation& observation = entry.slots[k];
      if (!observation.hypotheses.empty()) continue;  // it stands alone
      observation.terms.clear();
      observation.symmetric_hypotheses.clear();
    }
  }
}

const BankState& OutOfSequenceBuffer::before(size_t index) const {
  return index == 0 ? base_ : entries_[index - 1]->after;
}

bool OutOfSequenceBuffer::overfull() const {
  return entries_.size() > capacity_ ||
         (entries_.size() > 1 && entries_.front()->time < entries_.back()->time - span_);
}

void OutOfSequenceBuffer::drop_oldest() {
  std::unique_ptr<BufferedSet> entry = std::move(entries_.front());
  entries_.erase(entries_.begin());
  base_ = entry->after;
  base_time_ = entry->time;
  has_base_ = true;
  for (size_t i = 0; i < entry->used; ++i) {  // let go of the terms, keep the vectors
    entry->slots[i].terms.clear();
    entry->slots[i].hypotheses.clear();
    entry->slots[i].symmetric_hypotheses.clear();
  }
  entry->used = 0;
  spare_.push_back(std::move(entry));
}

}  // namespace sightline::fuse
