// SPDX-License-Identifier: Apache-2.0
//
// What tells the angles of cameras that turn: datagrams and addresses. The first byte chooses.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "capture/axes/onvif_messages.hpp"
#include "capture/axes/visca_line.hpp"
#include "sightline/base/check.hpp"
#include "sightline/capture/axes/axis_source.hpp"
#include "sightline/capture/axes/opentrackio.hpp"

using namespace sightline;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::span<const uint8_t> bytes(data + 1, size - 1);
  switch (data[0]) {
    case 'f':
      if (const auto reading = parse_freed(bytes)) {
        SL_CHECK(std::abs(reading->pan) < 6.3 && std::abs(reading->tilt) < 6.3, "within a turn");
      }
      break;
    case 'v':
      if (const auto position = parse_visca_position(bytes)) {
        SL_CHECK(std::abs(position->first) <= 32768, "16 bits");
      }
      (void)parse_visca_zoom(bytes);
      break;
    case 's': {
      capture::ViscaFramer framer;
      uint64_t whole = 0;
      for (const uint8_t byte : bytes) {
        const auto message = framer.push(byte);
        if (!message) continue;
        SL_CHECK(message->length <= 16 && message->span().back() == 0xFF, "bounded, ended");
        whole += message->length;
        (void)capture::kind_of(message->span());
        SL_CHECK(capture::sender_of(message->span()) < 8, "seven cameras");
      }
      SL_CHECK(whole + framer.dropped() <= bytes.size(), "no byte counts twice");
      break;
    }
    case 'o': {
      OpenTrackIoAssembler assembler;
      if (assembler.add(bytes) != OpenTrackIoAssembler::Outcome::kSample) break;
      const auto sample = assembler.read();
      if (sample) SL_CHECK(std::abs(sample->reading.pan) < 6.3, "within a turn");
      break;
    }
    case 'c': {
      const auto sample =
          parse_opentrackio_cbor({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
      if (sample) SL_CHECK(std::abs(sample->reading.tilt) < 6.3, "within a turn");
      break;
    }
    case '<': {
      const std::string_view xml(reinterpret_cast<const char*>(data), size);
      const auto status = capture::parse_onvif_status(xml);
      if (status) SL_CHECK(std::abs(status->pan) <= 360, "within a turn");
      (void)capture::parse_onvif_path(xml, "PTZ");
      (void)capture::parse_onvif_profile(xml, "");
      (void)capture::parse_onvif_node(xml, "one");
      (void)capture::parse_onvif_moves(xml, "n1");
      SL_CHECK(capture::parse_onvif_fault(xml).size() <= 200, "short");
      break;
    }
    default: {
      const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      const auto options = parse_axis_source(text, "axes");
      if (options) {
        const bool local = options->protocol == AxisProtocol::kViscaSerial ||
                           options->protocol == AxisProtocol::kV4l2;
        SL_CHECK(local || options->port > 0, "a source has a port");
      }
    }
  }
  return 0;
}
