// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace sightline::capture {

/// Finds the sender's UTC time of images from RTP time stamps and RTCP sender reports (RFC 3550,
/// 5.1 and 6.4.1). Decoders keep only presentation times, so those of the last packets are
/// remembered with their RTP time stamps. One thread at a time.
class RtpTimes {
 public:
  explicit RtpTimes(uint32_t clock_rate = 90'000) : clock_rate_(clock_rate) {}

  void set_clock_rate(uint32_t hz) {
    if (hz > 0) clock_rate_ = hz;
  }
  /// An RTCP packet; ignored unless it begins with a sender report that knows the time.
  void sender_report(std::span<const uint8_t> packet);
  /// An RTP packet and its presentation time; ignored if it is none.
  void packet(std::span<const uint8_t> header, uint64_t pts);
  /// UTC [ns since 1970] of the image with this presentation time; nullopt if unknown.
  std::optional<int64_t> utc_ns(uint64_t pts) const;

 private:
  struct Report {
    int64_t utc_ns;
    uint32_t rtp;
  };
  struct Stamp {
    uint64_t pts = UINT64_MAX;
    uint32_t rtp = 0;
  };
  uint32_t clock_rate_;
  std::optional<Report> report_;
  std::array<Stamp, 128> stamps_{};  ///< of the last images, a ring
  size_t newest_ = 0;
};

}  // namespace sightline::capture
