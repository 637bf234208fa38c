// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "sightline/base/latest_slot.hpp"
#include "sightline/model/frame.hpp"

namespace sightline {

/// Where somebody else's frames come in: the newest of one camera.
using TargetSlot = LatestSlot<FramePtr>;

/// Where frames of cameras that run already are handed over; by CameraId, null for those that take
/// no part. It keeps no thread alive, so that any thread may let go of it last.
class TargetFrames {
 public:
  explicit TargetFrames(std::vector<std::shared_ptr<TargetSlot>> slots)
      : slots_(std::move(slots)) {}
  /// Never waits; the newest of each camera is looked at.
  void push(const FramePtr& frame) const {
    const size_t camera = frame->info().camera.index();
    if (frame->info().status != FrameStatus::kGood) return;
    if (camera < slots_.size() && slots_[camera]) slots_[camera]->put(frame);
  }

 private:
  const std::vector<std::shared_ptr<TargetSlot>> slots_;
};

}  // namespace sightline
