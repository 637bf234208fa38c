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
  /// Listens at an address of this host; empty: any.
  static Result<UdpSocket> listen(const std::string& address, uint16_t port,
                                  const std::string& name);
  /// Talks to one peer, and takes datagrams of it alone.
  static Result<UdpSocket> connect(const std::string& host, uint16_t port, const std::string& name);

  /// Writes a datagram to `buffer` and returns its length (longer ones are cut); empty: none came.
  Result<std::optional<size_t>> receive(std::span<uint8_t> buffer, Duration timeout);
  Status send(std::span<const uint8_t> bytes);

 private:
  UdpSocket(UniqueFd fd, std::string name) : fd_(std::move(fd)), name_(std::move(name)) {}
  UniqueFd fd_;
  std::string name_;
};

}  // namespace sightline::capture
