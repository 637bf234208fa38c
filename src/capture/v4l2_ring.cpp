// SPDX-License-Identifier: Apache-2.0
#include "v4l2_ring.hpp"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "sightline/base/recycling_allocator.hpp"

namespace sightline {
namespace {

constexpr int kMostRefusals = 5;
constexpr uint32_t kMostBuffers = 32;

v4l2_buffer buffer_of(uint32_t index) {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

}  // namespace

V4l2Ring::V4l2Ring(V4l2Device device, std::shared_ptr<V4l2System> system)
    : device_(std::move(device)), system_(std::move(system)) {}

Result<std::shared_ptr<V4l2Ring>> V4l2Ring::start(V4l2Device device, int count,
                                                  size_t image_bytes) {
  auto system = device.shared_system();
  std::shared_ptr<V4l2Ring> ring(new V4l2Ring(std::move(device), std::move(system)));
  SL_RETURN_IF_ERROR(ring->map_all(count, image_bytes));
  SL_RETURN_IF_ERROR(ring->stream_on());
  return ring;
}

V4l2Ring::~V4l2Ring() {
  stop();
  for (const Buffer& buffer : buffers_) {
    if (buffer.dmabuf >= 0) system_->close(buffer.dmabuf);
    if (buffer.memory) system_->unmap(buffer.memory, buffer.bytes);
  }
}

Status V4l2Ring::map_all(int count, size_t image_bytes) {
  v4l2_requestbuffers request{};
  request.count = static_cast<uint32_t>(count);
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int r = device_.call(VIDIOC_REQBUFS, request); r < 0) {
    return device_.error(V4l2Step::kBuffers, r);
  }
  if (request.count < 2) return device_.error(V4l2Step::kBuffers, -ENOMEM);
  buffers_.resize(std::min(request.count, kMostBuffers));
  size_t largest = 0;
  for (uint32_t i = 0; i < buffers_.size(); ++i) {
    SL_RETURN_IF_ERROR(map_one(i, image_bytes));
    largest = std::max(largest, buffers_[i].bytes);
  }
  copies_.emplace(largest);
  return {};
}

Status V4l2Ring::map_one(uint32_t index, size_t image_bytes) {
  v4l2_buffer info = buffer_of(index);
  if (const int r = device_.call(VIDIOC_QUERYBUF, info); r < 0) {
    return device_.error(V4l2Step::kBuffers, r);
  }
  if (info.length < std::max<size_t>(image_bytes, 1)) {
    return make_error(ErrorCode::kIo, device_.where(),
                      "the driver of {} is inconsistent: a picture of {} bytes in a buffer of {}",
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

void V4l2Ring::export_dmabuf(uint32_t index) {
  v4l2_exportbuffer request{};
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.index = index;
  request.flags = O_CLOEXEC | O_RDONLY;
  if (device_.call(VIDIOC_EXPBUF, request) >= 0) buffers_[index].dmabuf = request.fd;
}

Status V4l2Ring::stream_on() {
  for (uint32_t i = 0; i < buffers_.size(); ++i) {
    if (const int r = enqueue(i); r < 0) return device_.error(V4l2Step::kBuffers, r);
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  const int r = device_.call(VIDIOC_STREAMON, type);
  return r < 0 ? Status(device_.error(V4l2Step::kStart, r)) : Status();
}

int V4l2Ring::poll(Duration limit) { return system_->poll(device_.fd(), limit); }

Result<std::optional<v4l2_buffer>> V4l2Ring::dequeue() {
  v4l2_buffer filled = buffer_of(0);
  std::lock_guard lock(mutex_);
  const int r = device_.call(VIDIOC_DQBUF, filled);
  if (r == -EAGAIN) return std::optional<v4l2_buffer>();
  if (r < 0) return device_.error(V4l2Step::kCapture, r);
  if (filled.index >= buffers_.size() || !buffers_[filled.index].queued) {
    return make_error(ErrorCode::kIo, device_.where(),
                      "the driver of {} gave buffer {}, which it does not have", device_.path(),
                      filled.index);
  }
  buffers_[filled.index].queued = false;
  return std::optional(filled);
}

std::span<const uint8_t> V4l2Ring::bytes(const v4l2_buffer& filled) const {
  const Buffer& buffer = buffers_[filled.index];
  return {static_cast<const uint8_t*>(buffer.memory),
          std::min<size_t>(filled.bytesused, buffer.bytes)};
}

std::shared_ptr<const void> V4l2Ring::lend(uint32_t index) {
  return {buffers_[index].memory,
          [ring = shared_from_this(), index](const void*) { ring->give_back(index); },
          RecyclingAllocator<std::byte>()};
}

void V4l2Ring::give_back(uint32_t index) {
  std::lock_guard lock(mutex_);
  if (device_.fd() >= 0) buffers_[index].refused = enqueue(index) < 0;
}

int V4l2Ring::enqueue(uint32_t index) {
  v4l2_buffer buffer = buffer_of(index);
  const int r = device_.call(VIDIOC_QBUF, buffer);
  buffers_[index].queued = r >= 0;
  return r;
}

std::shared_ptr<const uint8_t> V4l2Ring::copy(std::span<const uint8_t> bytes) {
  const auto memory = copies_->get();
  std::memcpy(memory.get(), bytes.data(), bytes.size());
  return memory;
}

size_t V4l2Ring::queued() const {
  std::lock_guard lock(mutex_);
  return static_cast<size_t>(
      std::count_if(buffers_.begin(), buffers_.end(), [](const Buffer& b) { return b.queued; }));
}

Status V4l2Ring::repair() {
  std::lock_guard lock(mutex_);
  for (uint32_t i = 0; i < buffers_.size(); ++i) {
    if (!buffers_[i].refused) continue;
    const int r = enqueue(i);
    buffers_[i].refused = r < 0;
    if (r >= 0) {
      refusals_ = 0;
    } else if (++refusals_ >= kMostRefusals) {
      return device_.error(V4l2Step::kCapture, r);
    }
  }
  return {};
}

void V4l2Ring::stop() {
  std::lock_guard lock(mutex_);
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

}  // namespace sightline
