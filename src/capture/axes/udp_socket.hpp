// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::capture {

/// A UDP socket that waits for one datagram at a time.
class UdpSocket {
 public:
  /// Listens at an address of this host, empty: any; or to a multicast group, which it joins on
  /// `interface`, empty: the one that the kernel routes it to. Others may listen to the same group.
  static Result<UdpSocket> listen(const std::string& address, const std::string& interface,
                                  uint16_t port, const std::string& name);
  /// Talks to one peer, and takes datagrams of it alone.
  static Result<UdpSocket> connect(const std::string& host, uint16_t port, const std::string& name);

  /// Writes a datagram to `buffer` and returns its length (longer ones are cut); empty: none came.
  /// A group that says nothing for kForgotten is an Error: an interface that went away took the
  /// membership with it, and a switch may have forgotten it.
  Result<std::optional<size_t>> receive(std::span<uint8_t> buffer, Duration timeout);
  Status send(std::span<const uint8_t> bytes);

  static constexpr Duration kForgotten = std::chrono::seconds(10);

 private:
  UdpSocket(UniqueFd fd, std::string name) : fd_(std::move(fd)), name_(std::move(name)) {}
  UniqueFd fd_;
  std::string name_, group_;  ///< empty: no group
  Time heard_ = MonotonicClock::now();
};

/// Whether this address, in numbers, is that of a multicast group.
bool is_multicast(const std::string& address);

}  // namespace sightline::capture
