// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "bytes_pool.hpp"
#include "sightline/base/result.hpp"
#include "v4l2_device.hpp"

namespace sightline {

/// The driver's buffers, mapped once. Frames hold them through lend(), so the ring lives until both
/// the source and the last frame are gone; the device itself is closed by stop(), at once.
class V4l2Ring : public std::enable_shared_from_this<V4l2Ring> {
 public:
  /// Gets and maps `count` buffers of at least `image_bytes`, and starts streaming.
  static Result<std::shared_ptr<V4l2Ring>> start(V4l2Device device, int count, size_t image_bytes);
  ~V4l2Ring();
  V4l2Ring(const V4l2Ring&) = delete;
  V4l2Ring& operator=(const V4l2Ring&) = delete;

  /// Waits for a buffer or trouble: revents of poll(), or a negative errno.
  int poll(Duration limit);
  /// A filled buffer, nullopt if there is none now. The caller ends it by lend() or give_back().
  Result<std::optional<v4l2_buffer>> dequeue();
  std::span<const uint8_t> bytes(const v4l2_buffer& filled) const;
  int dmabuf_fd(uint32_t index) const { return buffers_[index].dmabuf; }

  /// Gives the buffer back when the last copy of the pointer dies, on whatever thread.
  std::shared_ptr<const void> lend(uint32_t index);
  void give_back(uint32_t index);
  /// A copy of a buffer's bytes, in recycled memory.
  std::shared_ptr<const uint8_t> copy(std::span<const uint8_t> bytes);

  /// Buffers that the driver can fill now.
  size_t queued() const;
  /// Tries again to queue what the driver refused before; an error if it refuses for good.
  Status repair();
  /// Ends streaming and closes the device. Lent buffers stay readable.
  void stop();
  const V4l2Device& device() const { return device_; }

 private:
  struct Buffer {
    void* memory = nullptr;
    size_t bytes = 0;
    int dmabuf = -1;
    bool queued = false;
    bool refused = false;
  };

  V4l2Ring(V4l2Device device, std::shared_ptr<V4l2System> system);
  Status map_all(int count, size_t image_bytes);
  Status map_one(uint32_t index, size_t image_bytes);
  void export_dmabuf(uint32_t index);
  Status stream_on();
  int enqueue(uint32_t index);  // needs mutex_

  mutable std::mutex mutex_;  // device_'s life and the queued marks
  V4l2Device device_;
  std::shared_ptr<V4l2System> system_;
  std::vector<Buffer> buffers_;
  std::optional<BytesPool> copies_;
  int refusals_ = 0;
};

}  // namespace sightline
