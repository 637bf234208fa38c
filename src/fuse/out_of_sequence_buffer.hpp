// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "fuse/bank_state.hpp"
#include "sightline/model/observation.hpp"

namespace sightline::fuse {

/// A set and what was known after it.
struct BufferedSet {
  Time time{};
  std::vector<Observation> slots;  ///< only the first `used` count; the rest is kept memory
  size_t used = 0;
  BankState after;

  std::span<const Observation> set() const { return {slots.data(), used}; }
};

/// The last sets in order of capture time, so that one which comes late finds its place. Entries
/// are reused: no allocation once the buffer has been full.
class OutOfSequenceBuffer {
 public:
  OutOfSequenceBuffer(Duration span, int capacity, const BankState& initial);

  /// Empties it: nothing may come before `time`, when `base` was known.
  void restart(const BankState& base, Time time);

  enum class Placement { kPlaced, kTooLate, kDuplicate };
  struct Place {
    Placement placement = Placement::kPlaced;
    size_t index = 0;  ///< of the entry that now holds the set; entries from here on are to replay
  };
  /// Files the observations of `object` in `set` under `time`. Observations of cameras that the
  /// entry of this time has already are duplicates, unless only the later one saw the object, or it
  /// refutes the earlier one; then later entries lose what was measured about a known pose only.
  Place insert(Time time, ObjectId object, std::span<const Observation> set);

  size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }
  BufferedSet& entry(size_t index) { return *entries_[index]; }
  const BufferedSet& entry(size_t index) const { return *entries_[index]; }
  /// What was known before entry `index`.
  const BankState& before(size_t index) const;

  /// True while the oldest entry is out of the buffer's span or capacity.
  bool overfull() const;
  /// Takes the oldest entry out; its state becomes the base that nothing may come before.
  void drop_oldest();

 private:
  std::unique_ptr<BufferedSet> new_entry(Time time);
  void forget_refinements_after(size_t index);

  Duration span_;
  size_t capacity_;
  BankState base_;
  bool has_base_ = false;
  Time base_time_{};
  std::vector<std::unique_ptr<BufferedSet>> entries_;
  std::vector<std::unique_ptr<BufferedSet>> spare_;
};

}  // namespace sightline::fuse
