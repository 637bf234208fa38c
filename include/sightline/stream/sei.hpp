// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/stream_types.hpp"

namespace sightline {

/// What travels inside the video beside every image: an H.264 SEI message of type
/// user_data_unregistered (ITU-T H.264, D.1.7), layout in docs/sei.md.

struct SeiObject {
  ObjectId id;
  std::string name;  ///< UTF-8, at most 255 bytes
  TrackState state = TrackState::kSearching;
  PoseSource source = PoseSource::kNone;
  /// Meaningful unless source is kNone:
  Rigid3 world_from_object;     ///< at the image's capture time
  float sigma_translation = 0;  ///< [m]
  float sigma_rotation = 0;     ///< [rad]
};

struct SeiMessage {
  std::string camera;  ///< UTF-8, at most 255 bytes
  uint32_t epoch = 0;
  uint64_t sequence = 0;
  Time capture{};                  ///< CLOCK_MONOTONIC of the sending host
  int64_t capture_utc_ns = 0;      ///< the same instant in UTC
  Duration capture_error{0};       ///< bound on |capture - truth|, at most 4.29 s
  std::vector<SeiObject> objects;  ///< at most 255
};

/// Identifies our messages among other user data.
extern const std::array<uint8_t, 16> kSeiUuid;

/// The message that belongs to an image; objects are named by `names` (empty name if missing).
SeiMessage sei_message_of(const AnnotatedImage& image, const std::string& camera_name,
                          std::span<const NamedObject> names);

/// A whole NAL unit with its start code (00 00 00 01) and emulation prevention. Names longer than
/// 255 bytes are cut at a character; objects beyond 255 are left out.
std::vector<uint8_t> make_sei_nal(const SeiMessage& message);

/// The access unit (Annex B) with `sei_nal` put before its first slice, after delimiter and
/// parameter sets. An access unit without a slice gets it at the end.
std::vector<uint8_t> insert_sei(std::span<const uint8_t> access_unit,
                                std::span<const uint8_t> sei_nal);

/// The first message of ours in an access unit (Annex B, any start codes). kNotFound if there is
/// none, kDamaged if it is cut short, contradicts itself or holds values that are not finite.
Result<SeiMessage> parse_sei(std::span<const uint8_t> access_unit);

}  // namespace sightline
