// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "sightline/base/time.hpp"

namespace sightline::stream {

/// Follows what one RTSP client sends and says when it is not what a viewer sends: requests and
/// interleaved frames (RFC 2326) of bounded size, in the strict form of the grammar. What it passes
/// has the same bounds for every parser, so the library behind it never waits for the end of a
/// request that has none.
///
/// Threads: take() on the client's own; the rest from any.
class RequestGuard {
 public:
  /// Between two answers, of what cannot be read; RTCP of a viewer comes to a few hundred.
  static constexpr size_t kMaxOpaque = 128 * 1024;
  static constexpr size_t kMaxHead = 16 * 1024;  ///< request line and headers [bytes]
  static constexpr size_t kMaxBody = 16 * 1024;  ///< [bytes]

  enum class Verdict {
    kPass,
    kTooLarge,   ///< head or body beyond its limit
    kHttp,       ///< HTTP: RTSP inside it, or a browser
    kMalformed,  ///< not RTSP
  };

  /// What comes is encrypted: nothing is known of it but how much it is. Before the first take().
  void expect_opaque() { opaque_ = true; }
  /// An answer was sent; only of what is opaque. Any thread.
  void answered() {
    if (!opaque_) return;
    since_answer_.store(0, std::memory_order_relaxed);
    requests_.fetch_add(1, std::memory_order_relaxed);
  }
  bool opaque() const { return opaque_; }

  /// The next bytes that came, in order. After anything but kPass the connection has to end.
  Verdict take(std::span<const uint8_t> bytes, Time now);

  /// When the request or frame that is not complete yet began; Time{} between two of them.
  Time unfinished_since() const { return unfinished_since_.load(std::memory_order_relaxed); }
  /// Requests that were complete.
  uint64_t requests() const { return requests_.load(std::memory_order_relaxed); }

 private:
  enum class State { kBetween, kFrameHeader, kHead, kBody };

  Verdict take_byte(uint8_t byte, Time now);
  Verdict begin(uint8_t byte, Time now);
  Verdict take_head(uint8_t byte);
  Verdict take_frame_header(uint8_t byte);
  Verdict end_line();
  Verdict take_header(const std::string& line);
  void take_body();
  void end_message();

  bool opaque_ = false;
  std::atomic<size_t> since_answer_{0};
  State state_ = State::kBetween;
  bool is_request_ = false;  ///< else an interleaved frame
  bool first_line_ = false;
  bool carriage_return_ = false;
  bool has_length_ = false;
  size_t head_bytes_ = 0;
  size_t left_ = 0;  ///< of the body; bytes
  int header_at_ = 0;
  std::string line_;
  std::atomic<Time> unfinished_since_{};
  std::atomic<uint64_t> requests_{0};
};

/// Why a connection ends, for a person.
std::string_view describe(RequestGuard::Verdict verdict);

}  // namespace sightline::stream
