// SPDX-License-Identifier: Apache-2.0
#include "v4l2_error.hpp"

#include <cerrno>
#include <cstring>
#include <string_view>

namespace sightline {
namespace {

std::string_view doing(V4l2Step step) {
  switch (step) {
    case V4l2Step::kOpen:
      return "cannot open";
    case V4l2Step::kFormat:
      return "cannot set the picture format of";
    case V4l2Step::kBuffers:
      return "cannot get buffers from";
    case V4l2Step::kStart:
      return "cannot start streaming from";
    case V4l2Step::kCapture:
      return "capturing failed from";
    case V4l2Step::kControl:
      return "cannot set a control of";
    case V4l2Step::kQuery:
      return "cannot ask the capabilities of";
  }
  return "cannot use";
}

struct Advice {
  ErrorCode code;
  std::string_view text;
};

Advice advice_for(V4l2Step step, int number) {
  switch (number) {
    case ENOENT:
      return {ErrorCode::kUnavailable,
              "there is no such device; check that the camera is plugged in and compare the name "
              "with `sightline cameras`"};
    case ENODEV:
    case ENXIO:
      return {
          ErrorCode::kUnavailable,
          "the camera is gone (unplugged, reset or its driver unloaded); check cable and power"};
    case EBUSY:
      return {ErrorCode::kUnavailable,
              "another program is using the camera; `fuser -v` with the device's path shows which"};
    case EACCES:
    case EPERM:
      if (step == V4l2Step::kControl) {
        return {ErrorCode::kInvalidInput,
                "the control is read-only or switched off by an automatic mode; set that mode to "
                "manual first"};
      }
      return {ErrorCode::kUnavailable,
              "permission denied; add the user to the group `video` (or DeviceAllow= of the "
              "service) and log in again"};
    case ENOSPC:
      return {ErrorCode::kUnavailable,
              "the USB bus has no bandwidth left for it; use MJPEG, a smaller size or a lower "
              "rate, or plug the cameras into different USB controllers"};
    case EIO:
    case EPIPE:
    case EPROTO:
      return step == V4l2Step::kStart
                 ? Advice{ErrorCode::kIo,
                          "the camera did not obey; unplug it for a moment, try another cable or "
                          "port, see the kernel's log"}
                 : Advice{ErrorCode::kIo,
                          "the transfer broke down; suspect cable, hub or power, see the kernel's "
                          "log"};
    case ETIMEDOUT:
      return {ErrorCode::kTimeout,
              "the camera does not answer; unplug it for a moment, see the kernel's log"};
    case EINVAL:
      switch (step) {
        case V4l2Step::kFormat:
          return {ErrorCode::kInvalidInput,
                  "the driver refuses the settings; `sightline cameras` lists those it has"};
        case V4l2Step::kControl:
          return {ErrorCode::kInvalidInput, "the driver refuses the value"};
        case V4l2Step::kQuery:
          return {ErrorCode::kUnavailable, "this is no V4L2 camera"};
        default:
          return {ErrorCode::kIo,
                  "the driver refuses the request; opening the camera again usually helps"};
      }
    case ERANGE:
      return {ErrorCode::kInvalidInput, "the value is out of range"};
    case ENOTTY:
      return {ErrorCode::kUnavailable, "this is no V4L2 camera, or its driver lacks the function"};
    case ENOMEM:
      return {ErrorCode::kIo,
              "the kernel has no memory for it; use fewer buffers or a smaller size"};
    default:
      return {ErrorCode::kIo, "the driver refuses; see the kernel's log"};
  }
}

}  // namespace

Error v4l2_error(V4l2Step step, int number, const std::string& where, const std::string& device) {
  const Advice advice = advice_for(step, number);
  return make_error(advice.code, where, "{} {}: {} ({})", doing(step), device, advice.text,
                    std::strerror(number));
}

}  // namespace sightline
