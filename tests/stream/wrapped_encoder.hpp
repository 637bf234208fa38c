// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/gst.h>

namespace sightline::test {

/// What a broken encoder is made of: a bin around x264enc, with its two pads before they are shown.
struct WrappedEncoder {
  GstPad* sink = nullptr;  ///< of x264enc
  GstPad* out = nullptr;   ///< of the bin
};

/// Registers `name`, whose instances are x264enc in a bin that `Break` has been given to change
/// (`void Break(const WrappedEncoder&)`); false where there is no x264enc to make it of.
template <void (*Break)(const WrappedEncoder&)>
bool register_wrapped_encoder(const char* name) {
  gst_init(nullptr, nullptr);
  GstElementFactory* factory = gst_element_factory_find("x264enc");
  if (factory == nullptr) return false;
  gst_object_unref(factory);
  const auto init_class = [](gpointer type_class, gpointer) {
    gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(type_class), "Broken encoder",
                                          "Codec/Encoder/Video", "For tests", "Sightline");
  };
  const auto init_instance = [](GTypeInstance* instance, gpointer) {
    auto* bin = GST_BIN(instance);
    GstElement* inner = gst_element_factory_make("x264enc", nullptr);
    if (inner == nullptr) return;
    gst_util_set_object_arg(G_OBJECT(inner), "tune", "zerolatency");
    gst_bin_add(bin, inner);
    GstPad* sink = gst_element_get_static_pad(inner, "sink");
    GstPad* source = gst_element_get_static_pad(inner, "src");
    GstPad* out = gst_ghost_pad_new("src", source);
    Break({sink, out});
    gst_element_add_pad(GST_ELEMENT(bin), gst_ghost_pad_new("sink", sink));
    gst_element_add_pad(GST_ELEMENT(bin), out);
    gst_object_unref(sink);
    gst_object_unref(source);
  };
  static const GType type = g_type_register_static_simple(
      GST_TYPE_BIN, "SightlineBrokenEncoder", sizeof(GstBinClass), init_class, sizeof(GstBin),
      init_instance, static_cast<GTypeFlags>(0));
  return gst_element_register(nullptr, name, GST_RANK_NONE, type) != FALSE;
}

}  // namespace sightline::test
