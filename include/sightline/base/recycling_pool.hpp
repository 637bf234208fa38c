// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "sightline/base/recycling_allocator.hpp"

namespace sightline {

/// Recycles objects that are costly to make: get() makes one only while the pool warms up. An
/// object goes back when its last reference is dropped, from any thread, and may outlive the pool.
///
/// It goes back through the deleter and the pool's mutex, so all that its last user read comes
/// before all that the next one writes. A use_count() of 1 would not tell that: it is a relaxed
/// load, and on ARM the reader's loads could still be pending.
template <class T>
class RecyclingPool {
 public:
  explicit RecyclingPool(size_t keep_at_most = 16)
      : shared_(std::make_shared<Shared>(keep_at_most)) {}

  /// An object as its last user left it, or else what `make` returns (a std::unique_ptr<T>).
  template <class Make>
  std::shared_ptr<T> get(const Make& make) {
    std::unique_ptr<T> object = shared_->take();
    if (!object) object = make();
    return std::shared_ptr<T>(
        object.release(), [shared = shared_](T* p) { shared->give_back(std::unique_ptr<T>(p)); },
        RecyclingAllocator<T>());
  }

  /// Objects made since the start; constant once warm.
  size_t allocated() const {
    std::lock_guard lock(shared_->mutex);
    return shared_->allocated;
  }

 private:
  /// Held by the pool and by every object that is out.
  struct Shared {
    explicit Shared(size_t keep) : keep_at_most(keep) { free.reserve(keep); }

    std::unique_ptr<T> take() {
      std::lock_guard lock(mutex);
      if (free.empty()) {
        ++allocated;
        return nullptr;
      }
      std::unique_ptr<T> object = std::move(free.back());
      free.pop_back();
      return object;
    }
    void give_back(std::unique_ptr<T> object) {
      std::lock_guard lock(mutex);
      if (free.size() < keep_at_most) free.push_back(std::move(object));
    }

    const size_t keep_at_most;
    mutable std::mutex mutex;
    std::vector<std::unique_ptr<T>> free;
    size_t allocated = 0;
  };
  std::shared_ptr<Shared> shared_;
};

}  // namespace sightline
