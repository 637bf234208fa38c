// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/recycling_allocator.hpp"

#include <array>
#include <bit>
#include <mutex>
#include <vector>

namespace sightline {
namespace {

constexpr size_t kSmallest = 64, kLargest = 1024;
constexpr size_t kSizes = static_cast<size_t>(std::bit_width(kLargest / kSmallest));
constexpr size_t kKept = 256;  // of each size

// Blocks of one size that nobody uses.
struct Shelf {
  Shelf() { blocks.reserve(kKept); }
  std::mutex mutex;
  std::vector<void*> blocks;
};

// Never destroyed: blocks come back from threads and statics that end later than anything here.
std::array<Shelf, kSizes>& shelves() {
  static auto* const all = new std::array<Shelf, kSizes>;
  return *all;
}

// 64, 128, ... 1024 are numbered from 0.
size_t shelf_of(size_t bytes) {
  return bytes <= kSmallest ? 0 : static_cast<size_t>(std::bit_width((bytes - 1) / kSmallest));
}

}  // namespace

void* take_block(size_t bytes) {
  if (bytes > kLargest) return ::operator new(bytes);
  const size_t number = shelf_of(bytes);
  Shelf& shelf = shelves()[number];
  {
    std::lock_guard lock(shelf.mutex);
    if (!shelf.blocks.empty()) {
      void* const block = shelf.blocks.back();
      shelf.blocks.pop_back();
      return block;
    }
  }
  return ::operator new(kSmallest << number);
}

void give_back_block(void* block, size_t bytes) noexcept {
  if (bytes <= kLargest) {
    Shelf& shelf = shelves()[shelf_of(bytes)];
    std::lock_guard lock(shelf.mutex);
    if (shelf.blocks.size() < kKept) {
      shelf.blocks.push_back(block);  // within what was reserved
      return;
    }
  }
  ::operator delete(block);
}

}  // namespace sightline
