// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace sightline::gige {

/// What goes wrong on purpose. Shares are probabilities per packet (loss, reorder, duplicate) or
/// per frame (the rest).
struct Faults {
  double loss = 0;
  double resend_loss = 0;  ///< of packets that are sent again
  double reorder = 0;      ///< sent late by reorder_ns, behind others
  double duplicate = 0;
  double no_leader = 0, no_trailer = 0;
  double short_leader = 0;  ///< the leader ends in the middle
  double wrong_size = 0;    ///< the leader claims half the height
  int64_t reorder_ns = 500'000;
  int64_t delay_ns = 0;         ///< of every packet
  int64_t jitter_ns = 0;        ///< mean of an exponentially distributed delay of whole frames
  int64_t stamp_jitter_ns = 0;  ///< standard deviation of device stamps
  enum class Resend { kOn, kOff, kRefuse } resend = Resend::kOn;
  bool silent = false;    ///< streams nothing
  bool no_stamp = false;  ///< stamps are zero
  bool deaf = false;      ///< answers no command
  int64_t answer_ns = 0;  ///< what it takes for each
};

}  // namespace sightline::gige
