// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libcamera/camera.h>
#include <libcamera/controls.h>
#include <libcamera/request.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "capture/libcamera/libcamera_open.hpp"
#include "sightline/base/time.hpp"

namespace sightline::capture {

/// The requests of one opening that came back, in order. libcamera's thread adds, the source's
/// takes.
class CompletedRequests {
 public:
  /// `controls`: what was set; what the metadata of a frame says against it is logged once.
  CompletedRequests(size_t buffers, libcamera::ControlList controls, std::string where);

  void add(libcamera::Request& request);
  void set_disconnected();
  bool disconnected() const;
  /// The oldest; nullopt: none in time, or the camera was disconnected.
  std::optional<CompletedRequest> wait(Duration limit);

 private:
  const libcamera::ControlList controls_;
  const std::string where_;
  int good_ = 0;  // libcamera's thread only
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<CompletedRequest> requests_;
  bool disconnected_ = false;
};

/// The receiver of a camera's signals. Connected once, for the camera's life: libcamera frees a
/// slot while its thread may be calling it.
class CameraSignals {
 public:
  explicit CameraSignals(const std::shared_ptr<libcamera::Camera>& camera);
  CameraSignals(const CameraSignals&) = delete;
  CameraSignals& operator=(const CameraSignals&) = delete;

  bool are_of(const std::shared_ptr<libcamera::Camera>& camera) const {
    return camera_.lock() == camera;
  }
  bool expired() const { return camera_.expired(); }
  /// Where they go from now on; null: nowhere.
  void send_to(std::shared_ptr<CompletedRequests> requests);

 private:
  void on_completed(libcamera::Request* request);
  void on_disconnected();

  const std::weak_ptr<libcamera::Camera> camera_;
  std::mutex mutex_;
  std::shared_ptr<CompletedRequests> requests_;
};

}  // namespace sightline::capture
