// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_leader.hpp"

#include "cell/fusion_claim.hpp"
#include "sightline/base/log.hpp"

namespace sightline {

std::string CellLeader::named() const { return cell_.empty() ? "" : " of cell " + cell_; }

CellLeader::News CellLeader::hear(const CellHostState& claim, Time now) {
  if (!claim.online) {
    if (!is(claim.boot)) return News::kNone;
    log::warning({.cause = "cell"}, "cell: host {}{} keeps the estimates no more", leader_->host,
                 named());
    leader_.reset();
    return News::kGone;
  }
  if (is(claim.boot)) {
    if (leader_->beat != claim.beat) heard_ = now;
    leader_->beat = claim.beat;
    return News::kNone;
  }
  log::info({.cause = "cell"}, "cell: host {}{} keeps the estimates", claim.host, named());
  leader_ = claim;
  heard_ = now;
  return News::kAnother;
}

CellLeader::News CellLeader::advance(Time now) {
  if (!leader_ || now - heard_ <= FusionClaim::kLapse) return News::kNone;
  log::warning({.cause = "cell"},
               "cell: nothing is heard any more of host {}{}, which keeps the estimates",
               leader_->host, named());
  leader_.reset();
  return News::kGone;
}

}  // namespace sightline
