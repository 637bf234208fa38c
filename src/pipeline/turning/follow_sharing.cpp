// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/turning/follow_sharing.hpp"

#include <algorithm>
#include <tuple>

namespace sightline {
namespace {

const FollowBid* bid_for(std::span<const FollowBid> bids, ObjectId object) {
  const auto found = std::ranges::find(bids, object, &FollowBid::object);
  return found == bids.end() ? nullptr : &*found;
}

/// Objects and heads, while they are matched.
class Matching {
 public:
  explicit Matching(std::span<const BiddingHead> heads) : heads_(heads), chosen_(heads.size()) {
    for (const BiddingHead& head : heads) {
      for (const FollowBid& bid : head.bids) add(bid);
    }
    std::ranges::sort(objects_, {},
                      [](const Wanted& one) { return std::tuple(one.rank, one.object.index()); });
  }

  // What no range reaches is looked after at the range's end, by heads that have nothing to do.
  void match() {
    for (const bool within : {true, false}) {
      for (const Wanted& wanted : objects_) {
        if (std::ranges::find(chosen_, std::optional(wanted.object)) != chosen_.end()) continue;
        std::vector<bool> visited(heads_.size());
        place(wanted.object, within, visited);
      }
    }
  }

  std::optional<ObjectId> chosen(size_t head) const { return chosen_[head]; }

 private:
  struct Wanted {
    ObjectId object;
    int rank;
  };
  void add(const FollowBid& bid) {
    const auto found = std::ranges::find(objects_, bid.object, &Wanted::object);
    if (found == objects_.end()) {
      objects_.push_back({bid.object, bid.rank});
    } else {
      found->rank = std::min(found->rank, bid.rank);
    }
  }

  // Who has it already comes first, who would have to give something up last.
  std::vector<size_t> candidates(ObjectId object, bool within) const {
    using Key = std::tuple<int, int, double, size_t>;
    std::vector<Key> keys;
    for (size_t i = 0; i < heads_.size(); ++i) {
      const BiddingHead& head = heads_[i];
      const FollowBid* const bid = bid_for(head.bids, object);
      if (bid == nullptr || bid->within != within) continue;
      const bool busy = head.had && bid_for(head.bids, head.had->object) != nullptr;
      const bool same = head.had && head.had->object == object;
      const int key = same ? (head.had->beside ? 1 : 0) : (busy ? 3 : 2);
      keys.emplace_back(key, bid->rank, bid->away, i);
    }
    std::ranges::sort(keys);
    std::vector<size_t> out;
    for (const Key& key : keys) out.push_back(std::get<3>(key));
    return out;
  }

  // As deep as there are heads.
  bool place(ObjectId object, bool within, std::vector<bool>& visited) {
    const std::vector<size_t> heads = candidates(object, within);
    for (const size_t head : heads) {
      if (chosen_[head]) continue;
      chosen_[head] = object;
      return true;
    }
    if (!within) return false;
    for (const size_t head : heads) {
      if (visited[head]) continue;
      visited[head] = true;
      if (!place(*chosen_[head], within, visited)) continue;
      chosen_[head] = object;
      return true;
    }
    return false;
  }

  std::span<const BiddingHead> heads_;
  std::vector<Wanted> objects_;
  std::vector<std::optional<ObjectId>> chosen_;
};

}  // namespace

std::vector<std::optional<HeadShare>> share_objects(std::span<const BiddingHead> heads) {
  Matching matching(heads);
  matching.match();
  std::vector<std::optional<HeadShare>> out(heads.size());
  for (size_t i = 0; i < heads.size(); ++i) {
    if (const auto own = matching.chosen(i)) {
      out[i] = HeadShare{*own};
      continue;
    }
    if (heads[i].bids.empty()) continue;
    const auto first = std::ranges::min_element(
        heads[i].bids, {}, [](const FollowBid& bid) { return std::tuple(!bid.within, bid.rank); });
    out[i] = HeadShare{first->object, true};
  }
  return out;
}

BiddingHead FollowSharing::bidding(const Head& head) const {
  BiddingHead out{head.bids, {}};
  if (!head.had) return out;
  out.had = HeadShare{head.had->object, head.beside};
  const bool kept =
      bid_for(head.bids, head.had->object) == nullptr && head.asked - head.had_seen < kKept;
  if (kept) out.bids.push_back(*head.had);
  return out;
}

std::optional<ObjectId> FollowSharing::choose(int head, Time now, std::span<const FollowBid> bids) {
  const std::lock_guard lock(mutex_);
  heads_[head].bids.assign(bids.begin(), bids.end());
  heads_[head].asked = now;
  std::erase_if(heads_, [now](const auto& one) { return now - one.second.asked > kHeard; });
  std::vector<BiddingHead> bidding_heads;
  for (const auto& [number, one] : heads_) bidding_heads.push_back(bidding(one));
  const auto shared = share_objects(bidding_heads);
  std::optional<ObjectId> own;
  size_t i = 0;
  for (auto& [number, one] : heads_) {
    const std::optional<HeadShare> share = shared[i++];
    const FollowBid* const bid = share ? bid_for(one.bids, share->object) : nullptr;
    if (bid != nullptr) {
      one.had = *bid;
      one.beside = share->beside;
      one.had_seen = one.asked;
    } else if (!share) {
      one.had.reset();
    }
    if (number == head && bid != nullptr) own = share->object;
  }
  return own;
}

void FollowSharing::leave(int head) {
  const std::lock_guard lock(mutex_);
  heads_.erase(head);
}

}  // namespace sightline
