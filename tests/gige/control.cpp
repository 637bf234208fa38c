// SPDX-License-Identifier: Apache-2.0
#include "control.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <thread>

namespace sightline::gige {
namespace {

constexpr uint16_t kPort = 3956;
constexpr uint8_t kKey = 0x42, kAckWanted = 0x01, kExtendedIds = 0x10, kScheduled = 0x80;
constexpr uint16_t kDiscovery = 0x0002, kResend = 0x0040, kReadRegister = 0x0080,
                   kWriteRegister = 0x0082, kReadMemory = 0x0084, kWriteMemory = 0x0086,
                   kPendingAck = 0x0089, kAction = 0x0100;
constexpr uint16_t kNotImplemented = 0x8001, kInvalidParameter = 0x8002, kInvalidAddress = 0x8003,
                   kWriteProtect = 0x8004, kAccessDenied = 0x8006, kNoReferenceTime = 0x8013,
                   kActionLate = 0x8016;
constexpr size_t kDiscoveryBytes = 0xF8;

uint32_t u16_at(std::span<const uint8_t> bytes, size_t at) {
  return static_cast<uint32_t>(bytes[at] << 8 | bytes[at + 1]);
}
uint32_t u32_at(std::span<const uint8_t> bytes, size_t at) {
  return u16_at(bytes, at) << 16 | u16_at(bytes, at + 2);
}

void add_u16(std::vector<uint8_t>& bytes, uint32_t value) {
  bytes.push_back(static_cast<uint8_t>(value >> 8));
  bytes.push_back(static_cast<uint8_t>(value));
}
void add_u32(std::vector<uint8_t>& bytes, uint32_t value) {
  add_u16(bytes, value >> 16);
  add_u16(bytes, value & 0xFFFF);
}

UniqueFd listen_at(in_addr address, bool shared) {
  UniqueFd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  (void)::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
  if (shared) (void)::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr = address;
  own.sin_port = htons(kPort);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0) {
    return UniqueFd();
  }
  return socket;
}

// Where commands to all hosts of the subnet arrive.
in_addr broadcast_of(in_addr address) {
  in_addr found{INADDR_NONE};
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return found;
  for (const ifaddrs* i = list; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET) continue;
    const auto* own = reinterpret_cast<const sockaddr_in*>(i->ifa_addr);
    const auto* mask = reinterpret_cast<const sockaddr_in*>(i->ifa_netmask);
    if (own->sin_addr.s_addr == address.s_addr && mask != nullptr) {
      found.s_addr = address.s_addr | ~mask->sin_addr.s_addr;
    }
  }
  freeifaddrs(list);
  return found;
}

}  // namespace

Control::Control(in_addr address, Registers& registers, Camera& camera, Streamer& streamer,
                 Faults& faults)
    : address_(address),
      registers_(registers),
      camera_(camera),
      streamer_(streamer),
      faults_(faults) {}

bool Control::open(std::string& error) {
  own_ = listen_at(address_, false);
  if (own_.get() < 0) {
    error = fmt::format("cannot listen at UDP port {}: {}", kPort, std::strerror(errno));
    return false;
  }
  everybody_ = listen_at({INADDR_BROADCAST}, true);
  const in_addr subnet = broadcast_of(address_);
  if (subnet.s_addr != INADDR_NONE) subnet_ = listen_at(subnet, true);
  return true;
}

std::array<int, 3> Control::sockets() const {
  return {own_.get(), everybody_.get(), subnet_.get()};
}

void Control::run() {
  std::array<uint8_t, 2048> bytes;
  for (const int socket : sockets()) {
    while (socket >= 0) {
      Command command{};
      socklen_t size = sizeof command.from;
      const ssize_t got = ::recvfrom(socket, bytes.data(), bytes.size(), 0,
                                     reinterpret_cast<sockaddr*>(&command.from), &size);
      if (got < 0) break;
      const std::span<const uint8_t> packet(bytes.data(), static_cast<size_t>(got));
      if (faults_.deaf || packet.size() < 8 || packet[0] != kKey) continue;
      command.flags = packet[1];
      command.code = static_cast<uint16_t>(u16_at(packet, 2));
      command.id = static_cast<uint16_t>(u16_at(packet, 6));
      command.data = packet.subspan(8);
      if (u16_at(packet, 4) > command.data.size()) continue;
      std::this_thread::sleep_for(std::chrono::nanoseconds(faults_.answer_ns));
      // Not of before the command came: a latch would lie before it was asked for.
      const int64_t now_ns = host_now_ns();
      if (in_control(command.from)) heard_ns_ = now_ns;
      answer(command, now_ns);
      if (faults_.answer_ns > 0) return;  // else those who ask again leave no time for anything
    }
  }
}

bool Control::in_control(const sockaddr_in& client) const {
  return controlled() && client.sin_port == controller_.sin_port &&
         client.sin_addr.s_addr == controller_.sin_addr.s_addr;
}

void Control::check_heartbeat(int64_t now_ns) {
  const int64_t limit = int64_t{registers_.u32(reg::kHeartbeat)} * 1'000'000;
  if (controlled() && now_ns - heard_ns_ > limit) {
    fmt::print("heartbeat lost\n");
    std::fflush(stdout);
    drop_control();
  }
}

void Control::drop_control() {
  controller_ = {};
  registers_.set_u32(reg::kPrivilege, 0);
  registers_.set_u32(reg::kStreamPort, 0);
  streamer_.set_destination({0}, 0);
  camera_.stop();
}

void Control::answer(const Command& command, int64_t now_ns) {
  if (pending_ > 0 && command.code != kDiscovery) {
    --pending_;
    std::vector<uint8_t> data;
    add_u16(data, 0);
    add_u16(data, 500);  // milliseconds
    acknowledge(command, kPendingAck, data);
  }
  switch (command.code) {
    case kDiscovery:
      return acknowledge(command, kDiscovery + 1, registers_.read(0, kDiscoveryBytes));
    case kReadRegister:
      return read_registers(command, now_ns);
    case kWriteRegister:
      return write_registers(command, now_ns);
    case kReadMemory:
      return read_memory(command, now_ns);
    case kWriteMemory:
      return write_memory(command, now_ns);
    case kResend:
      return resend(command, now_ns);
    case kAction:
      return action(command, now_ns);
    default:
      return acknowledge(command, static_cast<uint16_t>(command.code + 1), {}, kNotImplemented);
  }
}

void Control::acknowledge(const Command& command, uint16_t code, std::span<const uint8_t> data,
                          uint16_t status) {
  if ((command.flags & kAckWanted) == 0) return;
  std::vector<uint8_t> packet;
  add_u16(packet, status);
  add_u16(packet, code);
  add_u16(packet, static_cast<uint32_t>(data.size()));
  add_u16(packet, command.id);
  packet.insert(packet.end(), data.begin(), data.end());
  (void)::sendto(own_.get(), packet.data(), packet.size(), 0,
                 reinterpret_cast<const sockaddr*>(&command.from), sizeof command.from);
}

void Control::read_registers(const Command& command, int64_t now_ns) {
  std::vector<uint8_t> values;
  uint16_t status = 0;
  for (size_t at = 0; at + 4 <= command.data.size(); at += 4) {
    const uint32_t address = u32_at(command.data, at);
    if (address % 4 != 0 || !registers_.contains(address, 4)) {
      status = kInvalidAddress;
      break;
    }
    camera_.about_to_read(address, now_ns);
    add_u32(values, registers_.u32(address));
  }
  acknowledge(command, kReadRegister + 1, values, status);
}

uint16_t Control::check_write(const sockaddr_in& client, uint32_t address, size_t size) const {
  if (address % 4 != 0 || size % 4 != 0 || !registers_.contains(address, size)) {
    return kInvalidAddress;
  }
  if (!in_control(client)) return kAccessDenied;
  return Registers::writable(address) ? 0 : kWriteProtect;
}

uint16_t Control::write_privilege(const sockaddr_in& client, uint32_t value) {
  if (controlled() && !in_control(client)) return kAccessDenied;
  if ((value & 3) == 0) {
    if (controlled()) drop_control();
    return 0;
  }
  controller_ = client;
  heard_ns_ = host_now_ns();
  registers_.set_u32(reg::kPrivilege, value & 3);
  return 0;
}

void Control::write_registers(const Command& command, int64_t now_ns) {
  uint16_t status = 0;
  uint32_t done = 0;
  for (size_t at = 0; at + 8 <= command.data.size() && status == 0; at += 8, ++done) {
    const uint32_t address = u32_at(command.data, at);
    if (address == reg::kPrivilege) {
      status = write_privilege(command.from, u32_at(command.data, at + 4));
      continue;
    }
    status = check_write(command.from, address, 4);
    if (status != 0) break;
    registers_.write(address, command.data.subspan(at + 4, 4));
    camera_.written(address, now_ns);
  }
  std::vector<uint8_t> data;
  add_u16(data, 0);
  add_u16(data, done);
  acknowledge(command, kWriteRegister + 1, data, status);
}

void Control::read_memory(const Command& command, int64_t now_ns) {
  if (command.data.size() < 8) {
    return acknowledge(command, kReadMemory + 1, {}, kInvalidParameter);
  }
  const uint32_t address = u32_at(command.data, 0);
  const size_t size = u16_at(command.data, 6);
  camera_.about_to_read(address, now_ns);
  const auto bytes = registers_.read(address, size);
  if (size == 0 || size > 536 || bytes.empty()) {
    return acknowledge(command, kReadMemory + 1, {}, kInvalidAddress);
  }
  std::vector<uint8_t> data;
  add_u32(data, address);
  data.insert(data.end(), bytes.begin(), bytes.end());
  acknowledge(command, kReadMemory + 1, data);
}

void Control::write_memory(const Command& command, int64_t now_ns) {
  if (command.data.size() < 4) {
    return acknowledge(command, kWriteMemory + 1, {}, kInvalidParameter);
  }
  const uint32_t address = u32_at(command.data, 0);
  const auto bytes = command.data.subspan(4);
  const uint16_t status = check_write(command.from, address, bytes.size());
  if (status == 0) {
    registers_.write(address, bytes);
    camera_.written(address, now_ns);
  }
  std::vector<uint8_t> data;
  add_u16(data, 0);
  add_u16(data, status == 0 ? static_cast<uint32_t>(bytes.size()) : 0);
  acknowledge(command, kWriteMemory + 1, data, status);
}

void Control::resend(const Command& command, int64_t now_ns) {
  const bool extended = (command.flags & kExtendedIds) != 0;
  if (command.data.size() < (extended ? 20 : 12)) return;
  const uint64_t block = extended
                             ? uint64_t{u32_at(command.data, 12)} << 32 | u32_at(command.data, 16)
                             : u16_at(command.data, 2);
  streamer_.resend(block, u32_at(command.data, 4) & 0xFFFFFF, u32_at(command.data, 8) & 0xFFFFFF,
                   extended, now_ns);
}

void Control::action(const Command& command, int64_t now_ns) {
  if (command.data.size() < 12) return;
  const bool ours = u32_at(command.data, 0) == registers_.u32(reg::kActionDeviceKey) &&
                    u32_at(command.data, 4) == registers_.u32(reg::kGroupKey) &&
                    (u32_at(command.data, 8) & registers_.u32(reg::kGroupMask)) != 0;
  if (!ours) return;  // an action for others is not answered
  int64_t at = now_ns;
  uint16_t status = 0;
  if ((command.flags & kScheduled) != 0 && command.data.size() >= 20) {
    if (registers_.u32(reg::kPtpStatus) != 3) {
      return acknowledge(command, kAction + 1, {}, kNoReferenceTime);
    }
    at = camera_.clock().host_ns_of(uint64_t{u32_at(command.data, 12)} << 32 |
                                    u32_at(command.data, 16));
    if (at < now_ns) {
      at = now_ns;
      status = kActionLate;
    }
  }
  camera_.trigger(Camera::Trigger::kAction, at);
  acknowledge(command, kAction + 1, {}, status);
}

}  // namespace sightline::gige
