// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/common/buffer_device.hpp"
#include "capture/v4l2/v4l2_device.hpp"
#include "sightline/base/result.hpp"

namespace sightline::capture {

/// The driver's buffers, mapped once; the memory lives as long as this, the device is closed by
/// stop(), at once.
class V4l2Buffers final : public BufferDevice {
 public:
  /// Gets and maps `count` buffers of at least `image_bytes`. `exposure`: where the camera has a
  /// fixed one.
  static Result<std::shared_ptr<V4l2Buffers>> map(V4l2Device device, int count, size_t image_bytes,
                                                  std::optional<Duration> exposure);
  ~V4l2Buffers() override;
  V4l2Buffers(const V4l2Buffers&) = delete;
  V4l2Buffers& operator=(const V4l2Buffers&) = delete;

  std::string description() const override { return device_.description(); }
  size_t buffer_count() const override { return buffers_.size(); }
  std::span<const uint8_t> memory(size_t index) const override;
  int dmabuf_fd(size_t index) const override { return buffers_[index].dmabuf; }
  Status start() override;
  /// poll() and then a dequeue that does not block: drivers exist whose blocking one never returns
  /// after an unplug.
  Result<std::optional<FilledBuffer>> dequeue(Duration limit) override;
  Status queue(size_t index) override;
  void stop() override;
  Time now() const override { return system_->now(); }

 private:
  struct Buffer {
    void* memory = nullptr;
    size_t bytes = 0;
    int dmabuf = -1;
  };

  V4l2Buffers(V4l2Device device, std::optional<Duration> exposure);
  Status map_all(int count, size_t image_bytes);
  Status map_one(uint32_t index, size_t image_bytes);
  void export_dmabuf(uint32_t index);
  int enqueue(size_t index) const;
  FilledBuffer filled(const v4l2_buffer& buffer) const;

  V4l2Device device_;
  const std::shared_ptr<V4l2System> system_;
  const std::optional<Duration> exposure_;
  std::vector<Buffer> buffers_;
};

}  // namespace sightline::capture
