// SPDX-License-Identifier: Apache-2.0
#include "cell/fusion_claim.hpp"

#include <tuple>

namespace sightline {

void FusionClaim::hear(const CellHostState& claim, Time now) {
  const bool own = claim.boot == self_.boot;
  if (own && claim.online) return;
  if (!own && claim.host == self_.host) {
    // Most likely what this host's daemon said before it died; who goes on saying it is alive.
    const bool alive = namesake_ && namesake_->boot == claim.boot && namesake_->beat != claim.beat;
    namesake_ = claim;
    if (!alive) return;
  }
  said_ = false;  // it has taken the place of what we said; so has our own last will
  if (own) return;
  if (claim.online) {
    const bool news = !other_ || other_->boot != claim.boot || other_->beat != claim.beat;
    if (news) heard_ = now;
    other_ = claim;
  } else if (other_ && other_->boot == claim.boot) {
    other_.reset();
  }
}

bool FusionClaim::yields() const {
  return other_ && std::tie(other_->since_utc_ns, other_->host, other_->boot) <
                       std::tie(self_.since_utc_ns, self_.host, self_.boot);
}

bool FusionClaim::step(Time now) {
  if (now < settled_) return false;
  if (other_ && now - heard_ > kLapse) other_.reset();
  if (yields()) {
    holds_ = false;
    return false;
  }
  if (!holds_) said_ = false;
  holds_ = true;
  other_.reset();
  if (said_ && now - said_at_ < kSayEvery) return false;
  said_ = true;
  said_at_ = now;
  return true;
}

}  // namespace sightline
