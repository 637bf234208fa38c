// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "capture/network/rtp_times.hpp"

/// RTP and RTCP packets in any order and of any content, each behind a byte that says which and how
/// long.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  sightline::capture::RtpTimes times;
  std::span<const uint8_t> rest(data, size);
  uint64_t pts = 0;
  while (!rest.empty()) {
    const uint8_t head = rest.front();
    rest = rest.subspan(1);
    const size_t length = std::min<size_t>(head & 0x3f, rest.size());
    // A copy, so that the sanitizer sees a step too far.
    const std::vector<uint8_t> packet(rest.begin(), rest.begin() + static_cast<ptrdiff_t>(length));
    rest = rest.subspan(length);
    switch (head >> 6) {
      case 0:
        times.sender_report(packet);
        break;
      case 1:
        times.packet(packet, pts += 40'000'000);
        break;
      case 2:
        times.set_clock_rate(packet.empty() ? 0 : packet[0] * 1000u);
        break;
      default:
        break;
    }
    (void)times.utc_ns(pts);
  }
  return 0;
}
