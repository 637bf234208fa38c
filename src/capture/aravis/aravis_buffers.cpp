// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_buffers.hpp"

#include "sightline/base/recycling_allocator.hpp"

namespace sightline::capture {

std::shared_ptr<const void> AravisBuffers::lend(ArvBuffer* buffer) {
  lent_.fetch_add(1, std::memory_order_relaxed);
  return {static_cast<const void*>(buffer),
          [self = shared_from_this(), buffer](const void*) {
            self->lent_.fetch_sub(1, std::memory_order_relaxed);
            self->give_back(buffer);
          },
          RecyclingAllocator<std::byte>()};
}

void AravisBuffers::give_back(ArvBuffer* buffer) {
  std::lock_guard lock(mutex_);
  if (stream_ != nullptr) {
    arv_stream_push_buffer(stream_, buffer);  // takes the reference over
  } else {
    g_object_unref(buffer);
  }
}

void AravisBuffers::close() {
  std::lock_guard lock(mutex_);
  stream_ = nullptr;
}

}  // namespace sightline::capture
