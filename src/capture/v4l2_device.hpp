// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/capture/device_info.hpp"
#include "sightline/capture/v4l2_source.hpp"
#include "v4l2_error.hpp"
#include "v4l2_formats.hpp"
#include "v4l2_system.hpp"

namespace sightline {

/// An open device node that captures pictures into memory-mapped buffers. One thread at a time.
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
    return fd_ < 0 ? -ENODEV : system_->ioctl(fd_, request, &argument);
  }
  Error error(V4l2Step step, int negative_errno) const;
  void close();

  const std::shared_ptr<V4l2System>& shared_system() const { return system_; }
  int fd() const { return fd_; }
  const std::string& path() const { return path_; }
  const std::string& where() const { return where_; }
  const std::string& card() const { return card_; }
  const std::string& bus() const { return bus_; }

 private:
  V4l2Device(std::shared_ptr<V4l2System> system, int fd, std::string path, std::string where);

  std::shared_ptr<V4l2System> system_;
  int fd_;
  std::string path_, where_, card_, bus_;
};

/// A format and size that a device offers. A range of sizes reaches from `width` x `height` down to
/// `least_width` x `least_height`.
struct V4l2Mode {
  uint32_t fourcc = 0;
  int width = 0, height = 0;
  int least_width = 0, least_height = 0;
  std::vector<double> rates_hz;  ///< ascending; empty: unknown

  bool has_size(int w, int h) const {
    return w >= least_width && w <= width && h >= least_height && h <= height;
  }
};
std::vector<V4l2Mode> v4l2_modes(const V4l2Device& device);

/// What a device was set to.
struct V4l2StreamFormat {
  V4l2Format format{};
  int width = 0, height = 0;
  ptrdiff_t stride = 0;    ///< raw and Bayer
  size_t image_bytes = 0;  ///< least size of a whole frame; 0: compressed
  double rate_hz = 0;      ///< 0: the driver does not say
};
/// Chooses a format (see V4l2Options), sets it, size and rate, and checks what the driver made of
/// it.
Result<V4l2StreamFormat> negotiate_v4l2(const V4l2Device& device, const V4l2Options& options);

/// Sets all controls by name and reads them back; a value that the camera changed is logged. Also
/// forbids automatic exposure to lower the frame rate, unless the user names that control.
Status set_v4l2_controls(const V4l2Device& device,
                         const std::map<std::string, V4l2ControlValue>& controls);
/// Exposure time where the camera has a fixed one, else nullopt.
std::optional<Duration> v4l2_exposure(const V4l2Device& device);

}  // namespace sightline
