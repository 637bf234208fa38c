// SPDX-License-Identifier: Apache-2.0
#include "capture/network/rtp_times.hpp"

namespace sightline::capture {
namespace {

constexpr uint8_t kSenderReport = 200;
constexpr int64_t kNtpToUnixSeconds = 2'208'988'800;  // 1900 to 1970
constexpr int64_t kNsPerSecond = 1'000'000'000;

uint32_t big_endian(std::span<const uint8_t> bytes, size_t at) {
  return (uint32_t{bytes[at]} << 24) | (uint32_t{bytes[at + 1]} << 16) |
         (uint32_t{bytes[at + 2]} << 8) | uint32_t{bytes[at + 3]};
}

bool is_version_2(std::span<const uint8_t> packet) { return packet[0] >> 6 == 2; }

}  // namespace

void RtpTimes::sender_report(std::span<const uint8_t> packet) {
  if (packet.size() < 20 || !is_version_2(packet) || packet[1] != kSenderReport) return;
  const uint32_t seconds = big_endian(packet, 8), fraction = big_endian(packet, 12);
  if (seconds == 0) return;  // the sender has no clock
  const auto fraction_ns =
      static_cast<int64_t>((uint64_t{fraction} * static_cast<uint64_t>(kNsPerSecond)) >> 32);
  // Seconds wrap in 2036: those that would lie before 1968 are of the next era.
  const int64_t era = seconds < 0x80000000u ? int64_t{1} << 32 : 0;
  report_ = Report{(seconds + era - kNtpToUnixSeconds) * kNsPerSecond + fraction_ns,
                   big_endian(packet, 16)};
}

void RtpTimes::packet(std::span<const uint8_t> header, uint64_t pts) {
  if (header.size() < 12 || !is_version_2(header)) return;
  const uint32_t rtp = big_endian(header, 4);
  if (stamps_[newest_].pts == pts) return;
  newest_ = (newest_ + 1) % stamps_.size();
  stamps_[newest_] = {pts, rtp};
}

std::optional<int64_t> RtpTimes::utc_ns(uint64_t pts) const {
  if (!report_) return std::nullopt;
  for (size_t i = 0; i < stamps_.size(); ++i) {
    const Stamp& stamp = stamps_[(newest_ + stamps_.size() - i) % stamps_.size()];
    if (stamp.pts != pts) continue;
    const auto ticks = static_cast<int32_t>(stamp.rtp - report_->rtp);  // wraps
    return report_->utc_ns + ticks * kNsPerSecond / static_cast<int64_t>(clock_rate_);
  }
  return std::nullopt;
}

}  // namespace sightline::capture
