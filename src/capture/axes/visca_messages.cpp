// SPDX-License-Identifier: Apache-2.0
//
// VISCA (Sony): the bytes of inquiries and orders of pan, tilt and zoom, the same over IP and over
// serial lines.
#include "capture/axes/visca_messages.hpp"

#include <algorithm>
#include <cmath>

#include "sightline/capture/axes/axis_source.hpp"

namespace sightline {
namespace {

constexpr uint8_t kFrom = 0x90, kCompletion = 0x50, kEnd = 0xFF;

// Half-bytes, the upper half of each byte zero.
std::optional<int> half_bytes(std::span<const uint8_t> bytes) {
  int value = 0;
  for (const uint8_t byte : bytes) {
    if (byte > 0x0F) return std::nullopt;
    value = value << 4 | byte;
  }
  return value;
}

bool is_answer(std::span<const uint8_t> payload, size_t length) {
  return payload.size() == length && payload[0] == kFrom && payload[1] == kCompletion &&
         payload[length - 1] == kEnd;
}

int signed16(int value) { return value >= 1 << 15 ? value - (1 << 16) : value; }

}  // namespace

std::optional<std::pair<int, int>> parse_visca_position(std::span<const uint8_t> payload) {
  if (!is_answer(payload, 11)) return std::nullopt;
  const auto pan = half_bytes(payload.subspan(2, 4)), tilt = half_bytes(payload.subspan(6, 4));
  if (!pan || !tilt) return std::nullopt;
  return std::pair(signed16(*pan), signed16(*tilt));
}

std::optional<int> parse_visca_zoom(std::span<const uint8_t> payload) {
  if (!is_answer(payload, 7)) return std::nullopt;
  return half_bytes(payload.subspan(2, 4));
}

std::array<uint8_t, 15> format_visca_position(std::pair<int, int> counts,
                                              std::pair<int, int> speeds) {
  std::array<uint8_t, 15> out = {0x81, 0x01, 0x06, 0x02};
  out[4] = static_cast<uint8_t>(std::clamp(speeds.first, 1, capture::kViscaPanSpeeds));
  out[5] = static_cast<uint8_t>(std::clamp(speeds.second, 1, capture::kViscaTiltSpeeds));
  const auto put = [&out](size_t at, int value) {
    const auto bits = static_cast<uint16_t>(std::clamp(value, -32768, 32767));
    for (size_t i = 0; i < 4; ++i) out[at + i] = static_cast<uint8_t>(bits >> (12 - 4 * i) & 0xF);
  };
  put(6, counts.first);
  put(10, counts.second);
  out[14] = kEnd;
  return out;
}

namespace capture {

std::array<uint8_t, 15> format_visca_order(const HeadOrder& order, double count, double fastest) {
  const auto steps = [fastest](double rate, int most) {
    return static_cast<int>(std::floor(std::abs(rate) / fastest * most + 1e-6));
  };
  const std::pair<int, int> counts{static_cast<int>(std::lround(order.place.x() / count)),
                                   static_cast<int>(std::lround(order.place.y() / count))};
  return format_visca_position(
      counts, {steps(order.rate.x(), kViscaPanSpeeds), steps(order.rate.y(), kViscaTiltSpeeds)});
}

}  // namespace capture
AxisReading capture::visca_reading(const std::pair<int, int>& position, double count, double zoom,
                                   Time stamp) {
  AxisReading out;
  out.stamp = stamp;
  out.pan = position.first * count;
  out.tilt = position.second * count;
  out.zoom = zoom;
  return out;
}

}  // namespace sightline
