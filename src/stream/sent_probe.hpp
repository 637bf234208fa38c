// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/gst.h>

#include <functional>
#include <memory>
#include <mutex>
#include <utility>

#include "sightline/base/time.hpp"
#include "stream/gst_ptr.hpp"
#include "stream/handover.hpp"

namespace sightline::stream {

/// Who hears how old an image is when its packets go to the network; shared with GStreamer's
/// threads, which may outlive who set it.
class SentReport {
 public:
  void set(std::function<void(Duration)> callback) {
    std::lock_guard lock(mutex_);
    callback_ = std::move(callback);
  }
  void tell(Duration age) const {
    std::lock_guard lock(mutex_);
    if (callback_) callback_(age);
  }

 private:
  mutable std::mutex mutex_;
  std::function<void(Duration)> callback_;
};
using SentReportPtr = std::shared_ptr<SentReport>;

/// Tells `report` of each image whose first packet leaves `payloader`. Time stamps are capture
/// times there (RtpClock).
inline void report_sent(GstElement* payloader, SentReportPtr report) {
  struct Seen {
    SentReportPtr report;
    GstClockTime pts = GST_CLOCK_TIME_NONE;
  };
  const auto look = [](GstPad* pad, GstPadProbeInfo* info, gpointer data) {
    const LibraryCall call(data);
    Seen& seen = UserData<Seen>::in(data);
    GstBuffer* buffer = nullptr;
    if (GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER_LIST) {
      GstBufferList* const list = GST_PAD_PROBE_INFO_BUFFER_LIST(info);
      if (gst_buffer_list_length(list) > 0) buffer = gst_buffer_list_get(list, 0);
    } else {
      buffer = GST_PAD_PROBE_INFO_BUFFER(info);
    }
    if (buffer == nullptr || pts_of(buffer) == seen.pts) return GST_PAD_PROBE_OK;
    seen.pts = pts_of(buffer);
    const GstObjectPtr<GstElement> element(gst_pad_get_parent_element(pad));
    const GstObjectPtr<GstClock> clock(element ? gst_element_get_clock(element.get()) : nullptr);
    if (!clock || !GST_CLOCK_TIME_IS_VALID(seen.pts)) return GST_PAD_PROBE_OK;
    const auto now = static_cast<int64_t>(gst_clock_get_time(clock.get()));
    const auto base = static_cast<int64_t>(gst_element_get_base_time(element.get()));
    seen.report->tell(Duration(now - base - static_cast<int64_t>(seen.pts)));
    return GST_PAD_PROBE_OK;
  };
  const GstObjectPtr<GstPad> pad(gst_element_get_static_pad(payloader, "src"));
  gst_pad_add_probe(
      pad.get(),
      static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
      +look, UserData<Seen>::make({std::move(report)}), UserData<Seen>::destroy);
}

}  // namespace sightline::stream
