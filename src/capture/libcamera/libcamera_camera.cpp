// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/libcamera_camera.hpp"

#include <libcamera/control_ids.h>
#include <libcamera/property_ids.h>
#include <libcamera/version.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <ctime>
#include <thread>
#include <utility>

#include "capture/libcamera/libcamera_configure.hpp"
#include "capture/libcamera/libcamera_controls.hpp"
#include "capture/libcamera/libcamera_error.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/waiting.hpp"

namespace sightline::capture {
namespace {

using libcamera::Request;

constexpr Duration kLastCalls = std::chrono::milliseconds(100);

// CLOCK_BOOTTIME minus CLOCK_MONOTONIC: how long the host has slept.
Duration time_asleep() {
  timespec boot{};
  ::clock_gettime(CLOCK_BOOTTIME, &boot);
  const Duration since_boot(int64_t{boot.tv_sec} * 1'000'000'000 + boot.tv_nsec);
  return since_boot - MonotonicClock::now().time_since_epoch();
}

}  // namespace

LibcameraCamera::LibcameraCamera(std::shared_ptr<libcamera::Camera> camera, CameraSignals& signals,
                                 std::string where)
    : camera_(std::move(camera)), signals_(signals), id_(camera_->id()), where_(std::move(where)) {}

Result<std::shared_ptr<LibcameraCamera>> LibcameraCamera::open(
    std::shared_ptr<libcamera::Camera> camera, CameraSignals& signals,
    const LibcameraOptions& options, const std::string& where) {
  if (const int r = camera->acquire(); r < 0) {
    return make_error(ErrorCode::kUnavailable, where,
                      "cannot take {}: {}; another program is using it, or it is going",
                      camera->id(), libcamera_reason(r));
  }
  std::shared_ptr<LibcameraCamera> opened(new LibcameraCamera(std::move(camera), signals, where));
  SL_RETURN_IF_ERROR(opened->set_up(options));
  return opened;
}

Error LibcameraCamera::error(std::string_view what, int negative_errno) const {
  return libcamera_error(what, id_, negative_errno, where_);
}

Status LibcameraCamera::set_up(const LibcameraOptions& options) {
  SL_ASSIGN(auto configured, configure_libcamera(*camera_, options, where_));
  configuration_ = std::move(configured.configuration);
  stream_ = configured.stream;
  SL_ASSIGN(controls_, libcamera_controls(camera_->controls(), options.controls, where_));
  set_rate(options.rate_hz);
  return allocate();
}

Status LibcameraCamera::allocate() {
  libcamera::Stream* const stream = configuration_->at(0).stream();
  allocator_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
  if (const int r = allocator_->allocate(stream); r < 0) return error("get buffers from", r);
  const auto& buffers = allocator_->buffers(stream);
  for (size_t i = 0; i < buffers.size(); ++i) {
    SL_ASSIGN(MappedFrameBuffer memory, MappedFrameBuffer::map(*buffers[i], where_));
    if (memory.bytes().size() < std::max<size_t>(stream_.layout.image_bytes, 1)) {
      return make_error(ErrorCode::kIo, where_, "an image of {} bytes in a buffer of {}",
                        stream_.layout.image_bytes, memory.bytes().size());
    }
    memory_.push_back(std::move(memory));
    auto request = camera_->createRequest(i);
    if (!request || request->addBuffer(stream, buffers[i].get()) < 0) {
      return make_error(ErrorCode::kIo, where_, "{} takes no requests", id_);
    }
    requests_.push_back(std::move(request));
  }
  if (requests_.size() < 2) return error("get buffers from", -ENOMEM);
  return {};
}

void LibcameraCamera::set_rate(double rate_hz) {
  const auto limits = camera_->controls().find(libcamera::controls::FrameDurationLimits.id());
  if (rate_hz <= 0) return;
  if (limits == camera_->controls().end()) {
    log::warning("{}: the camera's rate cannot be set through libcamera; it keeps its own", where_);
    return;
  }
  const auto microseconds = static_cast<int64_t>(std::lround(1e6 / rate_hz));
  const std::array<int64_t, 2> both{microseconds, microseconds};
  controls_.set(libcamera::controls::FrameDurationLimits, libcamera::Span<const int64_t, 2>(both));
  stream_.layout.rate_hz = rate_hz;
}

Status LibcameraCamera::start() {
  completed_ = std::make_shared<CompletedRequests>(requests_.size(), controls_, where_);
  signals_.send_to(completed_);
  if (const int r = camera_->start(&controls_); r < 0) return error("start", r);
  running_ = true;
  // Some handlers, that of webcams among them, look at the controls of requests only.
  requests_.front()->controls().merge(controls_);
  for (const auto& request : requests_) {
    if (const int r = camera_->queueRequest(request.get()); r < 0) return error("start", r);
  }
  return {};
}

Status LibcameraCamera::queue(size_t index) {
  memory_[index].end_reading();
  Request& request = *requests_[index];
  request.reuse(Request::ReuseBuffers);
  const int r = camera_->queueRequest(&request);
  return r < 0 ? Status(error("go on with", r)) : Status();
}

Result<std::optional<FilledBuffer>> LibcameraCamera::dequeue(Duration limit) {
  const auto request = completed_->wait(limit);
  if (request) {
    memory_[request->buffer].begin_reading();
    return std::optional(filled_buffer(*request, now(), time_asleep()));
  }
  if (completed_->disconnected()) {
    return make_error(ErrorCode::kUnavailable, where_,
                      "the camera is gone: {} was unplugged or has switched itself off", id_);
  }
  return std::optional<FilledBuffer>();
}

// Whether the kernel still knows the camera; libcamera hears of its going later.
bool LibcameraCamera::has_devices() const {
#if LIBCAMERA_VERSION_MAJOR > 0 || LIBCAMERA_VERSION_MINOR >= 1
  const auto devices = camera_->properties().get(libcamera::properties::SystemDevices);
  for (const int64_t device : devices.value_or(libcamera::Span<const int64_t>())) {
    const auto number = static_cast<dev_t>(device);
    const auto path = fmt::format("/sys/dev/char/{}:{}", major(number), minor(number));
    if (::access(path.c_str(), F_OK) != 0) return false;
  }
#endif
  return true;
}

void LibcameraCamera::stop() {
  if (!camera_) return;
  const Waiting wait("the camera");
  // libcamera 0.4 cannot stop an unplugged camera: the driver takes no request back, and an
  // assertion ends the process. Destroyed as it runs, it closes the device and only complains. What
  // was asked of its thread just before is let pass first.
  const bool gone = (completed_ && completed_->disconnected()) || !has_devices();
  if (gone) std::this_thread::sleep_for(kLastCalls);
  if (running_ && !gone) camera_->stop();
  signals_.send_to(nullptr);
  requests_.clear();
  allocator_.reset();
  configuration_.reset();
  if (!gone) camera_->release();
  camera_.reset();
}

}  // namespace sightline::capture
