// SPDX-License-Identifier: Apache-2.0
#include "stream/whep/fan_out.hpp"

#include <gst/app/gstappsrc.h>

#include "stream/handover.hpp"
#include "stream/packet_buffer.hpp"

namespace sightline::stream {
namespace {

/// Packets that may wait for a viewer's pipeline; more, and it skips to a key frame.
constexpr guint64 kMaxQueued = 8;

}  // namespace

void FanOut::push(const EncodedPacket& packet) {
  if (count_ == 0) return;
  bool lacks_keyframe = false;
  {
    std::lock_guard lock(mutex_);
    for (auto& [id, viewer] : viewers_) lacks_keyframe |= !send(viewer, packet);
  }
  if (lacks_keyframe) ask_for_keyframe();
}

bool FanOut::send(Viewer& viewer, const EncodedPacket& packet) {
  if (viewer.needs_keyframe && !packet.keyframe) return false;
  auto* source = GST_APP_SRC(viewer.source.get());
  const GstObjectPtr<GstClock> clock(gst_element_get_clock(viewer.source.get()));
  if (!clock || gst_app_src_get_current_level_buffers(source) >= kMaxQueued) {
    ++dropped_;
    viewer.needs_keyframe = true;
    return false;
  }
  viewer.needs_keyframe = false;
  GstBuffer* buffer = wrap_packet(packet.bytes);
  const uint64_t pts = viewer.clock.running_time(
      to_ns(packet.capture), static_cast<int64_t>(gst_clock_get_time(clock.get())),
      static_cast<int64_t>(gst_element_get_base_time(viewer.source.get())));
  set_times(buffer, pts, GST_CLOCK_TIME_NONE);
  if (!packet.keyframe) mark_as_delta(buffer);
  gst_app_src_push_buffer(source, buffer);
  return true;
}

uint64_t FanOut::dropped() const {
  std::lock_guard lock(mutex_);
  return dropped_;
}

void FanOut::on_keyframe_wanted(std::function<void()> callback) {
  std::lock_guard lock(mutex_);
  keyframe_callback_ = std::move(callback);
}

void FanOut::add(const std::string& id, GstElement* source) {
  Viewer viewer;
  viewer.source.reset(GST_ELEMENT(gst_object_ref(source)));
  {
    std::lock_guard lock(mutex_);
    viewers_.insert_or_assign(id, std::move(viewer));
    count_ = static_cast<int>(viewers_.size());
  }
  ask_for_keyframe();
}

void FanOut::remove(const std::string& id) {
  std::map<std::string, Viewer>::node_type gone;  // given back outside the lock
  std::lock_guard lock(mutex_);
  gone = viewers_.extract(id);
  count_ = static_cast<int>(viewers_.size());
}

void FanOut::ask_for_keyframe() {
  std::function<void()> callback;
  {
    std::lock_guard lock(mutex_);
    callback = keyframe_callback_;
  }
  if (callback) callback();
}

}  // namespace sightline::stream
