// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/stream/encoder.hpp"
#include "stream/gst_ptr.hpp"

namespace sightline::stream {

/// A pipeline "appsrc name=src ! ENCODER name=enc ! h264parse ! appsink name=sink" in state NULL:
/// I420 of the options' size in, one Annex B access unit per buffer out. `options` is complete
/// (sizes, bitrate and rate are positive).
Result<GstObjectPtr<GstElement>> build_encoder_pipeline(const std::string& element,
                                                        const EncoderOptions& options);

/// The element of a pipeline by name; it is one of ours, so it exists.
GstObjectPtr<GstElement> element_of(GstElement* pipeline, const char* name);

/// The first element of options.prefer (or of the known ones) that works.
Result<std::string> choose_encoder(const EncoderOptions& options, const std::string& camera_name);

}  // namespace sightline::stream
