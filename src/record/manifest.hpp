// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "sightline/record/recording.hpp"

namespace sightline::record {

/// Codecs a recording may hold: "h264", "mpeg4", "mjpeg", "ffv1", "rawvideo".
bool is_recording_codec(std::string_view codec);

/// Names that are safe as file names, CSV fields and stream paths: letters, digits, '_', '-', '.',
/// not starting with '.', at most 64.
bool is_plain_name(std::string_view name);

/// The text of recording.toml; parse_recording_toml() reads it back.
std::string format_recording_toml(const RecordingManifest& manifest);

}  // namespace sightline::record
