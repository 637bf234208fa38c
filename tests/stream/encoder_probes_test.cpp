// SPDX-License-Identifier: Apache-2.0
#include "stream/encoder_probes.hpp"

#include <gst/gst.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "stream_tools.hpp"
#include "wrapped_encoder.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

std::atomic<bool> asleep{true};
std::atomic<int> made{0};

/// Nothing reaches the encoder while its device sleeps.
GstPadProbeReturn wait_for_device(GstPad*, GstPadProbeInfo*, gpointer) {
  while (asleep) std::this_thread::sleep_for(5ms);
  return GST_PAD_PROBE_OK;
}

void put_to_sleep(const test::WrappedEncoder& encoder) {
  ++made;
  gst_pad_add_probe(encoder.sink, GST_PAD_PROBE_TYPE_BUFFER, wait_for_device, nullptr, nullptr);
}

/// Registers the element; false where there is no x264enc to make it of.
bool has_sleeping_encoder() {
  asleep = true;
  made = 0;
  return test::register_wrapped_encoder<put_to_sleep>("sleepingh264enc");
}

TEST(EncoderProbes, OneThatAnswersLateIsUsedThen) {
  if (!has_sleeping_encoder()) GTEST_SKIP() << "needs x264enc (gstreamer1.0-plugins-ugly)";
  stream::EncoderProbes probes({.timeout = 200ms, .first_wait = 1h});
  EXPECT_FALSE(probes.works("sleepingh264enc"));
  EXPECT_FALSE(probes.works("sleepingh264enc"));
  asleep = false;
  EXPECT_TRUE(eventually([&] { return probes.works("sleepingh264enc"); }));
  EXPECT_EQ(made, 1);
  EXPECT_TRUE(probes.works("sleepingh264enc"));
}

TEST(EncoderProbes, OneThatHangsIsTriedAFewTimesAndHoldsNobodyUp) {
  if (!has_sleeping_encoder()) GTEST_SKIP() << "needs x264enc (gstreamer1.0-plugins-ugly)";
  stream::EncoderProbes probes(
      {.timeout = 100ms, .first_wait = 10ms, .wait_factor = 2, .pipelines = 3});
  const Time start = MonotonicClock::now();
  EXPECT_FALSE(probes.works("sleepingh264enc"));
  EXPECT_TRUE(eventually([&] {
    EXPECT_FALSE(probes.works("sleepingh264enc"));
    return made == 3;
  }));
  for (int i = 0; i < 200; ++i) {
    EXPECT_FALSE(probes.works("sleepingh264enc"));
    std::this_thread::sleep_for(2ms);
  }
  EXPECT_EQ(made, 3);
  EXPECT_LT(MonotonicClock::now() - start, 20s);
  asleep = false;
  EXPECT_TRUE(eventually([&] { return probes.works("sleepingh264enc"); }));
}

TEST(EncoderProbes, OneThatIsNotThereIsNotTriedAgain) {
  stream::EncoderProbes probes({.timeout = 100ms, .first_wait = 0ms});
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(probes.works("nosuchh264enc"));
}

}  // namespace
}  // namespace sightline
