// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/gst.h>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "stream/gst_ptr.hpp"

namespace sightline::stream {

struct FreeStructure {
  void operator()(GstStructure* structure) const { gst_structure_free(structure); }
};
using StructurePtr = std::unique_ptr<GstStructure, FreeStructure>;

/// Asks webrtcbin by an action signal ("set-remote-description" with a description,
/// "create-answer" with null options) and waits for the reply, at most so long. Null reply: done,
/// with nothing to say. An error of webrtcbin is kInvalidInput: it comes from what the peer sent.
Result<StructurePtr> ask_webrtc(GstElement* webrtc, const char* signal, gpointer argument,
                                Duration patience);

}  // namespace sightline::stream
