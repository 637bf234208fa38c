// SPDX-License-Identifier: Apache-2.0
#include "stream/encoder_probes.hpp"

#include <gst/gst.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "stream_tools.hpp"

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

void init_instance(GTypeInstance* instance, gpointer) {
  ++made;
  auto* bin = GST_BIN(instance);
  GstElement* inner = gst_element_factory_make("x264enc", nullptr);
  if (inner == nullptr) return;
  gst_util_set_object_arg(G_OBJECT(inner), "tune", "zerolatency");
  gst_bin_add(bin, inner);
  GstPad* sink = gst_element_get_static_pad(inner, "sink");
  gst_pad_add_probe(sink, GST_PAD_PROBE_TYPE_BUFFER, wait_for_device, nullptr, nullptr);
  GstPad* source = gst_element_get_static_pad(inner, "src");
  gst_element_add_pad(GST_ELEMENT(bin), gst_ghost_pad_new("sink", sink));
  gst_element_add_pad(GST_ELEMENT(bin), gst_ghost_pad_new("src", source));
  gst_object_unref(sink);
  gst_object_unref(source);
}

void init_class(gpointer type_class, gpointer) {
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(type_class), "Sleeping encoder",
                                        "Codec/Encoder/Video", "Sleeps at first", "Sightline");
}

/// Registers the element; false where there is no x264enc to make it of.
bool has_sleeping_encoder() {
  gst_init(nullptr, nullptr);
  GstElementFactory* factory = gst_element_factory_find("x264enc");
  if (factory == nullptr) return false;
  gst_object_unref(factory);
  static const GType type = g_type_register_static_simple(
      GST_TYPE_BIN, "SightlineSleepingEncoder", sizeof(GstBinClass), init_class, sizeof(GstBin),
      init_instance, static_cast<GTypeFlags>(0));
  asleep = true;
  made = 0;
  return gst_element_register(nullptr, "sleepingh264enc", GST_RANK_NONE, type) != FALSE;
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
