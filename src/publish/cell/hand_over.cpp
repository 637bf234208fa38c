// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/hand_over.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace sightline {
namespace {

constexpr double kMetersPerRadian = 0.1;

int rank(TrackState state) {
  switch (state) {
    case TrackState::kTracking:
      return 3;
    case TrackState::kDegraded:
      return 2;
    case TrackState::kCoasting:
      return 1;
    default:
      return 0;
  }
}

bool surer(const EstimateWorth& one, const EstimateWorth& other, double margin) {
  if (!is_measured(one.state)) return false;
  if (rank(one.state) != rank(other.state)) return rank(one.state) > rank(other.state);
  return one.sigma < margin * other.sigma;
}

}  // namespace

EstimateWorth worth_of(const PoseEstimate& estimate) {
  if (!has_pose(estimate.state)) return {estimate.state, 0};
  return {estimate.state,
          std::hypot(estimate.sigma_translation(), kMetersPerRadian * estimate.sigma_rotation())};
}

bool HandOver::is_later(uint64_t term, const std::string& cell) const {
  return std::tie(term, cell) > std::tie(own_.term, cell_);
}

// Of the neighbors that keep it, the one in force.
const std::pair<const std::string, HandOver::Other>* HandOver::keeper() const {
  const std::pair<const std::string, Other>* found = nullptr;
  for (const auto& entry : others_) {
    if (!entry.second.said.holds) continue;
    if (found == nullptr || entry.second.said.term >= found->second.said.term) found = &entry;
  }
  return found;
}

std::string HandOver::holder() const {
  if (own_.holds) return cell_;
  const auto* const other = keeper();
  return other == nullptr ? "" : other->first;
}

void HandOver::note_end(const Other& other) {
  if (!other.said.holds || other.estimate == Time::min()) return;
  last_estimate_ = std::max(last_estimate_.value_or(other.estimate), other.estimate);
}

void HandOver::hear(const std::string& cell, const Holding& said, Time now) {
  Other& other = others_[cell];
  if (!said.holds) note_end(other);
  other.said = said;
  other.heard = now;
  greatest_ = std::max(greatest_, said.term);
}

void HandOver::hear_estimate(const std::string& cell, Time capture, Time now) {
  const auto other = others_.find(cell);
  if (other == others_.end()) return;
  other->second.heard = now;
  other->second.estimate = std::max(other->second.estimate, capture);
}

void HandOver::gone(const std::string& cell) {
  const auto other = others_.find(cell);
  if (other == others_.end()) return;
  died_ |= other->second.said.holds;
  note_end(other->second);
  others_.erase(other);
}

bool HandOver::publishes(Time capture) const {
  return own_.term != 0 && capture > own_.from && capture <= own_.until;
}

bool HandOver::step(const EstimateWorth& own, Time now, uint64_t utc_ns) {
  own_.worth = own;
  for (auto other = others_.begin(); other != others_.end();) {
    const auto next = std::next(other);
    if (now - other->second.heard > kSilence) gone(std::string(other->first));
    other = next;
  }
  if (!own_.holds) return take(own, now, utc_ns);
  return yield() || give(own, now, utc_ns);
}

// The one that is to go on has taken it, or another one keeps it and did so later.
bool HandOver::yield() {
  const auto* const other = keeper();
  if (other == nullptr || !is_later(other->second.said.term, other->first)) return false;
  if (own_.next != other->first) own_.until = std::min(own_.until, other->second.said.from);
  own_.holds = false;
  own_.next.clear();
  return true;
}

const std::string* HandOver::better_one(const EstimateWorth& own, Time now) {
  const std::string* best = nullptr;
  for (auto& [cell, other] : others_) {
    const EstimateWorth& worth = other.said.worth;
    if (!surer(worth, own, kMargin)) {
      other.better.reset();
      continue;
    }
    if (!other.better) other.better = now;
    if (is_measured(own.state) && now - *other.better < kPatience) continue;
    if (best == nullptr || surer(worth, others_[*best].said.worth, 1)) best = &cell;
  }
  return best;
}

bool HandOver::give(const EstimateWorth& own, Time now, uint64_t utc_ns) {
  if (!own_.next.empty()) {
    if (others_.contains(own_.next) && now < own_.until + kAnswer) return false;
    hold(own_.from, utc_ns);  // no answer
    return true;
  }
  const std::string* const next = better_one(own, now);
  if (next == nullptr) return false;
  own_.next = *next;
  // What this cell does not see it predicts worse with each frame. The other one has kept what it
  // made of the frames until it hears of this.
  own_.until = is_measured(own.state) ? now + kLead : now;
  return true;
}

bool HandOver::take(const EstimateWorth& own, Time now, uint64_t utc_ns) {
  if (const auto* const other = keeper()) {
    vacant_.reset();
    died_ = false;
    last_estimate_.reset();
    if (other->second.said.next != cell_ || !has_pose(own.state)) return false;
    hold(other->second.said.until, utc_ns);
    return true;
  }
  if (!vacant_) vacant_ = now;
  if (!has_pose(own.state)) return false;
  if (!died_ && now - *vacant_ < kListen) return false;
  // Two that begin at once hear of each other before the first frame is published.
  hold(last_estimate_.value_or(now + kListen), utc_ns);
  return true;
}

void HandOver::hold(Time from, uint64_t utc_ns) {
  greatest_ = std::max(greatest_ + 1, utc_ns);
  own_.holds = true;
  own_.term = greatest_;
  own_.from = from;
  own_.until = Time::max();
  own_.next.clear();
  vacant_.reset();
  last_estimate_.reset();
  died_ = false;
  for (auto& [cell, other] : others_) other.better.reset();
}

}  // namespace sightline
