// SPDX-License-Identifier: Apache-2.0
#include "fuse/history.hpp"

namespace sightline::fuse {

History::History(Duration length)
    : length_(length), spacing_(length / static_cast<int>(kCapacity - 4)), slots_(kCapacity) {}

void History::add(const PoseEstimate& estimate) {
  if (used_ > 0) {
    const PoseEstimate& newest = at(used_ - 1);
    if (estimate.state == newest.state && estimate.time - newest.time < spacing_) return;
  }
  if (used_ == kCapacity) {
    first_ = (first_ + 1) % kCapacity;
    --used_;
  }
  slots_[(first_ + used_) % kCapacity] = estimate;
  ++used_;
}

void History::append_to(Time now, std::vector<PoseEstimate>& out) const {
  for (size_t i = 0; i < used_; ++i) {
    if (now - at(i).time <= length_) out.push_back(at(i));
  }
}

}  // namespace sightline::fuse
