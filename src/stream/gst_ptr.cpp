// SPDX-License-Identifier: Apache-2.0
#include "stream/gst_ptr.hpp"

namespace sightline::stream {

Status start_gstreamer() {
  static const Status status = []() -> Status {
    GError* raw = nullptr;
    if (gst_init_check(nullptr, nullptr, &raw)) return {};
    const GErrorPtr error(raw);
    return make_error(ErrorCode::kUnavailable, "gstreamer",
                      "GStreamer does not start: {}; is libgstreamer1.0-0 installed completely?",
                      text_of(error));
  }();
  return status;
}

bool set_if_present(GstElement* element, const char* property, const std::string& value) {
  if (!g_object_class_find_property(G_OBJECT_GET_CLASS(element), property)) return false;
  gst_util_set_object_arg(G_OBJECT(element), property, value.c_str());
  return true;
}

std::string text_of_error_message(GstMessage* message) {
  GError* raw = nullptr;
  gchar* raw_debug = nullptr;
  gst_message_parse_error(message, &raw, &raw_debug);
  const GErrorPtr error(raw);
  const GStringPtr debug(raw_debug);
  return debug ? fmt::format("{} ({})", text_of(error), debug.get()) : text_of(error);
}

}  // namespace sightline::stream
