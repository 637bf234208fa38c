// SPDX-License-Identifier: Apache-2.0
#include "capture/common/frame_ids.hpp"

#include <algorithm>
#include <limits>

namespace sightline::capture {
namespace {

constexpr uint64_t kLast16 = 65535;  // as many numbers as there are, since 0 is left out
constexpr uint64_t kTurn32 = uint64_t{1} << 32;

}  // namespace

uint64_t FrameIds::forward(uint64_t id) const {
  if (id == last_id_) return 0;
  if (width_ == Width::k64) return id > last_id_ ? id - last_id_ : 0;
  const uint64_t turn = width_ == Width::k16 ? kLast16 : kTurn32;
  const uint64_t ahead = id > last_id_ ? id - last_id_ : id + turn - last_id_;
  // Half a turn ahead is more likely a step back.
  return ahead <= turn / 2 ? ahead : 0;
}

FrameIds::Step FrameIds::step(uint64_t id) {
  if (width_ == Width::k16 && id > kLast16) width_ = Width::k64;
  if (!started_) {
    started_ = true;
    last_id_ = id;
    return {sequence_, 0};
  }
  const uint64_t ahead = std::max<uint64_t>(forward(id), 1);
  last_id_ = id;
  sequence_ += ahead;
  return {sequence_, static_cast<uint32_t>(
                         std::min<uint64_t>(ahead - 1, std::numeric_limits<uint32_t>::max()))};
}

}  // namespace sightline::capture
