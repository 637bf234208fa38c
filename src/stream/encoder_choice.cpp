// SPDX-License-Identifier: Apache-2.0
#include "stream/encoder_choice.hpp"

#include <vector>

#include "stream/encoder_probes.hpp"

namespace sightline::stream {
namespace {

bool is_software(const std::string& element) {
  return element == "x264enc" || element == "openh264enc";
}

/// Low delay, constant bitrate, no B frames: each element spells it in its own way, and not every
/// version of it knows every property.
void configure(GstElement* encoder, const std::string& element, const EncoderOptions& options) {
  const std::string kbps = std::to_string(options.bitrate_kbps);
  const std::string bps = std::to_string(options.bitrate_kbps * 1000);
  const std::string interval = std::to_string(options.keyframe_interval);
  const auto set = [encoder](const char* property, const std::string& value) {
    set_if_present(encoder, property, value);
  };
  if (element == "x264enc") {
    set("speed-preset", "ultrafast");
    set("tune", "zerolatency");
    set("threads", "1");  // the default makes frame threads: two frames of delay
    set("bframes", "0");
    set("byte-stream", "true");
    set("bitrate", kbps);
    set("key-int-max", interval);
  } else if (element == "openh264enc") {
    set("usage-type", "camera");
    set("complexity", "low");
    set("rate-control", "bitrate");
    set("enable-frame-skip", "false");
    set("multi-thread", "1");
    set("bitrate", bps);
    set("gop-size", interval);
  } else if (element == "v4l2h264enc") {
    set("extra-controls",
        fmt::format("controls,video_bitrate={},h264_i_frame_period={},repeat_sequence_header=1",
                    bps, interval));
  } else if (element == "nvh264enc") {
    set("preset", "low-latency-hp");
    set("rc-mode", "cbr");
    set("zerolatency", "true");
    set("bframes", "0");
    set("bitrate", kbps);
    set("gop-size", interval);
  } else {  // the VA family, and whatever the user prefers
    set("rate-control", "cbr");
    set("bitrate", kbps);
    set("b-frames", "0");
    set("max-bframes", "0");
    set("ref-frames", "1");
    set("key-int-max", interval);
    set("keyframe-period", interval);
  }
}

std::string input_caps(const EncoderOptions& options) {
  int numerator = 30, denominator = 1;
  gst_util_double_to_fraction(options.rate_hz, &numerator, &denominator);
  return fmt::format(
      "video/x-raw,format=I420,width={},height={},framerate={}/{},pixel-aspect-ratio=1/1,"
      "interlace-mode=progressive,colorimetry=bt601",
      options.width, options.height, numerator, denominator);
}

}  // namespace

GstObjectPtr<GstElement> element_of(GstElement* pipeline, const char* name) {
  GstElement* element = gst_bin_get_by_name(GST_BIN(pipeline), name);
  SL_CHECK(element != nullptr, name);
  return GstObjectPtr<GstElement>(element);
}

Result<GstObjectPtr<GstElement>> build_encoder_pipeline(const std::string& element,
                                                        const EncoderOptions& options) {
  SL_RETURN_IF_ERROR(start_gstreamer());
  // Hardware wants NV12, some drivers other layouts; software encoders take our planes as they are.
  const std::string convert = is_software(element) ? "" : "videoconvert ! ";
  const std::string level = element == "v4l2h264enc" ? ",level=(string)4" : "";
  const std::string text = fmt::format(
      "appsrc name=src is-live=true format=time max-bytes=0 max-buffers=0 max-time=0 caps=\"{}\" ! "
      "{}{} name=enc ! video/x-h264,profile=constrained-baseline{} ! "
      "h264parse config-interval=-1 ! video/x-h264,stream-format=byte-stream,alignment=au ! "
      "appsink name=sink sync=false async=false enable-last-sample=false",
      input_caps(options), convert, element, level);
  GError* raw = nullptr;
  GstElement* launched =
      gst_parse_launch_full(text.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &raw);
  const GErrorPtr error(raw);
  if (launched == nullptr) {
    return make_error(ErrorCode::kUnavailable, element,
                      "GStreamer cannot build the encoder's pipeline: {}", text_of(error));
  }
  GstObjectPtr<GstElement> pipeline(GST_ELEMENT(gst_object_ref_sink(launched)));
  configure(element_of(pipeline.get(), "enc").get(), element, options);
  return pipeline;
}

Result<std::string> choose_encoder(const EncoderOptions& options, const std::string& camera_name) {
  SL_RETURN_IF_ERROR(start_gstreamer());
  const std::span<const std::string> candidates =
      options.prefer.empty() ? known_h264_encoders() : std::span(options.prefer);
  std::string tried;
  for (const std::string& element : candidates) {
    if (h264_encoder_works(element)) return element;
    tried += tried.empty() ? element : ", " + element;
  }
  return make_error(ErrorCode::kUnavailable, camera_name,
                    "no H.264 encoder works here (tried {}); install the Debian packages "
                    "gstreamer1.0-plugins-ugly (x264enc) and gstreamer1.0-plugins-bad (h264parse, "
                    "openh264enc)",
                    tried);
}

}  // namespace sightline::stream

namespace sightline {

using namespace stream;

std::span<const std::string> known_h264_encoders() {
  static const std::vector<std::string> names = {"v4l2h264enc", "vah264enc", "vaapih264enc",
                                                 "nvh264enc",   "x264enc",   "openh264enc"};
  return names;
}

bool h264_encoder_works(const std::string& element) {
  static EncoderProbes probes;
  return probes.works(element);
}

}  // namespace sightline
