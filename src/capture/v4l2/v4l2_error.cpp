// SPDX-License-Identifier: Apache-2.0
#include "capture/v4l2/v4l2_error.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <optional>
#include <string_view>

namespace sightline::capture {
namespace {

std::string_view doing(V4l2Step step) {
  switch (step) {
    case V4l2Step::kOpen:
      return "cannot open";
    case V4l2Step::kFormat:
      return "cannot set the image format of";
    case V4l2Step::kBuffers:
      return "cannot get buffers from";
    case V4l2Step::kStart:
      return "cannot start streaming from";
    case V4l2Step::kCapture:
      return "capturing failed from";
    case V4l2Step::kControl:
      return "cannot set a control of";
    case V4l2Step::kReadControl:
      return "cannot read a control of";
    case V4l2Step::kQuery:
      return "cannot ask the capabilities of";
  }
  return "cannot use";
}

struct Advice {
  int number;
  std::optional<V4l2Step> step;  // nullopt: whatever was being done
  ErrorCode code;
  std::string_view text;
};

constexpr std::string_view kGone =
    "the camera is gone (unplugged, reset or its driver unloaded); check cable and power";
constexpr std::string_view kForbidden =
    "permission denied; add the user to the group `video` (or DeviceAllow= of the service) and log "
    "in again";
constexpr std::string_view kLocked =
    "the control is read-only or switched off by an automatic mode; set that mode to manual first";
constexpr std::string_view kDisobeyed =
    "the camera did not obey; unplug it for a moment, try another cable or port, see the kernel's "
    "log";
constexpr std::string_view kBroken =
    "the transfer broke down; suspect cable, hub or power, see the kernel's log";

using enum ErrorCode;
constexpr std::nullopt_t kAny = std::nullopt;

// The first that fits counts.
constexpr Advice kAdvice[] = {
    {ENOENT, kAny, kUnavailable,
     "there is no such device; check that the camera is plugged in and compare the name with "
     "`sightline cameras`"},
    {ENODEV, kAny, kUnavailable, kGone},
    {ENXIO, kAny, kUnavailable, kGone},
    {EBUSY, kAny, kUnavailable,
     "another program is using the camera; `fuser -v` with the device's path shows which"},
    {EACCES, V4l2Step::kControl, kInvalidInput, kLocked},
    {EPERM, V4l2Step::kControl, kInvalidInput, kLocked},
    {EACCES, kAny, kUnavailable, kForbidden},
    {EPERM, kAny, kUnavailable, kForbidden},
    {ENOSPC, kAny, kUnavailable,
     "the USB bus has no bandwidth left for it; use MJPEG, a smaller size or a lower rate, or plug "
     "the cameras into different USB controllers"},
    {EIO, V4l2Step::kStart, kIo, kDisobeyed},
    {EPIPE, V4l2Step::kStart, kIo, kDisobeyed},
    {EPROTO, V4l2Step::kStart, kIo, kDisobeyed},
    {EIO, kAny, kIo, kBroken},
    {EPIPE, kAny, kIo, kBroken},
    {EPROTO, kAny, kIo, kBroken},
    {ETIMEDOUT, kAny, kTimeout,
     "the camera does not answer; unplug it for a moment, see the kernel's log"},
    {EINVAL, V4l2Step::kFormat, kInvalidInput,
     "the driver refuses the settings; `sightline cameras` lists those it has"},
    {EINVAL, V4l2Step::kControl, kInvalidInput, "the driver refuses the value"},
    {EINVAL, V4l2Step::kQuery, kUnavailable, "this is no V4L2 camera"},
    {EINVAL, kAny, kIo, "the driver refuses the request; opening the camera again usually helps"},
    {ERANGE, kAny, kInvalidInput, "the value is out of range"},
    {ENOTTY, kAny, kUnavailable, "this is no V4L2 camera, or its driver lacks the function"},
    {ENOMEM, kAny, kIo, "the kernel has no memory for it; use fewer buffers or a smaller size"},
};
constexpr Advice kOther{0, kAny, kIo, "the driver refuses; see the kernel's log"};

const Advice& advice_for(V4l2Step step, int number) {
  const auto* const found =
      std::find_if(std::begin(kAdvice), std::end(kAdvice), [&](const Advice& advice) {
        return advice.number == number && advice.step.value_or(step) == step;
      });
  return found == std::end(kAdvice) ? kOther : *found;
}

}  // namespace

Error v4l2_error(V4l2Step step, int number, const std::string& where, const std::string& device) {
  const Advice& advice = advice_for(step, number);
  return make_error(advice.code, where, "{} {}: {} ({})", doing(step), device, advice.text,
                    std::strerror(number));
}

}  // namespace sightline::capture
