// SPDX-License-Identifier: Apache-2.0
#include "stream/encoder_probes.hpp"

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>

#include "sightline/base/log.hpp"
#include "stream/encoder_choice.hpp"

namespace sightline::stream {
namespace {

constexpr Duration kTurn = std::chrono::milliseconds(20);

// On a thread of GStreamer's own: a driver that hangs must not take the caller along.
void set_state(GstElement* pipeline, GstState state) {
  gst_element_call_async(
      pipeline,
      [](GstElement* self, gpointer to) {
        gst_element_set_state(self, static_cast<GstState>(GPOINTER_TO_INT(to)));
      },
      GINT_TO_POINTER(state), nullptr);
}

/// A running pipeline that was given one gray image and the end.
GstObjectPtr<GstElement> begin(const std::string& element) {
  EncoderOptions options;
  options.width = 320;
  options.height = 240;
  options.bitrate_kbps = 500;
  auto built = build_encoder_pipeline(element, options);
  if (!built) {
    log::debug("encoder {}: {}", element, built.error().message());
    return nullptr;
  }
  GstObjectPtr<GstElement> pipeline = *std::move(built);
  const auto source = element_of(pipeline.get(), "src");
  const size_t size = 320 * 240 * 3 / 2;
  GstBuffer* image = gst_buffer_new_allocate(nullptr, size, nullptr);
  gst_buffer_memset(image, 0, 128, size);
  GST_BUFFER_PTS(image) = 0;
  gst_app_src_push_buffer(GST_APP_SRC(source.get()), image);
  gst_app_src_end_of_stream(GST_APP_SRC(source.get()));
  set_state(pipeline.get(), GST_STATE_PLAYING);
  return pipeline;
}

/// True: it gave a packet; false: it ended or failed without one.
std::optional<bool> answer_of(GstElement* pipeline, Duration timeout) {
  const auto sink = element_of(pipeline, "sink");
  const GstObjectPtr<GstBus> bus(gst_element_get_bus(pipeline));
  const Time deadline = MonotonicClock::now() + timeout;
  do {
    const Duration turn = timeout > Duration(0) ? kTurn : Duration(0);
    const GstMiniPtr<GstSample> sample(gst_app_sink_try_pull_sample(
        GST_APP_SINK(sink.get()), static_cast<GstClockTime>(turn.count())));
    if (sample) return true;
    const GstMiniPtr<GstMessage> message(gst_bus_pop_filtered(
        bus.get(), static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
    if (!message) continue;
    if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) {
      log::debug("encoder probe: {}", text_of_error_message(message.get()));
    }
    return false;
  } while (MonotonicClock::now() < deadline);
  return std::nullopt;
}

// Stopping what is stuck could hang as well: it is left to its driver, on purpose.
void leave(std::vector<GstObjectPtr<GstElement>> pipelines) {
  for (GstObjectPtr<GstElement>& pipeline : pipelines) {
    set_state(pipeline.get(), GST_STATE_NULL);
    (void)pipeline.release();
  }
}

}  // namespace

bool EncoderProbes::works(const std::string& element) {
  const std::lock_guard lock(mutex_);
  const auto [found, is_new] = entries_.try_emplace(element);
  Entry& entry = found->second;
  if (entry.works) return *entry.works;
  entry.works = is_new ? ask_first(element, entry) : ask_again(element, entry);
  if (entry.works) {
    log::debug("H.264 encoder {}: {}", element, *entry.works ? "works" : "not usable here");
  }
  return entry.works.value_or(false);
}

std::optional<bool> EncoderProbes::ask_first(const std::string& element, Entry& entry) {
  if (!start_gstreamer()) return false;
  const GstObjectPtr<GstElementFactory> factory(gst_element_factory_find(element.c_str()));
  if (!factory) return false;
  GstObjectPtr<GstElement> pipeline = begin(element);
  if (!pipeline) return false;
  entry.asked = MonotonicClock::now();
  const auto answer = answer_of(pipeline.get(), options_.timeout);
  if (answer) {
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    return answer;
  }
  log::warning("encoder {} did not answer within {} s: not used for now", element,
               to_seconds(options_.timeout));
  entry.late.push_back(std::move(pipeline));
  entry.wait = options_.first_wait;
  entry.next = MonotonicClock::now() + entry.wait;
  return std::nullopt;
}

std::optional<bool> EncoderProbes::ask_again(const std::string& element, Entry& entry) {
  std::optional<bool> answer;
  for (const auto& pipeline : entry.late) {
    const auto one = answer_of(pipeline.get(), Duration(0));
    if (one) answer = answer.value_or(false) || *one;
  }
  const Time now = MonotonicClock::now();
  if (answer) {
    log::warning("encoder {} answered after {:.0f} s or more: it {}", element,
                 to_seconds(options_.timeout),
                 *answer ? "works, and is used from now on" : "does not work");
    leave(std::exchange(entry.late, {}));
    return answer;
  }
  if (now < entry.next || entry.late.size() >= options_.pipelines) return std::nullopt;
  entry.wait *= options_.wait_factor;
  entry.next = now + entry.wait;
  // Not waited for: who asks has images to draw.
  log::info("encoder {} has not answered for {:.0f} s: tried once more", element,
            to_seconds(now - entry.asked));
  if (auto pipeline = begin(element)) entry.late.push_back(std::move(pipeline));
  return std::nullopt;
}

}  // namespace sightline::stream
