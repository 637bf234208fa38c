// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/libcamera_manager.hpp"

#include <libcamera/logging.h>

#include <algorithm>
#include <string_view>

#include "capture/libcamera/libcamera_error.hpp"
#include "sightline/base/log.hpp"

namespace sightline::capture {

std::streamsize LibcameraManager::LogLines::xsputn(const char* text, std::streamsize size) {
  std::string_view line(text, static_cast<size_t>(size));
  while (!line.empty() && line.back() == '\n') line.remove_suffix(1);
  const bool severe = line.find("ERROR") != line.npos || line.find("FATAL") != line.npos;
  if (line.empty()) return size;
  severe ? log::warning("libcamera: {}", line) : log::debug("libcamera: {}", line);
  return size;
}

// All that libcamera makes on first use is made in here, so that it is destroyed after this.
LibcameraManager::LibcameraManager() : log_(&lines_) {
  libcamera::logSetStream(&log_);
  manager_ = std::make_unique<libcamera::CameraManager>();
  start();
}

LibcameraManager::~LibcameraManager() {
  if (started_) manager_->stop();
  manager_.reset();
  libcamera::logSetTarget(libcamera::LoggingTargetNone);
}

void LibcameraManager::start() {
  failure_ = manager_->start();
  started_ = failure_ >= 0;
}

Result<LibcameraManager*> LibcameraManager::get() {
  static LibcameraManager manager;
  std::lock_guard lock(manager.mutex_);
  if (!manager.started_) manager.start();
  if (manager.started_) return &manager;
  return make_error(ErrorCode::kUnavailable, "", "libcamera does not start: {}",
                    libcamera_reason(manager.failure_));
}

std::vector<std::shared_ptr<libcamera::Camera>> LibcameraManager::cameras() const {
  auto all = manager_->cameras();
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a->id() < b->id(); });
  return all;
}

std::shared_ptr<libcamera::Camera> LibcameraManager::find(const std::string& id) const {
  for (auto& camera : manager_->cameras()) {
    if (camera->id() == id) return camera;
  }
  return nullptr;
}

CameraSignals& LibcameraManager::signals_of(const std::shared_ptr<libcamera::Camera>& camera) {
  std::lock_guard lock(mutex_);
  signals_.remove_if([](const CameraSignals& signals) { return signals.expired(); });
  for (CameraSignals& signals : signals_) {
    if (signals.are_of(camera)) return signals;
  }
  return signals_.emplace_back(camera);
}

}  // namespace sightline::capture
