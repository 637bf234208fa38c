// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <netinet/in.h>

#include <array>
#include <span>
#include <string>
#include <vector>

#include "camera.hpp"
#include "registers.hpp"
#include "sightline/base/unique_fd.hpp"
#include "streamer.hpp"

namespace sightline::gige {

/// The control protocol (GVCP) on port 3956: discovery, registers and memory, who is in control and
/// for how long, packets to send again, actions.
class Control {
 public:
  Control(in_addr address, Registers& registers, Camera& camera, Streamer& streamer,
          Faults& faults);

  /// False: the port is taken, or the address is not there.
  bool open(std::string& error);
  std::array<int, 3> sockets() const;
  /// Answers what waits at the sockets.
  void run();
  /// Takes control away from a client that has been silent for too long.
  void check_heartbeat(int64_t now_ns);
  /// As if the camera had restarted.
  void drop_control();
  /// The next answers of this many commands are preceded by "wait a little longer".
  void set_pending(int commands) { pending_ = commands; }

 private:
  struct Command {
    uint8_t flags;
    uint16_t code, id;
    std::span<const uint8_t> data;
    sockaddr_in from;
  };

  void answer(const Command& command, int64_t now_ns);
  void acknowledge(const Command& command, uint16_t code, std::span<const uint8_t> data,
                   uint16_t status = 0);
  void read_registers(const Command& command, int64_t now_ns);
  void write_registers(const Command& command, int64_t now_ns);
  void read_memory(const Command& command, int64_t now_ns);
  void write_memory(const Command& command, int64_t now_ns);
  void resend(const Command& command, int64_t now_ns);
  void action(const Command& command, int64_t now_ns);
  /// Status to answer: whether this client may write there.
  uint16_t check_write(const sockaddr_in& client, uint32_t address, size_t size) const;
  uint16_t write_privilege(const sockaddr_in& client, uint32_t value);
  bool in_control(const sockaddr_in& client) const;
  bool controlled() const { return controller_.sin_port != 0; }

  in_addr address_;
  Registers& registers_;
  Camera& camera_;
  Streamer& streamer_;
  Faults& faults_;
  UniqueFd own_, everybody_, subnet_;
  sockaddr_in controller_{};
  int64_t heard_ns_ = 0;
  int pending_ = 0;
};

}  // namespace sightline::gige
