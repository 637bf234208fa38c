// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "sightline/base/result.hpp"

namespace sightline {

struct GigeActionKeys {
  uint32_t device_key = 1, group_key = 1, group_mask = 1;
  bool operator==(const GigeActionKeys&) const = default;
};

/// An action command of GigE Vision: one packet that triggers all cameras whose device key and
/// group key are these and whose group mask has a bit in common (their trigger is "Action1").
struct GigeAction {
  std::string address = "255.255.255.255";  ///< a broadcast address, or one camera's
  GigeActionKeys keys;
  bool operator==(const GigeAction&) const = default;
};

/// Sends it once, without an answer. Any thread. kInvalidInput: no address; kUnavailable: no way
/// there.
Status fire_gige_action(const GigeAction& action);

}  // namespace sightline
