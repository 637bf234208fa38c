// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glib-object.h>
#include <gst/gst.h>

#include <memory>
#include <string>

#include "sightline/base/result.hpp"

namespace sightline::stream {

/// Starts GStreamer, once per process; the same answer for all callers. Any thread.
Status start_gstreamer();

struct UnrefGstObject {
  void operator()(void* object) const { gst_object_unref(object); }
};
struct UnrefGObject {
  void operator()(void* object) const { g_object_unref(object); }
};
struct UnrefMiniObject {
  template <typename T>
  void operator()(T* object) const {
    gst_mini_object_unref(GST_MINI_OBJECT_CAST(object));
  }
};
struct FreeGError {
  void operator()(GError* error) const { g_error_free(error); }
};
struct FreeGlibString {
  void operator()(gchar* text) const { g_free(text); }
};
struct UnrefMainContext {
  void operator()(GMainContext* context) const { g_main_context_unref(context); }
};
struct UnrefSource {
  void operator()(GSource* source) const { g_source_unref(source); }
};
struct DestroySource {
  void operator()(GSource* source) const {
    g_source_destroy(source);
    g_source_unref(source);
  }
};

/// For GstElement, GstBus, GstPad, GstClock ...
template <typename T>
using GstObjectPtr = std::unique_ptr<T, UnrefGstObject>;
/// For plain GObjects (gst-rtsp-server's classes).
template <typename T>
using GObjectPtr = std::unique_ptr<T, UnrefGObject>;
/// For GstBuffer, GstSample, GstCaps, GstMessage ...
template <typename T>
using GstMiniPtr = std::unique_ptr<T, UnrefMiniObject>;
using GErrorPtr = std::unique_ptr<GError, FreeGError>;
using GStringPtr = std::unique_ptr<gchar, FreeGlibString>;
using GMainContextPtr = std::unique_ptr<GMainContext, UnrefMainContext>;
using GSourcePtr = std::unique_ptr<GSource, DestroySource>;

/// Text of an optional GError.
inline std::string text_of(const GErrorPtr& error) {
  return error ? error->message : "no reason given";
}

/// Sets one property from text, as gst-launch does; false if the element has no such property.
bool set_if_present(GstElement* element, const char* property, const std::string& value);

/// The whole of an error message on a bus, for a person.
std::string text_of_error_message(GstMessage* message);

}  // namespace sightline::stream
