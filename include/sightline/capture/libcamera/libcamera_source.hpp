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
#include "sightline/capture/common/device_info.hpp"
#include "sightline/model/seams.hpp"

namespace sightline {

/// A number (0 and 1 for switches), or a text: the name of a choice ("continuous"), or two numbers
/// ("1.8 1.5").
using LibcameraControlValue = std::variant<int64_t, double, std::string>;

/// One camera of libcamera. Zero or empty: the camera's own setting stays.
struct LibcameraOptions {
  /// As list_libcamera() has it. It names the place of the camera (port, or node of the board's
  /// firmware) and, for USB, maker and product: another product at that port has another id.
  std::string id;
  /// "auto" (an uncompressed format of this size, else MJPEG), or a name as for V4L2 cameras: YUYV,
  /// NV12, YUV420, RGB24, BGR24, GREY, Y10, SRGGB10P, MJPEG, ...; libcamera's own (R8,
  /// SRGGB10_CSI2P) will do too.
  std::string format = "auto";
  int width = 0, height = 0;  ///< both or neither
  double rate_hz = 0;         ///< by FrameDurationLimits, where the camera has it
  int buffers = 4;            ///< 4..16; some cameras take another number
  /// By libcamera's names: AeEnable, ExposureTime (us), AnalogueGain, AwbEnable, Brightness,
  /// AfMode, ... Read back from the metadata of the first frames where the camera tells them; what
  /// it changed is logged.
  std::map<std::string, LibcameraControlValue> controls;
  /// Silence after which the camera counts as stalled; 0: max(1 s, 5 frame periods). The first
  /// frame may take five times as long.
  Duration frame_timeout{0};
  uint32_t epoch = 0;                         ///< of this opening; see FrameInfo::epoch
  std::shared_ptr<CaptureCounters> counters;  ///< null: counts for itself

  bool operator==(const LibcameraOptions&) const = default;
};

/// Opens, configures and starts the camera. Frames hold libcamera's own buffers (mapped once; also
/// as DMA-BUF), whose request is queued again when the last reference is dropped, from any thread;
/// a reader that holds too many gets copies. MJPEG and Bayer frames come decoded.
///
/// Capture times: SensorTimestamp is the start of the exposure of the first row. libcamera
/// documents CLOCK_BOOTTIME, what the kernel's drivers give is CLOCK_MONOTONIC; the two differ once
/// the host has slept. Whichever of them the stamp fits is taken. With the frame's ExposureTime the
/// middle of exposure is known to half a millisecond, without it to a quarter of a period.
///
/// next() waits in slices of at most 100 ms. Its errors mean: destroy the source and open again.
/// One thread calls next(). Any number of cameras may be open; the process has one camera manager,
/// from the first use to its end. Errors name the camera: kUnavailable (not there, in use, "built
/// without libcamera"), kInvalidInput (format, size or control that it has not), kIo, kTimeout.
/// Opening is marked as Waiting; libcamera cannot be interrupted, `stop` counts only before it
/// begins.
Result<std::unique_ptr<FrameSource>> open_libcamera_source(const LibcameraOptions& options,
                                                           CameraId camera, const std::string& name,
                                                           const std::stop_token& stop = {});

/// All cameras of libcamera with their formats. Webcams are among them, by another id than V4L2's.
/// Any thread. kUnavailable: libcamera does not start, or is not in this build.
Result<std::vector<DeviceInfo>> list_libcamera();

/// "libcamera 0.0.3", or "built without libcamera".
std::string libcamera_version();

}  // namespace sightline
