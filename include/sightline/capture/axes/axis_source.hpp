// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/axis_history.hpp"
#include "sightline/geometry/head_drive.hpp"

namespace sightline {

/// Who tells the angles of a camera that turns.
enum class AxisProtocol : uint8_t {
  kNone,
  kFreed,        ///< FreeD D1 packets, sent to us over UDP
  kVisca,        ///< VISCA over IP: we ask
  kViscaSerial,  ///< VISCA over a serial line: we ask
  kOpenTrackIo,  ///< OpenTrackIO samples as JSON or CBOR, sent to us over UDP
  kOnvif,        ///< ONVIF PTZ over HTTP: we ask
  kV4l2,         ///< controls of a camera of the kernel (pan_absolute, ...): we ask
};

/// Whether its heads can be told to turn.
constexpr bool can_turn(AxisProtocol protocol) {
  return protocol == AxisProtocol::kVisca || protocol == AxisProtocol::kViscaSerial ||
         protocol == AxisProtocol::kOnvif || protocol == AxisProtocol::kV4l2;
}

/// How a head is told to turn, where it knows several ways (ONVIF, V4L2).
enum class HeadOrders : uint8_t {
  kAny,         ///< the first of those below that it has
  kAbsolute,    ///< go to a place
  kContinuous,  ///< turn at a rate until told otherwise
  kRelative,    ///< go by so much (ONVIF)
};

struct AxisSourceOptions {
  AxisProtocol protocol = AxisProtocol::kNone;
  /// FreeD, OpenTrackIO: own address to listen at, empty: any; VISCA, ONVIF: the camera's.
  std::string host;
  uint16_t port = 0;
  std::string interface;  ///< of a multicast group to join; empty: as the kernel routes it
  /// V4L2: which camera, as V4l2Options::device has it, empty: the camera's own; VISCA: the tty.
  std::string line;
  int device = -1;      ///< FreeD, OpenTrackIO: camera that counts; -1: any; serial VISCA: 1 .. 7
  int baud = 9600;      ///< of a serial line, 8N1
  std::string profile;  ///< ONVIF: token of the media profile; empty: the first
  std::string user;     ///< ONVIF; empty: without authentication
  std::filesystem::path password_file;  ///< its first line is the password; needed with `user` only
  double degrees_per_unit = 180;        ///< ONVIF: what its positions of -1 to 1 stand for
  double counts_per_degree = 10;        ///< VISCA, V4L2 (3600): what its positions count
  HeadOrders orders = HeadOrders::kAny;
  double fastest = 1.75;  ///< of a head that can be turned, at its fastest [rad/s]

  bool operator==(const AxisSourceOptions&) const = default;
};

/// "freed:PORT", "freed:ADDRESS:PORT", either with "/ID" behind; "visca:ADDRESS[:PORT]",
/// "visca:/dev/TTY[#CAMERA]", "v4l2[:DEVICE]" and others (docs/turning.md). Addresses are numbers.
/// `where` goes into errors.
Result<AxisSourceOptions> parse_axis_source(std::string_view text, const std::string& where);

/// Whether serial lines can be set to so many bits per second.
bool is_baud_rate(int baud);

/// A head's angles as they come in. One thread at a time.
class AxisSource {
 public:
  /// Datagrams that came: the good, and those that were no reading (another device's, a wrong
  /// checksum, nonsense).
  struct Counts {
    uint64_t good = 0, bad = 0;
    uint64_t ordered = 0, refused = 0;  ///< turns, and those that the head said it does not do
  };

  virtual ~AxisSource() = default;
  /// The next reading, stamped when it came (or, of what was asked for, halfway); nothing within
  /// `timeout`, at most 0.2 s. An Error: the source is of no use any more; open it again.
  virtual Result<std::optional<AxisReading>> next(Duration timeout) = 0;
  virtual Counts counts() const = 0;
  /// Tells the head to turn: angles and rates as the device counts them [rad]. What has not been
  /// sent yet is replaced; it goes out within next(), which tells whether it could. Only where
  /// can_turn().
  virtual void turn(const HeadOrder& order) { (void)order; }
};

/// `name`: of the camera, for errors.
Result<std::unique_ptr<AxisSource>> open_axis_source(const AxisSourceOptions& options,
                                                     const std::string& name);

/// A FreeD D1 packet of 29 bytes: pan and tilt in 1/32768 degree, zoom in counts. Empty: another
/// length or kind, a wrong checksum, angles beyond 360 degrees. `device`: its camera id.
std::optional<AxisReading> parse_freed(std::span<const uint8_t> packet, int* device = nullptr);

/// The answer to VISCA's inquiry of the position: two signed numbers of four half-bytes each.
/// Empty: anything else.
std::optional<std::pair<int, int>> parse_visca_position(std::span<const uint8_t> payload);
/// The same of the zoom.
std::optional<int> parse_visca_zoom(std::span<const uint8_t> payload);
/// VISCA's order to go to an absolute position: counts, and speeds 1 .. 24 (pan) and 1 .. 20
/// (tilt).
std::array<uint8_t, 15> format_visca_position(std::pair<int, int> counts,
                                              std::pair<int, int> speeds);

}  // namespace sightline
