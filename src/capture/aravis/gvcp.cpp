// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/gvcp.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>

#include "sightline/base/unique_fd.hpp"
#include "sightline/capture/aravis/gige_action.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr uint16_t kPort = 3956;
constexpr uint8_t kKey = 0x42, kAckWanted = 0x01;
constexpr uint16_t kDiscovery = 0x0002, kDiscoveryAck = 0x0003, kAction = 0x0100;
constexpr size_t kHeader = 8;
// Within the answer to a discovery.
constexpr size_t kVendor = 0x48, kModel = 0x68, kSerial = 0xD8, kUserName = 0xE8, kAnswer = 0xF8;

std::optional<sockaddr_in> address_of(const std::string& text, uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  if (inet_pton(AF_INET, text.c_str(), &address.sin_addr) != 1) return std::nullopt;
  return address;
}

const sockaddr* generic(const sockaddr_in& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

UniqueFd socket_at(const std::string& own) {
  UniqueFd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const auto address = address_of(own, 0);
  if (!socket.is_open() || !address ||
      ::bind(socket.get(), generic(*address), sizeof *address) != 0) {
    return UniqueFd();
  }
  return socket;
}

std::string text_at(std::span<const uint8_t> bytes, size_t at, size_t size) {
  const auto* text = reinterpret_cast<const char*>(bytes.data() + at);
  return {text, strnlen(text, size)};
}

void put_u16(uint8_t* to, uint32_t value) {
  to[0] = static_cast<uint8_t>(value >> 8);
  to[1] = static_cast<uint8_t>(value);
}
void put_u32(uint8_t* to, uint32_t value) {
  put_u16(to, value >> 16);
  put_u16(to + 2, value & 0xFFFF);
}

}  // namespace

std::optional<GigeAnswer> ask_gige(const std::string& camera, const std::string& own,
                                   Duration timeout) {
  const UniqueFd socket = socket_at(own);
  const auto to = address_of(camera, kPort);
  if (!socket.is_open() || !to) return std::nullopt;
  const std::array<uint8_t, kHeader> ask = {kKey, kAckWanted, 0, kDiscovery, 0, 0, 0, 1};
  for (int attempt = 0; attempt < 3; ++attempt) {
    if (::sendto(socket.get(), ask.data(), ask.size(), 0, generic(*to), sizeof *to) < 0) {
      return std::nullopt;
    }
    pollfd wait{socket.get(), POLLIN, 0};
    if (::poll(&wait, 1, static_cast<int>(timeout / 3 / 1ms)) <= 0) continue;
    std::array<uint8_t, 1024> bytes{};
    const ssize_t got = ::recv(socket.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (got < static_cast<ssize_t>(kHeader + kAnswer) || bytes[3] != kDiscoveryAck) continue;
    const auto answer = std::span<const uint8_t>(bytes).subspan(kHeader);
    return GigeAnswer{text_at(answer, kVendor, 32), text_at(answer, kModel, 32),
                      text_at(answer, kSerial, 16), text_at(answer, kUserName, 16)};
  }
  return std::nullopt;
}

}  // namespace sightline::capture

namespace sightline {

using namespace capture;

Status fire_gige_action(const GigeAction& action) {
  const auto to = address_of(action.address, kPort);
  if (!to) {
    return make_error(
        ErrorCode::kInvalidInput, action.address,
        "an action needs an IPv4 address to go to: a camera's or a broadcast address");
  }
  const UniqueFd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const int on = 1;
  (void)::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
  std::array<uint8_t, kHeader + 12> bytes{};
  bytes[0] = kKey;
  put_u16(&bytes[2], kAction);
  put_u16(&bytes[4], 12);
  put_u16(&bytes[6], 1);
  put_u32(&bytes[8], action.keys.device_key);
  put_u32(&bytes[12], action.keys.group_key);
  put_u32(&bytes[16], action.keys.group_mask);
  if (::sendto(socket.get(), bytes.data(), bytes.size(), 0, generic(*to), sizeof *to) < 0) {
    return make_error(ErrorCode::kUnavailable, action.address, "cannot send an action command: {}",
                      std::strerror(errno));
  }
  return {};
}

}  // namespace sightline
