// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <random>
#include <vector>

#include "faults.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::gige {

/// One frame, ready for the wire.
struct OutFrame {
  uint64_t block_id = 0;
  bool extended_ids = false;
  bool chunks = false;
  uint32_t pixel_format = 0;
  uint32_t width = 0, height = 0, offset_x = 0, offset_y = 0;
  uint64_t stamp = 0;  ///< ticks
  std::vector<uint8_t> payload;
  size_t packet_bytes = 0;  ///< of the payload in one packet
  bool short_leader = false, wrong_size = false;

  uint32_t packets() const;  ///< with leader and trailer
};

/// Sends frames as GVSP packets, each at its time, and sends packets again that are asked for.
class Streamer {
 public:
  /// The socket is bound to `address`, any port.
  Streamer(in_addr address, Faults& faults, std::mt19937_64& random);

  uint16_t port() const;
  void set_destination(in_addr address, uint16_t port);
  void set_gap(int64_t ns) { gap_ns_ = ns; }  ///< between packets

  /// `ready_ns`: when the first packet goes.
  void send(std::shared_ptr<const OutFrame> frame, int64_t ready_ns);
  /// Packets that are gone are answered with an error packet.
  void resend(uint64_t block_id, uint32_t first, uint32_t last, bool extended_ids, int64_t now_ns);
  /// A packet of `bytes` with all headers, filled with the standard's test pattern.
  void send_test(size_t bytes);
  void forget();  ///< what has not been sent yet

  /// INT64_MAX: nothing waits.
  int64_t next_due() const;
  void run(int64_t now_ns);

  uint64_t resent() const { return resent_; }

 private:
  struct Waiting {
    std::shared_ptr<const OutFrame> frame;
    uint32_t packet;
  };

  bool chance(double share);
  void put(const std::shared_ptr<const OutFrame>& frame, uint32_t packet, int64_t due_ns);
  void transmit(const OutFrame& frame, uint32_t packet);
  void transmit_bytes(size_t size);

  Faults& faults_;
  std::mt19937_64& random_;
  UniqueFd socket_;
  sockaddr_in destination_{};
  int64_t gap_ns_ = 0;
  std::multimap<int64_t, Waiting> waiting_;
  std::deque<std::shared_ptr<const OutFrame>> sent_;  ///< can be asked for again
  std::vector<uint8_t> packet_;
  uint64_t resent_ = 0;
};

}  // namespace sightline::gige
