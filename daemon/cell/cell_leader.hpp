// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline {

/// The host of one cell that says that it keeps the estimates, as those see it who take them.
/// Passive; no clock of its own.
class CellLeader {
 public:
  /// `cell`: as the log names it; empty: the own one.
  explicit CellLeader(std::string cell) : cell_(std::move(cell)) {}

  enum class News { kNone, kAnother, kGone };
  /// What a host says of itself.
  News hear(const CellHostState& claim, Time now);
  /// Who says nothing anew for FusionClaim::kLapse is believed no more.
  News advance(Time now);

  bool is(uint64_t boot) const { return leader_ && leader_->boot == boot; }
  /// Empty: none is known.
  std::string host() const { return leader_ ? leader_->host : ""; }
  /// Its newest claim. Meaningful while there is one.
  Time heard() const { return heard_; }

 private:
  std::string named() const;

  const std::string cell_;
  std::optional<CellHostState> leader_;
  Time heard_{};
};

}  // namespace sightline
