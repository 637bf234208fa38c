// SPDX-License-Identifier: Apache-2.0
#include "capture/common/buffer_leases.hpp"

#include <algorithm>
#include <utility>

#include "sightline/base/recycling_allocator.hpp"

namespace sightline::capture {

BufferLeases::BufferLeases(std::shared_ptr<BufferDevice> device, int queue_attempts)
    : device_(std::move(device)),
      queue_attempts_(queue_attempts),
      slots_(device_->buffer_count()) {}

Status BufferLeases::take(size_t index, const std::string& where) {
  std::lock_guard lock(mutex_);
  if (index >= slots_.size() || !slots_[index].queued) {
    return make_error(ErrorCode::kIo, where, "{} gave buffer {}, which it does not have",
                      device_->description(), index);
  }
  slots_[index].queued = false;
  return {};
}

size_t BufferLeases::queued() const {
  std::lock_guard lock(mutex_);
  return static_cast<size_t>(std::ranges::count(slots_, true, &Slot::queued));
}

std::shared_ptr<const void> BufferLeases::lend(size_t index) {
  return {static_cast<const void*>(device_->memory(index).data()),
          [self = shared_from_this(), index](const void*) { self->give_back(index); },
          RecyclingAllocator<std::byte>()};
}

void BufferLeases::give_back(size_t index) {
  std::lock_guard lock(mutex_);
  if (streaming_) queue(index);
}

void BufferLeases::queue(size_t index) {
  Slot& slot = slots_[index];
  Status status = device_->queue(index);
  slot.queued = status.has_value();
  slot.refusals = status ? 0 : slot.refusals + 1;
  if (!status) refusal_ = std::move(status);
}

Status BufferLeases::requeue_refused() {
  std::lock_guard lock(mutex_);
  for (size_t i = 0; i < slots_.size(); ++i) {
    if (slots_[i].refusals == 0) continue;
    if (slots_[i].refusals < queue_attempts_) queue(i);
    if (slots_[i].refusals >= queue_attempts_) return refusal_;
  }
  return {};
}

void BufferLeases::stop() {
  std::lock_guard lock(mutex_);
  if (std::exchange(streaming_, false)) device_->stop();
}

}  // namespace sightline::capture
