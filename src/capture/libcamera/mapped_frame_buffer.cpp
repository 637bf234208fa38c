// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/mapped_frame_buffer.hpp"

#include <linux/dma-buf.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "capture/libcamera/libcamera_error.hpp"

namespace sightline::capture {

Result<MappedFrameBuffer> MappedFrameBuffer::map(const libcamera::FrameBuffer& buffer,
                                                 const std::string& where) {
  const auto& planes = buffer.planes();
  size_t length = 0;
  for (size_t i = 0; i < planes.size(); ++i) {
    if (planes[i].fd.get() != planes[0].fd.get() || planes[i].offset != planes[0].offset + length) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "the camera's buffers have their planes apart; choose another format");
    }
    length += planes[i].length;
  }
  if (length == 0) return make_error(ErrorCode::kIo, where, "the camera's buffers are empty");
  MappedFrameBuffer mapped;
  mapped.skipped_ = planes[0].offset;
  mapped.length_ = length;
  mapped.fd_.reset(::dup(planes[0].fd.get()));
  void* const memory =
      ::mmap(nullptr, mapped.skipped_ + length, PROT_READ, MAP_SHARED, mapped.fd_.get(), 0);
  if (memory == MAP_FAILED) {
    return make_error(ErrorCode::kIo, where, "cannot map the camera's buffers: {}",
                      libcamera_reason(-errno));
  }
  mapped.memory_ = static_cast<uint8_t*>(memory);
  return mapped;
}

MappedFrameBuffer::MappedFrameBuffer(MappedFrameBuffer&& other) noexcept
    : memory_(std::exchange(other.memory_, nullptr)),
      skipped_(other.skipped_),
      length_(other.length_),
      fd_(std::move(other.fd_)) {}

MappedFrameBuffer::~MappedFrameBuffer() {
  if (memory_ != nullptr) ::munmap(memory_, skipped_ + length_);
}

void MappedFrameBuffer::begin_reading() const { synchronize(DMA_BUF_SYNC_START); }
void MappedFrameBuffer::end_reading() const { synchronize(DMA_BUF_SYNC_END); }

void MappedFrameBuffer::synchronize(uint64_t which) const {
  dma_buf_sync sync{which | DMA_BUF_SYNC_READ};
  ::ioctl(fd_.get(), DMA_BUF_IOCTL_SYNC, &sync);  // memory that is no DMA-BUF needs none
}

}  // namespace sightline::capture
