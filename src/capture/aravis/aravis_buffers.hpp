// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>

#include "capture/aravis/aravis_ref.hpp"

namespace sightline::capture {

/// Lends the stream's buffers to frames and gives them back, from any thread, for as long as the
/// stream lives; afterwards they are freed with their last reader.
class AravisBuffers : public std::enable_shared_from_this<AravisBuffers> {
 public:
  /// Borrows the stream until close().
  explicit AravisBuffers(ArvStream* stream) : stream_(stream) {}

  /// Takes over one reference of the buffer; the result's last copy gives it back.
  std::shared_ptr<const void> lend(ArvBuffer* buffer);
  void give_back(ArvBuffer* buffer);
  int lent() const { return lent_.load(std::memory_order_relaxed); }
  void close();

 private:
  std::mutex mutex_;
  ArvStream* stream_;
  std::atomic<int> lent_{0};
};

}  // namespace sightline::capture
