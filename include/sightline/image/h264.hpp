// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace sightline {

/// The H.264 byte stream (ITU-T H.264, annex B) as cameras send it, recordings keep it and streams
/// carry it. Plain functions of the bytes; damaged input gives what could be read.

/// nal_unit_type (table 7-1).
enum class NalType : uint8_t {
  kSlice = 1,
  kIdrSlice = 5,
  kSei = 6,
  kSequenceParameterSet = 7,
  kPictureParameterSet = 8,
  kDelimiter = 9,
};

/// Of a unit without its start code; `body` is not empty.
inline NalType nal_type(std::span<const uint8_t> body) {
  return static_cast<NalType>(body[0] & 0x1f);
}

/// One NAL unit of a byte stream.
struct NalUnit {
  size_t begin = 0;               ///< position of its start code, leading zeros included
  NalType type{};                 ///< also values that have no name here
  std::span<const uint8_t> body;  ///< header byte and what follows, trailing zeros taken off

  bool is_slice() const {
    return static_cast<uint8_t>(type) >= 1 && static_cast<uint8_t>(type) <= 5;
  }
};

/// Walks the NAL units of a byte stream in order.
class NalReader {
 public:
  explicit NalReader(std::span<const uint8_t> stream) : stream_(stream) {}
  /// The next unit, or empty at the end. Units without a header byte are skipped.
  std::optional<NalUnit> next();

 private:
  std::span<const uint8_t> stream_;
  size_t at_ = 0;
};

/// Appends a start code of four bytes and the unit.
void append_nal_unit(std::span<const uint8_t> body, std::vector<uint8_t>& to);

/// SPS and PPS of an access unit, each with a start code; empty unless it has both.
std::vector<uint8_t> annex_b_parameter_sets(std::span<const uint8_t> access_unit);
/// The access unit holds an IDR slice: nothing after it refers to what came before.
bool annex_b_has_idr(std::span<const uint8_t> access_unit);
/// A decoder can begin with the access unit: an IDR slice or an SPS comes before any other slice.
bool annex_b_can_start_decoding(std::span<const uint8_t> access_unit);

/// Emulation prevention (7.4.1): puts 03 after every 00 00 that is followed by 00 .. 03 or ends the
/// unit, and takes it out again.
void append_escaped(std::span<const uint8_t> raw, std::vector<uint8_t>& to);
std::vector<uint8_t> unescaped(std::span<const uint8_t> escaped);

}  // namespace sightline
