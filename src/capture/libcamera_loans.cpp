// SPDX-License-Identifier: Apache-2.0
#include "libcamera_loans.hpp"

#include <algorithm>
#include <utility>

#include "sightline/base/recycling_allocator.hpp"

namespace sightline {

LibcameraLoans::LibcameraLoans(std::shared_ptr<LibcameraCamera> camera)
    : camera_(std::move(camera)), queued_(camera_->stream().buffers, true) {}

void LibcameraLoans::taken(size_t slot) {
  std::lock_guard lock(mutex_);
  queued_[slot] = false;
}

size_t LibcameraLoans::queued() const {
  std::lock_guard lock(mutex_);
  return static_cast<size_t>(std::count(queued_.begin(), queued_.end(), true));
}

std::shared_ptr<const void> LibcameraLoans::lend(size_t slot) {
  return {static_cast<const void*>(camera_->memory(slot).data()),
          [self = shared_from_this(), slot](const void*) { self->give_back(slot); },
          RecyclingAllocator<std::byte>()};
}

void LibcameraLoans::give_back(size_t slot) {
  std::lock_guard lock(mutex_);
  if (!open_) return;
  Status status = camera_->queue(slot);
  queued_[slot] = status.has_value();
  if (!status) refusal_ = std::move(status);
}

Status LibcameraLoans::refusal() const {
  std::lock_guard lock(mutex_);
  return refusal_;
}

void LibcameraLoans::close() {
  std::lock_guard lock(mutex_);
  if (!std::exchange(open_, false)) return;
  camera_->close();
}

}  // namespace sightline
