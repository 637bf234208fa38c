// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/genicam_formats.hpp"

#include <array>

#include "sightline/base/check.hpp"

namespace sightline::capture {
namespace {

constexpr BayerPattern kMono = BayerPattern::kNone;
constexpr BayerPattern kRg = BayerPattern::kRg, kGr = BayerPattern::kGr, kGb = BayerPattern::kGb,
                       kBg = BayerPattern::kBg;
constexpr Packing kWhole = Packing::kNone, kGige = Packing::kGige, kBitStream = Packing::kBitStream;

constexpr std::array kFormats = std::to_array<GenicamFormat>({
    {"Mono8", 0x01080001, kWhole, 8, kMono, PixelFormat::kGray},
    {"YUV422_8", 0x02100032, kWhole, 8, kMono, PixelFormat::kYuyv},
    {"YUV422_8_UYVY", 0x0210001F, kWhole, 8, kMono, PixelFormat::kUyvy},
    {"RGB8", 0x02180014, kWhole, 8, kMono, PixelFormat::kRgb24},
    {"BGR8", 0x02180015, kWhole, 8, kMono, PixelFormat::kBgr24},
    {"BayerRG8", 0x01080009, kWhole, 8, kRg, PixelFormat::kI420},
    {"BayerGR8", 0x01080008, kWhole, 8, kGr, PixelFormat::kI420},
    {"BayerGB8", 0x0108000A, kWhole, 8, kGb, PixelFormat::kI420},
    {"BayerBG8", 0x0108000B, kWhole, 8, kBg, PixelFormat::kI420},
    {"Mono10", 0x01100003, kWhole, 10, kMono, PixelFormat::kY10},
    {"Mono12", 0x01100005, kWhole, 12, kMono, PixelFormat::kY12},
    {"Mono16", 0x01100007, kWhole, 16, kMono, PixelFormat::kY16},
    {"Mono10Packed", 0x010C0004, kGige, 10, kMono, PixelFormat::kY10},
    {"Mono12Packed", 0x010C0006, kGige, 12, kMono, PixelFormat::kY12},
    {"Mono10p", 0x010A0046, kBitStream, 10, kMono, PixelFormat::kY10},
    {"Mono12p", 0x010C0047, kBitStream, 12, kMono, PixelFormat::kY12},
    {"BayerGR10", 0x0110000C, kWhole, 10, kGr, PixelFormat::kI420},
    {"BayerRG10", 0x0110000D, kWhole, 10, kRg, PixelFormat::kI420},
    {"BayerGB10", 0x0110000E, kWhole, 10, kGb, PixelFormat::kI420},
    {"BayerBG10", 0x0110000F, kWhole, 10, kBg, PixelFormat::kI420},
    {"BayerGR12", 0x01100010, kWhole, 12, kGr, PixelFormat::kI420},
    {"BayerRG12", 0x01100011, kWhole, 12, kRg, PixelFormat::kI420},
    {"BayerGB12", 0x01100012, kWhole, 12, kGb, PixelFormat::kI420},
    {"BayerBG12", 0x01100013, kWhole, 12, kBg, PixelFormat::kI420},
    {"BayerGR16", 0x0110002E, kWhole, 16, kGr, PixelFormat::kI420},
    {"BayerRG16", 0x0110002F, kWhole, 16, kRg, PixelFormat::kI420},
    {"BayerGB16", 0x01100030, kWhole, 16, kGb, PixelFormat::kI420},
    {"BayerBG16", 0x01100031, kWhole, 16, kBg, PixelFormat::kI420},
    {"BayerGR10Packed", 0x010C0026, kGige, 10, kGr, PixelFormat::kI420},
    {"BayerRG10Packed", 0x010C0027, kGige, 10, kRg, PixelFormat::kI420},
    {"BayerGB10Packed", 0x010C0028, kGige, 10, kGb, PixelFormat::kI420},
    {"BayerBG10Packed", 0x010C0029, kGige, 10, kBg, PixelFormat::kI420},
    {"BayerGR12Packed", 0x010C002A, kGige, 12, kGr, PixelFormat::kI420},
    {"BayerRG12Packed", 0x010C002B, kGige, 12, kRg, PixelFormat::kI420},
    {"BayerGB12Packed", 0x010C002C, kGige, 12, kGb, PixelFormat::kI420},
    {"BayerBG12Packed", 0x010C002D, kGige, 12, kBg, PixelFormat::kI420},
    {"BayerBG10p", 0x010A0052, kBitStream, 10, kBg, PixelFormat::kI420},
    {"BayerGB10p", 0x010A0054, kBitStream, 10, kGb, PixelFormat::kI420},
    {"BayerGR10p", 0x010A0056, kBitStream, 10, kGr, PixelFormat::kI420},
    {"BayerRG10p", 0x010A0058, kBitStream, 10, kRg, PixelFormat::kI420},
    {"BayerBG12p", 0x010C0053, kBitStream, 12, kBg, PixelFormat::kI420},
    {"BayerGB12p", 0x010C0055, kBitStream, 12, kGb, PixelFormat::kI420},
    {"BayerGR12p", 0x010C0057, kBitStream, 12, kGr, PixelFormat::kI420},
    {"BayerRG12p", 0x010C0059, kBitStream, 12, kRg, PixelFormat::kI420},
});

// Samples are stored in a multiple of these many bits of memory.
size_t bits_in_memory(const GenicamFormat& format) {
  switch (format.format) {
    case PixelFormat::kRgb24:
    case PixelFormat::kBgr24:
      return 24;
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy:
      return 16;
    default:
      break;
  }
  if (format.packing == kGige) return 12;  // of 10-bit samples as well: two bits are unused
  if (format.packing == kBitStream) return static_cast<size_t>(format.bits);
  return format.bits > 8 ? 16 : 8;
}

uint16_t word(unsigned value) { return static_cast<uint16_t>(value); }

void unpack_gige(int bits, const uint8_t* from, int width, uint16_t* to) {
  const unsigned low = static_cast<unsigned>(bits) - 8;
  const unsigned mask = (1u << low) - 1;
  for (int x = 0; x < width; x += 2, from += 3) {
    to[x] = word(unsigned{from[0]} << low | (from[1] & mask));
    to[x + 1] = word(unsigned{from[2]} << low | (unsigned{from[1]} >> 4 & mask));
  }
}

void unpack_stream_12(const uint8_t* from, int width, uint16_t* to) {
  for (int x = 0; x < width; x += 2, from += 3) {
    to[x] = word(from[0] | (from[1] & 0x0Fu) << 8);
    to[x + 1] = word(unsigned{from[1]} >> 4 | unsigned{from[2]} << 4);
  }
}

void unpack_stream_10(const uint8_t* from, int width, uint16_t* to) {
  for (int x = 0; x < width; x += 4, from += 5) {
    to[x] = word(from[0] | (from[1] & 0x03u) << 8);
    to[x + 1] = word(unsigned{from[1]} >> 2 | (from[2] & 0x0Fu) << 6);
    to[x + 2] = word(unsigned{from[2]} >> 4 | (from[3] & 0x3Fu) << 4);
    to[x + 3] = word(unsigned{from[3]} >> 6 | unsigned{from[4]} << 2);
  }
}

}  // namespace

std::span<const GenicamFormat> genicam_formats() { return kFormats; }

const GenicamFormat* find_genicam_format(uint32_t code) {
  for (const GenicamFormat& format : kFormats) {
    if (format.code == code) return &format;
  }
  return nullptr;
}

const GenicamFormat* find_genicam_format(std::string_view name) {
  for (const GenicamFormat& format : kFormats) {
    if (format.name == name) return &format;
  }
  return nullptr;
}

size_t genicam_row_bytes(const GenicamFormat& format, int width) {
  const size_t bits = static_cast<size_t>(width) * bits_in_memory(format);
  // A row of packed samples must also hold whole groups, which the unpackers take at once.
  const bool whole = format.packing == kGige || format.bits == 12 ? width % 2 == 0 : width % 4 == 0;
  if (format.packing != kWhole && !whole) return 0;
  if (format.format == PixelFormat::kYuyv || format.format == PixelFormat::kUyvy) {
    return static_cast<size_t>(width + 1) / 2 * 4;
  }
  return bits / 8;
}

void unpack_row(Packing packing, int bits, const uint8_t* from, int width, uint16_t* to) {
  SL_CHECK(packing != Packing::kNone && (bits == 10 || bits == 12), "not a packed format");
  if (packing == kGige) return unpack_gige(bits, from, width, to);
  if (bits == 12) return unpack_stream_12(from, width, to);
  unpack_stream_10(from, width, to);
}

}  // namespace sightline::capture
