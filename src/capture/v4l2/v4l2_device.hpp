// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "capture/decode/stream_format.hpp"
#include "capture/v4l2/v4l2_error.hpp"
#include "capture/v4l2/v4l2_system.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/capture/common/device_info.hpp"
#include "sightline/capture/v4l2/v4l2_source.hpp"

namespace sightline::capture {

/// An open device node that captures images into memory-mapped buffers. One thread at a time.
class V4l2Device {
 public:
  /// `where` is the camera's name for messages. Refuses nodes that do not capture (the metadata
  /// node beside a webcam, an output).
  static Result<V4l2Device> open(std::shared_ptr<V4l2System> system, const std::string& path,
                                 const std::string& where);
  V4l2Device(V4l2Device&& other) noexcept;
  V4l2Device& operator=(V4l2Device&& other) = delete;
  ~V4l2Device() { close(); }

  /// Zero or a negative errno; -ENODEV once closed.
  template <typename T>
  int call(unsigned long request, T& argument) const {
    const Waiting wait("the camera");
    return fd_ < 0 ? -ENODEV : system_->ioctl(fd_, request, &argument);
  }
  Error error(V4l2Step step, int negative_errno) const;
  void close();

  const std::shared_ptr<V4l2System>& shared_system() const { return system_; }
  int fd() const { return fd_; }
  const std::string& path() const { return path_; }
  const std::string& where() const { return where_; }
  const std::string& card() const { return card_; }
  /// "/dev/video0 (HD Webcam)".
  std::string description() const;

 private:
  V4l2Device(std::shared_ptr<V4l2System> system, int fd, std::string path, std::string where);

  std::shared_ptr<V4l2System> system_;
  int fd_;
  std::string path_, where_, card_;
};

/// A format and size that a device offers. A range of sizes reaches from `width` x `height` down to
/// `min_width` x `min_height`.
struct V4l2Mode {
  uint32_t fourcc = 0;
  int width = 0, height = 0;
  int min_width = 0, min_height = 0;
  std::vector<double> rates_hz;  ///< ascending; empty: unknown

  bool has_size(int w, int h) const {
    return w >= min_width && w <= width && h >= min_height && h <= height;
  }
};
std::vector<V4l2Mode> v4l2_modes(const V4l2Device& device);

/// Chooses a format (see V4l2Options), sets it, size and rate, and checks what the driver made of
/// it.
Result<StreamFormat> negotiate_v4l2(const V4l2Device& device, const V4l2Options& options);

/// Sets all controls by name and reads them back; a value that the camera changed is logged. Also
/// forbids automatic exposure to lower the frame rate, unless the user names that control. Some
/// cameras take seconds for each; after `stop` it gives up between two.
Status set_v4l2_controls(const V4l2Device& device,
                         const std::map<std::string, V4l2ControlValue>& controls,
                         const std::stop_token& stop = {});
/// Exposure time where the camera has a fixed one, else nullopt.
std::optional<Duration> v4l2_exposure(const V4l2Device& device);

}  // namespace sightline::capture
