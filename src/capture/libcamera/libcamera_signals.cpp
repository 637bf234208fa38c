// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/libcamera_signals.hpp"

#include <libcamera/control_ids.h>
#include <libcamera/framebuffer.h>

#include <utility>

#include "capture/libcamera/libcamera_controls.hpp"
#include "sightline/base/log.hpp"

namespace sightline::capture {
namespace {

constexpr int kSettled = 10;  // frames after which controls have come into force

}  // namespace

CompletedRequests::CompletedRequests(size_t buffers, libcamera::ControlList controls,
                                     std::string where)
    : controls_(std::move(controls)), where_(std::move(where)) {
  requests_.reserve(buffers);
}

void CompletedRequests::add(libcamera::Request& request) {
  if (request.status() != libcamera::Request::RequestComplete || request.buffers().empty()) return;
  CompletedRequest completed;
  completed.buffer = static_cast<size_t>(request.cookie());
  const libcamera::FrameMetadata& frame = request.buffers().begin()->second->metadata();
  completed.good = frame.status == libcamera::FrameMetadata::FrameSuccess;
  completed.sequence = frame.sequence;
  for (const auto& plane : frame.planes()) completed.bytes += plane.bytesused;
  const libcamera::ControlList& told = request.metadata();
  completed.sensor_ns = told.get(libcamera::controls::SensorTimestamp).value_or(0);
  completed.exposure_ns = int64_t{1000} * told.get(libcamera::controls::ExposureTime).value_or(0);
  if (completed.good && ++good_ == kSettled) {
    for (const auto& line : control_differences(controls_, told)) {
      log::warning("{}: {}", where_, line);
    }
  }
  std::lock_guard lock(mutex_);
  requests_.push_back(completed);
  changed_.notify_one();
}

void CompletedRequests::set_disconnected() {
  std::lock_guard lock(mutex_);
  disconnected_ = true;
  changed_.notify_one();
}

bool CompletedRequests::disconnected() const {
  std::lock_guard lock(mutex_);
  return disconnected_;
}

std::optional<CompletedRequest> CompletedRequests::wait(Duration limit) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, limit, [this] { return disconnected_ || !requests_.empty(); });
  if (disconnected_ || requests_.empty()) return std::nullopt;
  const CompletedRequest oldest = requests_.front();
  requests_.erase(requests_.begin());
  return oldest;
}

CameraSignals::CameraSignals(const std::shared_ptr<libcamera::Camera>& camera) : camera_(camera) {
  camera->requestCompleted.connect(this, &CameraSignals::on_completed);
  camera->disconnected.connect(this, &CameraSignals::on_disconnected);
}

void CameraSignals::send_to(std::shared_ptr<CompletedRequests> requests) {
  std::lock_guard lock(mutex_);
  requests_ = std::move(requests);
}

void CameraSignals::on_completed(libcamera::Request* request) {
  std::lock_guard lock(mutex_);
  if (requests_) requests_->add(*request);
}

void CameraSignals::on_disconnected() {
  std::lock_guard lock(mutex_);
  if (requests_) requests_->set_disconnected();
}

}  // namespace sightline::capture
