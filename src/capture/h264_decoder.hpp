// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/image/planes.hpp"

namespace sightline {

/// Decodes the H.264 of a camera (byte stream, one access unit at a time) with GStreamer, on
/// threads of its own. Pictures come out in order, each with the number of its access unit; units
/// that cannot be decoded have none. One thread at a time.
class H264Decoder {
 public:
  /// `where` names the camera. kUnavailable: a plugin is missing (the text names its package).
  static Result<std::unique_ptr<H264Decoder>> create(int width, int height,
                                                     const std::string& where);
  ~H264Decoder();
  H264Decoder(const H264Decoder&) = delete;
  H264Decoder& operator=(const H264Decoder&) = delete;

  /// `number` grows from unit to unit. The bytes are copied.
  Status push(std::span<const uint8_t> unit, uint64_t number);
  /// Waits for the next picture and writes it to `to` (width x height); its number, or nullopt at
  /// the limit. kDamaged: a picture of another size; kInternal: the decoder gave up.
  Result<std::optional<uint64_t>> pull(Duration limit, const MutableI420View& to);

 private:
  struct State;
  explicit H264Decoder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Whether decoding can begin here: the unit holds an IDR slice or a sequence parameter set.
bool begins_h264(std::span<const uint8_t> unit);

}  // namespace sightline
