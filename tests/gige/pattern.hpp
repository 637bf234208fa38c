// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace sightline::gige {

/// Number of images before the first one comes again.
constexpr uint64_t kPatternPeriod = 1021;

enum class Layout : uint8_t {
  kBytes,       ///< 8-bit components
  kWords,       ///< 16-bit words, little endian, value in the low bits
  kGigePacked,  ///< "Mono12Packed"
  kPfncPacked,  ///< "Mono12p"
};

/// A pixel format as it travels; written from the standards (GigE Vision 2.0, PFNC 2.1) without
/// regard to the tables of the program under test.
struct WireFormat {
  std::string_view name;
  uint32_t code;
  Layout layout;
  int bits;        ///< of a component
  int components;  ///< of a pixel, in kBytes
};

std::span<const WireFormat> wire_formats();
const WireFormat* find_wire_format(uint32_t code);
const WireFormat* find_wire_format(std::string_view name);

/// Bytes of an image.
size_t image_bytes(const WireFormat& format, int width, int height);

/// One component: `i` counts components within the row. Depends on row and frame in such a way that
/// rows or frames that are mixed up show.
uint16_t pattern_value(int bits, int i, int y, uint64_t frame);

/// The whole image as it travels.
void draw_pattern(const WireFormat& format, int width, int height, uint64_t frame,
                  std::vector<uint8_t>& bytes);

}  // namespace sightline::gige
