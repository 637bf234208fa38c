// SPDX-License-Identifier: Apache-2.0
//
// FreeD D1 (Vinten/Radamec): 29 bytes, big-endian; D1, camera id, pan, tilt, roll (24 bits, 1/32768
// degree), x, y, height, zoom, focus (24 bits each), two spare bytes, and a checksum: 0x40 less the
// sum of all bytes before it.
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "capture/axes/axis_sources.hpp"

namespace sightline {
namespace {

constexpr size_t kLength = 29;
constexpr uint8_t kPose = 0xD1;
constexpr double kCount = std::numbers::pi / 180 / 32768;

int unsigned24(std::span<const uint8_t> packet, size_t at) {
  return packet[at] << 16 | packet[at + 1] << 8 | packet[at + 2];
}

int signed24(std::span<const uint8_t> packet, size_t at) {
  const int value = unsigned24(packet, at);
  return value >= 1 << 23 ? value - (1 << 24) : value;
}

}  // namespace

std::optional<AxisReading> parse_freed(std::span<const uint8_t> packet, int* device) {
  if (packet.size() != kLength || packet[0] != kPose) return std::nullopt;
  const int sum = std::accumulate(packet.begin(), packet.end() - 1, 0);
  if (((0x40 - sum) & 0xff) != packet[kLength - 1]) return std::nullopt;
  AxisReading reading;
  reading.pan = signed24(packet, 2) * kCount;
  reading.tilt = signed24(packet, 5) * kCount;
  reading.zoom = unsigned24(packet, 20);
  constexpr double kTurn = 2 * std::numbers::pi;
  if (std::abs(reading.pan) > kTurn || std::abs(reading.tilt) > kTurn) return std::nullopt;
  if (device != nullptr) *device = packet[1];
  return reading;
}

namespace capture {
namespace {

class FreedSource final : public AxisSource {
 public:
  FreedSource(UdpSocket socket, int device) : socket_(std::move(socket)), device_(device) {}

  Result<std::optional<AxisReading>> next(Duration timeout) override {
    SL_ASSIGN(auto reading, receive(timeout));
    if (!reading) return reading;
    // What has waited for a thread that was late is old: only the newest was sent just now.
    for (int i = 0; i < kMaxBurst; ++i) {
      SL_ASSIGN(const auto newer, receive(Duration(0)));
      if (newer) reading = newer;
      if (!waited_) break;
    }
    return reading;
  }
  Counts counts() const override { return counts_; }

 private:
  // Empty: none came, or it was not of this head; `waited_` says which.
  Result<std::optional<AxisReading>> receive(Duration timeout) {
    std::array<uint8_t, 256> buffer{};
    SL_ASSIGN(const auto length, socket_.receive(buffer, timeout));
    waited_ = length.has_value();
    if (!length) return std::optional<AxisReading>();
    const Time now = MonotonicClock::now();
    int device = -1;
    auto reading = parse_freed(std::span(buffer).first(*length), &device);
    if (!reading || (device_ >= 0 && device != device_)) {
      ++counts_.bad;
      return std::optional<AxisReading>();
    }
    ++counts_.good;
    reading->stamp = now;
    return reading;
  }

  static constexpr int kMaxBurst = 256;
  UdpSocket socket_;
  const int device_;
  bool waited_ = false;
  Counts counts_;
};

}  // namespace

Result<std::unique_ptr<AxisSource>> open_freed(const AxisSourceOptions& options,
                                               const std::string& name) {
  SL_ASSIGN(UdpSocket socket,
            UdpSocket::listen(options.host, options.interface, options.port, name));
  return std::unique_ptr<AxisSource>(
      std::make_unique<FreedSource>(std::move(socket), options.device));
}

}  // namespace capture
}  // namespace sightline
