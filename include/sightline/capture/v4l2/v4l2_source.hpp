// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/capture/common/capture_counters.hpp"
#include "sightline/model/seams.hpp"

namespace sightline {

struct DeviceInfo;

/// A number, or the name of a menu entry ("manual_mode", as `sightline cameras` prints it).
using V4l2ControlValue = std::variant<int64_t, std::string>;

struct V4l2Options {
  /// Which camera: a path (/dev/v4l/by-id/..., /dev/v4l/by-path/..., /dev/video0), or one or more
  /// of "serial:TEXT", "usb:PORT" (as in "usb:1-2.3") and "card:NAME" with commas between. All that
  /// are given must hold: with "usb:1-2,serial:A0" a camera of another serial number at that port
  /// is refused as a mismatch. A bare video number may become another camera after a replug.
  std::string device;
  /// "auto" (an uncompressed format that reaches size and rate, else MJPEG), a name (YUYV, NV12,
  /// I420, MJPEG, GREY, Y10, RGB24, SRGGB10P, ...) or a driver's four characters.
  std::string format = "auto";
  int width = 0;  ///< 0, both: what the camera is set to
  int height = 0;
  double rate_hz = 0;  ///< 0: what the camera is set to
  int buffers = 4;     ///< 4..6 driver buffers
  /// By the name that `v4l2-ctl -l` prints ("exposure_time_absolute"). Set before streaming,
  /// switches and menus first, and read back; what the camera changed is logged.
  std::map<std::string, V4l2ControlValue> controls;
  /// Silence after which the camera counts as stalled; 0: max(1 s, 5 frame periods). The first
  /// frame may take five times as long.
  Duration frame_timeout{0};
  uint32_t epoch = 0;                         ///< of this opening; see FrameInfo::epoch
  std::shared_ptr<CaptureCounters> counters;  ///< null: counts for itself

  bool operator==(const V4l2Options&) const = default;
};

/// Opens a V4L2 camera, sets it up and starts streaming. Frames hold the driver's own buffers
/// (mapped; also as DMA-BUF where the driver exports them), which go back when the last reference
/// is dropped, from any thread; a reader that holds too many gets copies. Raw formats are converted
/// on demand; MJPEG, H264 and Bayer frames come decoded, MJPEG with the compressed payload beside
/// the image. Capture times are the middle of the exposure, from the kernel's stamps, with a
/// bound.
///
/// Damaged frames are dropped and counted, gaps are reported in dropped_before. next() waits in
/// slices of at most 100 ms, so a stop request is seen soon. Its errors say what happened
/// (unplugged, transfer error, stalled, ...) and what to do; then destroy the source and open
/// again. One thread calls next(). `name` is the camera's name in messages.
///
/// Errors: kUnavailable (not there, in use, no permission), kInvalidInput (format, size or control
/// that the camera has not; the text lists those it has; identity mismatch), kIo.
/// Takes as long as the driver does with each call, which is marked as Waiting; after `stop` it
/// gives up between two of them (kUnavailable).
Result<std::unique_ptr<FrameSource>> open_v4l2_source(const V4l2Options& options, CameraId camera,
                                                      const std::string& name,
                                                      const std::stop_token& stop = {});

/// Every V4L2 capture device, ordered by path. Cameras that cannot be opened are listed with the
/// reason. Takes some milliseconds a camera and does not disturb one that streams. Any thread; does
/// not fail: without cameras the list is empty.
Result<std::vector<DeviceInfo>> list_v4l2();

}  // namespace sightline
