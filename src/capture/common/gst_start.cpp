// SPDX-License-Identifier: Apache-2.0
#include "capture/common/gst_start.hpp"

#include "capture/common/gst_ref.hpp"

namespace sightline::capture {

Status start_gstreamer_for_capture() {
  static const Status status = []() -> Status {
    GError* raw = nullptr;
    if (gst_init_check(nullptr, nullptr, &raw)) return {};
    const GstRef<GError> error(raw);
    return make_error(ErrorCode::kUnavailable, "gstreamer", "GStreamer does not start: {}",
                      error ? error->message : "no reason given");
  }();
  return status;
}

}  // namespace sightline::capture
