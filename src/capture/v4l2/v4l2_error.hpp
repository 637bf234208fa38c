// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "sightline/base/result.hpp"

namespace sightline::capture {

/// What was being done when the kernel refused; the same errno means different things.
enum class V4l2Step { kOpen, kFormat, kBuffers, kStart, kCapture, kControl, kReadControl, kQuery };

/// A message for a person from an errno (positive): what happened and what to do about it.
Error v4l2_error(V4l2Step step, int number, const std::string& where, const std::string& device);

}  // namespace sightline::capture
