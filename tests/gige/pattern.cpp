// SPDX-License-Identifier: Apache-2.0
#include "pattern.hpp"

#include <array>
#include <cstring>

namespace sightline::gige {
namespace {

constexpr std::array kFormats = std::to_array<WireFormat>({
    {"Mono8", 0x01080001, Layout::kBytes, 8, 1},
    {"Mono10", 0x01100003, Layout::kWords, 10, 1},
    {"Mono12", 0x01100005, Layout::kWords, 12, 1},
    {"Mono16", 0x01100007, Layout::kWords, 16, 1},
    {"Mono10Packed", 0x010C0004, Layout::kGigePacked, 10, 1},
    {"Mono12Packed", 0x010C0006, Layout::kGigePacked, 12, 1},
    {"Mono10p", 0x010A0046, Layout::kPfncPacked, 10, 1},
    {"Mono12p", 0x010C0047, Layout::kPfncPacked, 12, 1},
    {"BayerRG8", 0x01080009, Layout::kBytes, 8, 1},
    {"BayerGR8", 0x01080008, Layout::kBytes, 8, 1},
    {"BayerGB8", 0x0108000A, Layout::kBytes, 8, 1},
    {"BayerBG8", 0x0108000B, Layout::kBytes, 8, 1},
    {"BayerRG10", 0x0110000D, Layout::kWords, 10, 1},
    {"BayerRG12", 0x01100011, Layout::kWords, 12, 1},
    {"BayerRG12Packed", 0x010C002B, Layout::kGigePacked, 12, 1},
    {"BayerRG10p", 0x010A0058, Layout::kPfncPacked, 10, 1},
    {"BayerRG12p", 0x010C0059, Layout::kPfncPacked, 12, 1},
    {"RGB8", 0x02180014, Layout::kBytes, 8, 3},
    {"BGR8", 0x02180015, Layout::kBytes, 8, 3},
    {"YUV422_8", 0x02100032, Layout::kBytes, 8, 2},
    {"YUV422_8_UYVY", 0x0210001F, Layout::kBytes, 8, 2},
});

using Table = std::array<uint16_t, kPatternPeriod>;

// Bits without an order that a camera's image could have.
const Table& table() {
  static const Table values = [] {
    Table made{};
    uint32_t state = 0x12345678;
    for (uint16_t& value : made) {
      state = state * 1664525 + 1013904223;
      value = static_cast<uint16_t>(state >> 16);
    }
    return made;
  }();
  return values;
}

size_t start_of_row(int y, uint64_t frame) {
  return static_cast<size_t>((uint64_t{37} * static_cast<uint64_t>(y) + 101 * frame) %
                             kPatternPeriod);
}

// One component after another, least significant bit first, without gaps.
void put_stream(uint8_t* to, int bits, int count, const auto& value) {
  uint32_t waiting = 0;
  int filled = 0;
  for (int i = 0; i < count; ++i) {
    waiting |= uint32_t{value(i)} << filled;
    for (filled += bits; filled >= 8; filled -= 8, waiting >>= 8) {
      *to++ = static_cast<uint8_t>(waiting);
    }
  }
  if (filled > 0) *to = static_cast<uint8_t>(waiting);
}

// Two components in three bytes: the upper eight bits of both outside, the rest in the middle.
void put_gige(uint8_t* to, int bits, unsigned first, unsigned second) {
  const int low = bits - 8;
  const unsigned mask = (1u << low) - 1;
  to[0] = static_cast<uint8_t>(first >> low);
  to[1] = static_cast<uint8_t>((first & mask) | (second & mask) << 4);
  to[2] = static_cast<uint8_t>(second >> low);
}

}  // namespace

std::span<const WireFormat> wire_formats() { return kFormats; }

const WireFormat* find_wire_format(uint32_t code) {
  for (const WireFormat& format : kFormats) {
    if (format.code == code) return &format;
  }
  return nullptr;
}

const WireFormat* find_wire_format(std::string_view name) {
  for (const WireFormat& format : kFormats) {
    if (format.name == name) return &format;
  }
  return nullptr;
}

size_t image_bytes(const WireFormat& format, int width, int height) {
  const auto pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  switch (format.layout) {
    case Layout::kBytes:
      return pixels * static_cast<size_t>(format.components);
    case Layout::kWords:
      return pixels * 2;
    case Layout::kGigePacked:
      return pixels * 3 / 2;
    case Layout::kPfncPacked:
      break;
  }
  return pixels * static_cast<size_t>(format.bits) / 8;
}

uint16_t pattern_value(int bits, int i, int y, uint64_t frame) {
  const size_t at = (start_of_row(y, frame) + static_cast<size_t>(i)) % kPatternPeriod;
  return static_cast<uint16_t>(table()[at] >> (16 - bits));
}

void draw_pattern(const WireFormat& format, int width, int height, uint64_t frame,
                  std::vector<uint8_t>& bytes) {
  bytes.assign(image_bytes(format, width, height), 0);
  const size_t row_bytes = bytes.size() / static_cast<size_t>(height);
  for (int y = 0; y < height; ++y) {
    const size_t row = row_bytes * static_cast<size_t>(y);
    const auto value = [&](int i) { return pattern_value(format.bits, i, y, frame); };
    switch (format.layout) {
      case Layout::kBytes:
        for (size_t i = 0, at = start_of_row(y, frame); i < row_bytes; ++i) {
          bytes[row + i] = static_cast<uint8_t>(table()[at] >> 8);
          if (++at == kPatternPeriod) at = 0;
        }
        break;
      case Layout::kWords:
        for (int i = 0; i < width; ++i) {
          bytes[row + static_cast<size_t>(i) * 2] = static_cast<uint8_t>(value(i) & 0xFF);
          bytes[row + static_cast<size_t>(i) * 2 + 1] = static_cast<uint8_t>(value(i) >> 8);
        }
        break;
      case Layout::kGigePacked:
        for (int i = 0; i + 1 < width; i += 2) {
          put_gige(&bytes[row + static_cast<size_t>(i) / 2 * 3], format.bits, value(i),
                   value(i + 1));
        }
        break;
      case Layout::kPfncPacked:
        put_stream(&bytes[row], format.bits, width, value);
        break;
    }
  }
}

}  // namespace sightline::gige
