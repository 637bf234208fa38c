// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <new>

namespace sightline {

/// A block of at least `bytes` (aligned for any fundamental type), out of those that were given
/// back, and only else from the heap. Any thread. Large blocks are not recycled.
void* take_block(size_t bytes);
/// `bytes` as when it was taken.
void give_back_block(void* block, size_t bytes) noexcept;

/// Allocator of the small things that every frame needs anew, above all the control blocks of
/// shared pointers: their memory is kept and used again, so nothing allocates once a camera runs.
template <typename T>
struct RecyclingAllocator {
  using value_type = T;
  RecyclingAllocator() = default;
  template <typename U>
  RecyclingAllocator(const RecyclingAllocator<U>&) {}  // NOLINT: rebinding is implicit

  T* allocate(size_t n) {
    static_assert(alignof(T) <= alignof(std::max_align_t));
    if (n > std::numeric_limits<size_t>::max() / sizeof(T)) throw std::bad_array_new_length();
    return static_cast<T*>(take_block(n * sizeof(T)));
  }
  void deallocate(T* p, size_t n) noexcept { give_back_block(p, n * sizeof(T)); }
  template <typename U>
  bool operator==(const RecyclingAllocator<U>&) const {
    return true;
  }
};

}  // namespace sightline
