// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "cell/cell_parts.hpp"

namespace sightline {

/// Which host of a cell keeps the estimates. One host says so by a retained message, again about
/// once a second, and is believed until it, or its last will, says otherwise, or says nothing new
/// for a while: brokers may keep what the dead have said. Of two that say so at once the one that
/// was started first goes on. Passive; no clock of its own.
class FusionClaim {
 public:
  explicit FusionClaim(CellIdentity self) : self_(std::move(self)) {}

  /// A connection stands: what is retained arrives within kListen.
  void connected(Time now) {
    settled_ = now + kListen;
    said_ = false;
    other_.reset();
  }
  /// What a host says of itself, ours included.
  void hear(const CellHostState& claim, Time now);
  /// Decides; true: the claim has to be published (again).
  bool step(Time now);

  /// This host's estimates are the cell's.
  bool holds() const { return holds_; }
  /// Who holds it instead; empty: nobody that is known.
  std::string other() const { return other_ ? other_->host : ""; }

  static constexpr Duration kListen = std::chrono::milliseconds(500);
  static constexpr Duration kSayEvery = std::chrono::seconds(1);
  static constexpr Duration kLapse = std::chrono::seconds(5);

 private:
  /// Whether the other one was there first.
  bool yields() const;

  CellIdentity self_;
  std::optional<CellHostState> other_;  // online, says that it keeps the estimates
  Time heard_{};                        // the newest of what it said
  std::optional<CellHostState> namesake_;
  Time said_at_{};
  Time settled_ = Time::max();
  bool holds_ = false, said_ = false;
};

}  // namespace sightline
