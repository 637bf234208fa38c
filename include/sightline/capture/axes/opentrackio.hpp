// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sightline/geometry/axis_history.hpp"

namespace sightline {

/// What one OpenTrackIO sample says of a head.
struct OpenTrackIoSample {
  AxisReading reading;                 ///< without stamp
  int source = -1;                     ///< sourceNumber; -1: it says none
  std::optional<int64_t> device_ns{};  ///< timing.sampleTimestamp, on its own clock
};

/// A sample as JSON (SMPTE RIS OSVP, OpenTrackIO 1.0): pan and tilt [deg] of the transform with id
/// "Camera", else of the last; zoom of lens.rawEncoders, else of lens.encoders. Empty: no JSON,
/// another protocol, no rotation, angles beyond 360 degrees.
std::optional<OpenTrackIoSample> parse_opentrackio(std::string_view json);

/// The same in CBOR (RFC 8949), the same keys and values. Empty also: tags, strings in pieces,
/// nesting deeper than 16.
std::optional<OpenTrackIoSample> parse_opentrackio_cbor(std::string_view cbor);

/// Puts samples together from datagrams: a header of 16 bytes ("OTrk", reserved, encoding, sequence
/// number, offset of the segment, flag of the last one and length, Fletcher-16 over what comes
/// before it and the payload), big-endian. Segments come in order; one that is missing spoils its
/// sample. A datagram that begins with "{" is a sample by itself.
class OpenTrackIoAssembler {
 public:
  enum class Outcome : uint8_t {
    kBad,     ///< no packet of it, a wrong checksum or length, out of order
    kPart,    ///< more is to come
    kSample,  ///< sample() is whole
  };
  Outcome add(std::span<const uint8_t> datagram);
  const std::string& sample() const { return sample_; }
  /// What that says, by the encoding of its header.
  std::optional<OpenTrackIoSample> read() const;

  static constexpr size_t kLongest = 1 << 16;  ///< of a sample [bytes]

 private:
  std::string sample_;
  int sequence_ = -1;
  uint8_t encoding_ = 0;
};

}  // namespace sightline
