// SPDX-License-Identifier: Apache-2.0
#include "bytes_pool.hpp"

#include <utility>

#include "sightline/base/recycling_allocator.hpp"

namespace sightline {

BytesPool::BytesPool(size_t size, size_t keep_at_most)
    : size_(size), shared_(std::make_shared<Shared>()) {
  shared_->keep_at_most = keep_at_most;
  shared_->free.reserve(keep_at_most);
}

std::shared_ptr<uint8_t> BytesPool::get() {
  std::unique_ptr<uint8_t[]> block;
  {
    std::lock_guard lock(shared_->mutex);
    if (!shared_->free.empty()) {
      block = std::move(shared_->free.back());
      shared_->free.pop_back();
    }
  }
  if (!block) block.reset(new uint8_t[size_]);
  return {block.release(),
          [shared = shared_](uint8_t* bytes) {
            std::unique_ptr<uint8_t[]> returned(bytes);
            std::lock_guard lock(shared->mutex);
            if (shared->free.size() < shared->keep_at_most) {
              shared->free.push_back(std::move(returned));
            }
          },
          RecyclingAllocator<std::byte>()};
}

}  // namespace sightline
