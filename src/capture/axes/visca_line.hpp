// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::capture {

/// A message of VISCA's serial form, with the byte of addresses before and 0xFF behind.
struct ViscaMessage {
  std::array<uint8_t, 16> bytes{};  ///< as many as it may have
  size_t length = 0;

  std::span<const uint8_t> span() const { return std::span(bytes).first(length); }
};

/// What a message says.
enum class ViscaKind : uint8_t {
  kNonsense,
  kAcknowledged,   ///< of an order
  kDone,           ///< an order has been carried out
  kAnswer,         ///< to an inquiry
  kRefused,        ///< an inquiry or an order
  kCanceled,       ///< an order, by a newer one
  kChainChanged,   ///< a camera joined the line or left it: addresses are to be given anew
  kAddressesGiven  ///< by AddressSet; the number behind the last camera's
};
ViscaKind kind_of(std::span<const uint8_t> message);
/// Of a camera's message: 1 .. 7; of others 0.
int sender_of(std::span<const uint8_t> message);

/// Takes messages out of a stream of bytes. What began without an end is dropped at the next
/// beginning, so half a message spoils one message at most.
class ViscaFramer {
 public:
  std::optional<ViscaMessage> push(uint8_t byte);
  void clear() { message_.length = 0; }
  /// Bytes that belonged to no message.
  uint64_t dropped() const { return dropped_; }

 private:
  ViscaMessage message_;
  uint64_t dropped_ = 0;
};

/// A serial line with up to seven cameras on it, one after another, which their sources share: one
/// question at a time. Any thread.
class ViscaLine {
 public:
  /// The line that is open already, else opens it (8N1, no flow control), and gives addresses to
  /// its cameras. Errors: kUnavailable (not there, in use, no permission), kInvalidInput (no serial
  /// line; another user wants another rate). Takes 0.7 s at the longest.
  static Result<std::shared_ptr<ViscaLine>> open(const std::string& path, int baud,
                                                 const std::string& name);
  ~ViscaLine();
  ViscaLine(const ViscaLine&) = delete;
  ViscaLine& operator=(const ViscaLine&) = delete;

  struct Answer {
    ViscaMessage message;
    Time stamp{};  ///< halfway between the end of the question and the beginning of the answer
  };
  /// Sends `message` (its first byte is replaced by the camera's address) and waits for what the
  /// camera says to it: an answer, an acknowledgment, or a refusal. Empty: nothing within 0.1 s, or
  /// the line was busy for as long. An Error: the line is of no use any more; open it again.
  Result<std::optional<Answer>> exchange(int camera, std::span<const uint8_t> message);
  /// Orders of this camera that it refused later than at once, since this was asked last.
  uint64_t take_refused(int camera);
  /// How many cameras took an address; 0: none said so, as those with fixed ones do not.
  int cameras() const { return cameras_; }
  uint64_t dropped() const;

 private:
  ViscaLine(UniqueFd fd, std::string path, int baud, std::string name);
  void give_addresses();
  Status send(std::span<const uint8_t> bytes);
  Result<std::optional<ViscaMessage>> receive(Time deadline);
  void note(const ViscaMessage& message);
  Error broken(const std::string& what);
  Duration lasts(size_t bytes) const;

  mutable std::timed_mutex mutex_;  ///< guards what follows
  UniqueFd fd_;
  const std::string path_, name_;
  const int baud_;
  ViscaFramer framer_;
  std::array<uint8_t, 256> waiting_{};  ///< read, and not looked at yet
  size_t begin_ = 0, end_ = 0;
  std::array<uint64_t, 8> refused_{};
  int cameras_ = 0;
  bool broken_ = false;
};

}  // namespace sightline::capture
