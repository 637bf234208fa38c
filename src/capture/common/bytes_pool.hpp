// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "sightline/base/recycling_pool.hpp"

namespace sightline::capture {

/// Recycles blocks of one size. A block goes back when its last reference is dropped, from any
/// thread; the memory outlives the pool object.
class BytesPool {
 public:
  explicit BytesPool(size_t size, size_t keep_at_most = 16) : size_(size), blocks_(keep_at_most) {}
  std::shared_ptr<uint8_t> get() {
    const auto block = blocks_.get([this] {
      return std::make_unique<Block>(Block{std::unique_ptr<uint8_t[]>(new uint8_t[size_])});
    });
    return {block, block->bytes.get()};
  }
  size_t size() const { return size_; }

 private:
  struct Block {
    std::unique_ptr<uint8_t[]> bytes;
  };
  size_t size_;
  RecyclingPool<Block> blocks_;
};

}  // namespace sightline::capture
