// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/gst.h>

#include <utility>

// GLib and GStreamer hand memory from thread to thread under locks of their own, which the thread
// sanitizer cannot see in Debian's uninstrumented builds. These marks tell it where that happens,
// so that our code stays checked on both sides. They cost nothing in other builds.

#if defined(__SANITIZE_THREAD__)
#define SL_UNDER_TSAN 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define SL_UNDER_TSAN 1
#endif
#endif

#ifdef SL_UNDER_TSAN
extern "C" {
void __tsan_acquire(void* address);
void __tsan_release(void* address);
}
#define SL_UNCHECKED_BY_TSAN __attribute__((no_sanitize("thread"), noinline))
#else
#define SL_UNCHECKED_BY_TSAN
#endif

namespace sightline::stream {

/// Everything done so far by this thread comes before what follows taken_from_library(key).
inline void handed_to_library([[maybe_unused]] const void* key) {
#ifdef SL_UNDER_TSAN
  __tsan_release(const_cast<void*>(key));
#endif
}
inline void taken_from_library([[maybe_unused]] const void* key) {
#ifdef SL_UNDER_TSAN
  __tsan_acquire(const_cast<void*>(key));
#endif
}

/// For the length of a callback: `key` was handed over before, and is handed on at the end.
class LibraryCall {
 public:
  explicit LibraryCall(const void* key) : key_(key) { taken_from_library(key_); }
  ~LibraryCall() { handed_to_library(key_); }
  LibraryCall(const LibraryCall&) = delete;
  LibraryCall& operator=(const LibraryCall&) = delete;

 private:
  const void* key_;
};

/// A value that a C library keeps as user data and destroys through a callback.
template <typename T>
struct UserData {
  static gpointer make(T value) {
    auto* data = new T(std::move(value));
    handed_to_library(data);
    return data;
  }
  static T& in(gpointer data) { return *static_cast<T*>(data); }
  static void destroy(gpointer data) {
    taken_from_library(data);
    delete static_cast<T*>(data);
  }
  static void destroy_closure(gpointer data, GClosure*) { destroy(data); }
};

/// Inline reads and writes of GStreamer's own structures, recycled between threads inside it.
SL_UNCHECKED_BY_TSAN inline void set_times(GstBuffer* buffer, GstClockTime pts,
                                           GstClockTime duration) {
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = duration;
}
SL_UNCHECKED_BY_TSAN inline void mark_as_delta(GstBuffer* buffer) {
  GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DELTA_UNIT);
}
SL_UNCHECKED_BY_TSAN inline GstClockTime pts_of(GstBuffer* buffer) {
  return GST_BUFFER_PTS(buffer);
}
SL_UNCHECKED_BY_TSAN inline bool is_delta(GstBuffer* buffer) {
  return GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_DELTA_UNIT);
}

}  // namespace sightline::stream
