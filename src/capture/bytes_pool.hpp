// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace sightline {

/// Recycles blocks of one size. A block goes back when its last reference is dropped, from any
/// thread; the memory outlives the pool object.
class BytesPool {
 public:
  explicit BytesPool(size_t size, size_t keep_at_most = 16);
  std::shared_ptr<uint8_t> get();
  size_t size() const { return size_; }

 private:
  struct Shared {
    std::mutex mutex;
    size_t keep_at_most;
    std::vector<std::unique_ptr<uint8_t[]>> free;
  };
  size_t size_;
  std::shared_ptr<Shared> shared_;
};

}  // namespace sightline
