// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace sightline {

enum class NalType : uint8_t {
  kSlice = 1,
  kIdrSlice = 5,
  kSei = 6,
  kSequenceParameters = 7,
  kPictureParameters = 8,
  kDelimiter = 9,
};

/// One NAL unit of an Annex B byte stream.
struct NalUnit {
  size_t begin = 0;               ///< of its start code, leading zeros included
  uint8_t type = 0;               ///< nal_unit_type, see NalType
  std::span<const uint8_t> body;  ///< header byte and what follows, trailing zeros taken off

  bool is_slice() const { return type >= 1 && type <= 5; }
};

/// Walks the NAL units of an Annex B byte stream in order (ITU-T H.264, annex B).
class NalReader {
 public:
  explicit NalReader(std::span<const uint8_t> stream) : stream_(stream) {}
  /// The next unit, or empty at the end. Units without a header byte are skipped.
  std::optional<NalUnit> next();

 private:
  std::span<const uint8_t> stream_;
  size_t at_ = 0;
};

/// Puts 03 after every 00 00 that is followed by 00 .. 03 or ends the unit (7.4.1), and takes it
/// out again.
void append_escaped(std::span<const uint8_t> raw, std::vector<uint8_t>& to);
std::vector<uint8_t> unescaped(std::span<const uint8_t> escaped);

}  // namespace sightline
