// SPDX-License-Identifier: Apache-2.0
// GStreamer's own overlay elements in a pipeline of I420 frames.
#include <gst/gst.h>

#include "compare.hpp"
#include "sightline/base/time.hpp"

namespace sightline::compare {
namespace {

/// CPU of a pipeline from start to its end, a frame; nothing if an element is not installed.
std::optional<double> run(const std::string& elements, int width, int height, int frames) {
  const std::string text = fmt::format(
      "videotestsrc pattern=black num-buffers={} ! video/x-raw,format=I420,width={},height={},"
      "framerate=30/1 ! {} ! video/x-raw,format=I420 ! fakesink sync=false",
      frames, width, height, elements);
  GError* error = nullptr;
  GstElement* pipeline =
      gst_parse_launch_full(text.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (pipeline == nullptr) {
    g_clear_error(&error);
    return std::nullopt;
  }
  const double start = process_cpu_ms();
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* end = gst_bus_timed_pop_filtered(
      bus, 120 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  const bool done = end != nullptr && GST_MESSAGE_TYPE(end) == GST_MESSAGE_EOS;
  if (end != nullptr) gst_message_unref(end);
  gst_object_unref(bus);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(pipeline);
  if (!done) return std::nullopt;
  return (process_cpu_ms() - start) / frames;
}

}  // namespace

std::vector<ElementCost> gstreamer_costs(int width, int height, int frames) {
  gst_init(nullptr, nullptr);
  const char* outline =
      "data=\"<svg viewBox='0 0 1280 720'><circle cx='640' cy='360' r='128' fill='none' "
      "stroke='lime' stroke-width='2'/></svg>\"";
  const std::vector<std::pair<std::string, std::string>> pipelines = {
      {"textoverlay: two lines of text, nothing else", "textoverlay text=\"carton\\n1.26 m\""},
      {"cairooverlay that draws nothing, with its conversions",
       "videoconvert ! video/x-raw,format=BGRA ! cairooverlay ! videoconvert"},
      {"rsvgoverlay: one circle, with its conversions",
       fmt::format("videoconvert ! rsvgoverlay {} ! videoconvert", outline)}};
  const auto base = run("identity", width, height, frames);
  std::vector<ElementCost> costs;
  for (const auto& [name, elements] : pipelines) {
    const auto with = run(elements, width, height, frames);
    ElementCost cost{"GStreamer " + name, std::nullopt};
    if (base && with) cost.cpu_ms = *with - *base;
    costs.push_back(cost);
  }
  return costs;
}

}  // namespace sightline::compare
