// SPDX-License-Identifier: Apache-2.0
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <future>

#include "sightline/base/thread.hpp"
#include "sightline/stream/encoder.hpp"
#include "stream_tools.hpp"
#include "wrapped_encoder.hpp"

namespace sightline {
namespace {

constexpr int kWidth = 320, kHeight = 192;

/// An encoder that works until a key frame is asked of it: then it says at once, on the asking
/// thread, that it has failed.
gboolean fail_when_asked(GstPad* pad, GstObject* parent, GstEvent* event) {
  const bool asked = GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM &&
                     gst_event_has_name(event, "GstForceKeyUnit");
  if (!asked) return gst_pad_event_default(pad, parent, event);
  GST_ELEMENT_ERROR(parent, RESOURCE, FAILED, ("the device is gone"), ("in the event handler"));
  gst_event_unref(event);
  return FALSE;
}

void let_fail(const test::WrappedEncoder& encoder) {
  gst_pad_set_event_function(encoder.out, fail_when_asked);
}

/// Registers the element; false where there is no x264enc to make it of.
bool has_failing_encoder() { return test::register_wrapped_encoder<let_fail>("failingh264enc"); }

AnnotatedImage image(int number) {
  return annotated(synthetic_image(kWidth, kHeight, number), static_cast<uint64_t>(number),
                   time_from_ns(1'000'000'000 + number * 33'000'000LL));
}

TEST(EncoderFailure, AnErrorPostedInsidePushIsReportedAndHoldsNobodyUp) {
  if (!has_failing_encoder()) GTEST_SKIP() << "needs x264enc (gstreamer1.0-plugins-ugly)";
  EncoderOptions options;
  options.width = kWidth;
  options.height = kHeight;
  options.prefer = {"failingh264enc"};
  auto created = VideoEncoder::create(options, "cam", {});
  ASSERT_TRUE(created) << created.error().message();
  // Shared, and given up without a join if push() never returns.
  const std::shared_ptr<VideoEncoder> encoder = *std::move(created);
  ASSERT_TRUE(encoder->push_and_wait(image(0), {}, std::chrono::seconds(20)));
  encoder->request_keyframe();
  const auto pushed = std::make_shared<std::promise<Status>>();
  auto done = pushed->get_future();
  std::jthread pushing = start_thread("pushing", [encoder, pushed](std::stop_token) {
    pushed->set_value(encoder->push_and_wait(image(1), {}, std::chrono::seconds(20)));
  });
  if (done.wait_for(std::chrono::seconds(40)) != std::future_status::ready) {
    pushing.detach();
    new std::shared_ptr<VideoEncoder>(encoder);  // in use for ever
    FAIL() << "push() waits for itself";
  }
  EXPECT_TRUE(eventually([&] { return encoder->failure().has_value(); }));
  EXPECT_NE(encoder->failure()->text.find("the device is gone"), std::string::npos);
  encoder->push(image(2), {});
  EXPECT_GE(encoder->counts().dropped, 1u);
}

}  // namespace
}  // namespace sightline
