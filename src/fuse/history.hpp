// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "sightline/model/pose_track.hpp"

namespace sightline::fuse {

/// Estimates that can no longer change, thinned to a bounded number (fixed memory, a snapshot of
/// them is cheap): between them PoseTrack interpolates.
class History {
 public:
  explicit History(Duration length);

  /// Times must grow. An estimate too close to the one before is left out, unless the state
  /// changed.
  void add(const PoseEstimate& estimate);
  /// Oldest first, those younger than `length` at `now`.
  void append_to(Time now, std::vector<PoseEstimate>& out) const;
  size_t size() const { return used_; }

 private:
  static constexpr size_t kCapacity = 64;
  const PoseEstimate& at(size_t index) const { return slots_[(first_ + index) % kCapacity]; }

  Duration length_;
  Duration spacing_;
  std::vector<PoseEstimate> slots_;
  size_t first_ = 0;
  size_t used_ = 0;
};

}  // namespace sightline::fuse
