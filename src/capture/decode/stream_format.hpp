// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "capture/common/frame_decoder.hpp"
#include "capture/common/stream_layout.hpp"
#include "capture/decode/fourcc_formats.hpp"
#include "sightline/base/result.hpp"

namespace sightline::capture {

/// What a camera was set to.
struct StreamFormat {
  const FourccFormat* format = nullptr;
  StreamLayout layout;
};

/// How images of a format lie in a buffer whose rows are `stride` bytes apart (0: tightly packed).
/// kInvalidInput: a size or stride that a raw format cannot have.
Result<StreamFormat> stream_format(const FourccFormat& format, int width, int height,
                                   ptrdiff_t stride);

/// The decoder that the format needs; none for raw ones. `where` names the camera. kUnavailable: a
/// plugin for H.264 is missing.
Result<FrameDecoders> make_decoders(const StreamFormat& stream, const std::string& where);

}  // namespace sightline::capture
