// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "stream/handover.hpp"

namespace sightline::stream {

/// A buffer over a packet's own bytes, which live as long as it does.
inline GstBuffer* wrap_packet(const std::shared_ptr<const std::vector<uint8_t>>& bytes) {
  using Owner = UserData<std::shared_ptr<const std::vector<uint8_t>>>;
  return gst_buffer_new_wrapped_full(GST_MEMORY_FLAG_READONLY, const_cast<uint8_t*>(bytes->data()),
                                     bytes->size(), 0, bytes->size(), Owner::make(bytes),
                                     Owner::destroy);
}

}  // namespace sightline::stream
