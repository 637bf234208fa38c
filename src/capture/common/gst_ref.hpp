// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/gst.h>

#include <memory>

// GStreamer hands memory from thread to thread under locks that the thread sanitizer cannot see in
// Debian's uninstrumented builds. These marks tell it where; they cost nothing in other builds.
#if defined(__SANITIZE_THREAD__)
#define SL_CAPTURE_UNDER_TSAN 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define SL_CAPTURE_UNDER_TSAN 1
#endif
#endif
#ifdef SL_CAPTURE_UNDER_TSAN
extern "C" {
void __tsan_acquire(void* address);
void __tsan_release(void* address);
}
#endif

namespace sightline::capture {

/// What was done before under the same key, on whatever thread, comes before what follows.
class GstCall {
 public:
  explicit GstCall([[maybe_unused]] const void* key) {
#ifdef SL_CAPTURE_UNDER_TSAN
    key_ = const_cast<void*>(key);
    __tsan_acquire(key_);
#endif
  }
  ~GstCall() {
#ifdef SL_CAPTURE_UNDER_TSAN
    __tsan_release(key_);
#endif
  }
  GstCall(const GstCall&) = delete;
  GstCall& operator=(const GstCall&) = delete;

#ifdef SL_CAPTURE_UNDER_TSAN

 private:
  void* key_;
#endif
};

struct GstUnref {
  void operator()(GstObject* object) const { gst_object_unref(object); }
  void operator()(GstElement* element) const { gst_object_unref(element); }
  void operator()(GstPad* pad) const { gst_object_unref(pad); }
  void operator()(GstBus* bus) const { gst_object_unref(bus); }
  void operator()(GstClock* clock) const { gst_object_unref(clock); }
  void operator()(GstSample* sample) const { gst_sample_unref(sample); }
  void operator()(GError* error) const { g_error_free(error); }
  void operator()(gchar* text) const { g_free(text); }
};
/// Owns one reference of a GStreamer thing.
template <typename T>
using GstRef = std::unique_ptr<T, GstUnref>;

/// A buffer's bytes, readable for this object's life; empty if it cannot be mapped.
class MappedBuffer {
 public:
  explicit MappedBuffer(GstBuffer* buffer) : buffer_(buffer) {
    mapped_ = buffer != nullptr && gst_buffer_map(buffer, &map_, GST_MAP_READ);
  }
  ~MappedBuffer() {
    if (mapped_) gst_buffer_unmap(buffer_, &map_);
  }
  MappedBuffer(const MappedBuffer&) = delete;
  MappedBuffer& operator=(const MappedBuffer&) = delete;
  const uint8_t* data() const { return mapped_ ? map_.data : nullptr; }
  size_t size() const { return mapped_ ? map_.size : 0; }

 private:
  GstBuffer* buffer_;
  GstMapInfo map_{};
  bool mapped_ = false;
};

}  // namespace sightline::capture
