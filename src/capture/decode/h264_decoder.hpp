// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "capture/common/frame_decoder.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/image/h264.hpp"
#include "sightline/image/planes.hpp"

namespace sightline::capture {

/// Decodes the H.264 of a camera (byte stream, one access unit at a time) with GStreamer, on
/// threads of its own.
class H264Decoder final : public AccessUnitDecoder {
 public:
  /// `where` names the camera. kUnavailable: a plugin is missing (the text names its package).
  static Result<std::unique_ptr<H264Decoder>> create(int width, int height,
                                                     const std::string& where);
  ~H264Decoder() override;
  H264Decoder(const H264Decoder&) = delete;
  H264Decoder& operator=(const H264Decoder&) = delete;

  bool can_begin(std::span<const uint8_t> unit) const override {
    return annex_b_can_start_decoding(unit);
  }
  Status push(std::span<const uint8_t> unit, uint64_t number) override;
  /// `to` is width x height.
  Result<std::optional<uint64_t>> pull(Duration limit, const MutableI420View& to) override;

 private:
  struct State;
  explicit H264Decoder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace sightline::capture
