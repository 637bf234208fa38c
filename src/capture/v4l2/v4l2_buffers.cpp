// SPDX-License-Identifier: Apache-2.0
#include "capture/v4l2/v4l2_buffers.hpp"

#include <fcntl.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace sightline::capture {
namespace {

constexpr uint32_t kMaxBuffers = 32;

v4l2_buffer buffer_of(size_t index) {
  v4l2_buffer buffer{};
  buffer.index = static_cast<uint32_t>(index);
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

StampPoint stamp_point(uint32_t flags) {
  return (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE
             ? StampPoint::kStartOfExposure
             : StampPoint::kEndOfFrame;
}

bool is_monotonic(uint32_t flags) {
  return (flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
}

int64_t stamp_ns(const v4l2_buffer& buffer) {
  return int64_t{buffer.timestamp.tv_sec} * 1'000'000'000 +
         int64_t{buffer.timestamp.tv_usec} * 1'000;
}

}  // namespace

V4l2Buffers::V4l2Buffers(V4l2Device device, std::optional<Duration> exposure)
    : device_(std::move(device)), system_(device_.shared_system()), exposure_(exposure) {}

Result<std::shared_ptr<V4l2Buffers>> V4l2Buffers::map(V4l2Device device, int count,
                                                      size_t image_bytes,
                                                      std::optional<Duration> exposure) {
  std::shared_ptr<V4l2Buffers> buffers(new V4l2Buffers(std::move(device), exposure));
  SL_RETURN_IF_ERROR(buffers->map_all(count, image_bytes));
  return buffers;
}

V4l2Buffers::~V4l2Buffers() {
  stop();
  for (const Buffer& buffer : buffers_) {
    if (buffer.dmabuf >= 0) system_->close(buffer.dmabuf);
    if (buffer.memory) system_->unmap(buffer.memory, buffer.bytes);
  }
}

Status V4l2Buffers::map_all(int count, size_t image_bytes) {
  v4l2_requestbuffers request{};
  request.count = static_cast<uint32_t>(count);
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int r = device_.call(VIDIOC_REQBUFS, request); r < 0) {
    return device_.error(V4l2Step::kBuffers, r);
  }
  if (request.count < 2) return device_.error(V4l2Step::kBuffers, -ENOMEM);
  buffers_.resize(std::min(request.count, kMaxBuffers));
  for (uint32_t i = 0; i < buffers_.size(); ++i) {
    SL_RETURN_IF_ERROR(map_one(i, image_bytes));
  }
  return {};
}

Status V4l2Buffers::map_one(uint32_t index, size_t image_bytes) {
  v4l2_buffer info = buffer_of(index);
  if (const int r = device_.call(VIDIOC_QUERYBUF, info); r < 0) {
    return device_.error(V4l2Step::kBuffers, r);
  }
  if (info.length < std::max<size_t>(image_bytes, 1)) {
    return make_error(ErrorCode::kIo, device_.where(),
                      "the driver of {} is inconsistent: an image of {} bytes in a buffer of {}",
                      device_.path(), image_bytes, info.length);
  }
  Buffer& buffer = buffers_[index];
  void* memory = nullptr;
  if (const int r = system_->map(device_.fd(), info.length, info.m.offset, &memory); r < 0) {
    return device_.error(V4l2Step::kBuffers, r);
  }
  buffer.memory = memory;
  buffer.bytes = info.length;
  export_dmabuf(index);
  return {};
}

void V4l2Buffers::export_dmabuf(uint32_t index) {
  v4l2_exportbuffer request{};
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.index = index;
  request.flags = O_CLOEXEC | O_RDONLY;
  if (device_.call(VIDIOC_EXPBUF, request) >= 0) buffers_[index].dmabuf = request.fd;
}

std::span<const uint8_t> V4l2Buffers::memory(size_t index) const {
  return {static_cast<const uint8_t*>(buffers_[index].memory), buffers_[index].bytes};
}

int V4l2Buffers::enqueue(size_t index) const {
  v4l2_buffer buffer = buffer_of(index);
  return device_.call(VIDIOC_QBUF, buffer);
}

Status V4l2Buffers::start() {
  for (size_t i = 0; i < buffers_.size(); ++i) {
    if (const int r = enqueue(i); r < 0) return device_.error(V4l2Step::kBuffers, r);
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  const int r = device_.call(VIDIOC_STREAMON, type);
  return r < 0 ? Status(device_.error(V4l2Step::kStart, r)) : Status();
}

Result<std::optional<FilledBuffer>> V4l2Buffers::dequeue(Duration limit) {
  const int events = system_->poll(device_.fd(), limit);
  if (events < 0) return device_.error(V4l2Step::kCapture, events);
  if (events == 0) return std::optional<FilledBuffer>();
  v4l2_buffer buffer = buffer_of(0);
  const int r = device_.call(VIDIOC_DQBUF, buffer);
  if (r >= 0) return std::optional(filled(buffer));
  if (r != -EAGAIN) return device_.error(V4l2Step::kCapture, r);
  // Trouble without a buffer or a reason: the driver has stopped.
  if ((events & POLLERR) != 0) return device_.error(V4l2Step::kCapture, -EIO);
  return std::optional<FilledBuffer>();
}

FilledBuffer V4l2Buffers::filled(const v4l2_buffer& buffer) const {
  FilledBuffer filled;
  filled.index = buffer.index;
  filled.bytes_used = buffer.bytesused;
  filled.damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
  filled.sequence = buffer.sequence;
  filled.arrival = system_->now();
  filled.device_time_ns = stamp_ns(buffer);
  if (is_monotonic(buffer.flags)) filled.stamp = time_from_ns(filled.device_time_ns);
  filled.stamp_point = stamp_point(buffer.flags);
  filled.exposure = exposure_;
  return filled;
}

Status V4l2Buffers::queue(size_t index) {
  const int r = enqueue(index);
  return r < 0 ? Status(device_.error(V4l2Step::kCapture, r)) : Status();
}

void V4l2Buffers::stop() {
  if (device_.fd() < 0) return;
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  device_.call(VIDIOC_STREAMOFF, type);
  // Gives up the ownership of the queue even while frames still map its buffers, so that the device
  // can be opened again. Older kernels refuse that; closing does it once the frames are gone.
  v4l2_requestbuffers none{};
  none.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  none.memory = V4L2_MEMORY_MMAP;
  device_.call(VIDIOC_REQBUFS, none);
  device_.close();
}

}  // namespace sightline::capture
