// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libcamera/camera.h>
#include <libcamera/camera_manager.h>

#include <list>
#include <memory>
#include <mutex>
#include <ostream>
#include <streambuf>
#include <string>
#include <vector>

#include "capture/libcamera/libcamera_signals.hpp"
#include "sightline/base/result.hpp"

namespace sightline::capture {

/// The one camera manager that libcamera allows a process. Any thread.
class LibcameraManager {
 public:
  /// Starts it at the first call, and again where that failed. kUnavailable: it does not start.
  static Result<LibcameraManager*> get();

  std::vector<std::shared_ptr<libcamera::Camera>> cameras() const;  ///< by id
  /// Null: there is none of that id.
  std::shared_ptr<libcamera::Camera> find(const std::string& id) const;
  CameraSignals& signals_of(const std::shared_ptr<libcamera::Camera>& camera);

 private:
  // libcamera's own log lines go where ours go; most of its warnings mean nothing to a user.
  class LogLines final : public std::streambuf {
   protected:
    std::streamsize xsputn(const char* text, std::streamsize size) override;
    int_type overflow(int_type c) override { return traits_type::not_eof(c); }
  };

  LibcameraManager();
  ~LibcameraManager();
  void start();

  std::mutex mutex_;
  bool started_ = false;
  int failure_ = 0;
  LogLines lines_;
  std::ostream log_;
  std::unique_ptr<libcamera::CameraManager> manager_;
  std::list<CameraSignals> signals_;
};

}  // namespace sightline::capture
