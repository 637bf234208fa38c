// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libcamera/framebuffer.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::capture {

/// The memory of one of libcamera's buffers as this process sees it.
class MappedFrameBuffer {
 public:
  /// `where` names the camera. kInvalidInput: the planes lie apart; kIo: it cannot be mapped.
  static Result<MappedFrameBuffer> map(const libcamera::FrameBuffer& buffer,
                                       const std::string& where);
  MappedFrameBuffer(MappedFrameBuffer&& other) noexcept;
  MappedFrameBuffer& operator=(MappedFrameBuffer&&) = delete;
  ~MappedFrameBuffer();

  std::span<const uint8_t> bytes() const { return {memory_ + skipped_, length_}; }
  int fd() const { return fd_.get(); }
  /// Between these two the processor may read; elsewhere the device may write.
  void begin_reading() const;
  void end_reading() const;

 private:
  MappedFrameBuffer() = default;
  void synchronize(uint64_t which) const;

  uint8_t* memory_ = nullptr;
  size_t skipped_ = 0, length_ = 0;
  UniqueFd fd_;
};

}  // namespace sightline::capture
