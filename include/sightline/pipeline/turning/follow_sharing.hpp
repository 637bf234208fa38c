// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/time.hpp"

namespace sightline {

/// An object that a head could follow now.
struct FollowBid {
  ObjectId object;
  int rank = 0;        ///< in the head's list; 0: the most important
  double away = 0;     ///< by how much the head would have to turn [rad]
  bool within = true;  ///< where its range lets it look

  bool operator==(const FollowBid&) const = default;
};

/// What a head is to follow.
struct HeadShare {
  ObjectId object;
  bool beside = false;  ///< another head follows it, too, and is the object's own

  bool operator==(const HeadShare&) const = default;
};

/// One head, as share_objects() sees it.
struct BiddingHead {
  std::vector<FollowBid> bids;
  std::optional<HeadShare> had;  ///< until now
};

/// What each head is to follow. As many objects as can be have a head of their own that reaches
/// them; where there are fewer heads than objects, those that stand first in a list of any head
/// have one. Within that, heads keep what they had. A head that is left over follows the first of
/// its list, beside another. Empty: a head has no bids. Bipartite matching by augmenting paths,
/// objects by their importance (greedy on a transversal matroid; Edmonds and Fulkerson, 1965).
std::vector<std::optional<HeadShare>> share_objects(std::span<const BiddingHead> heads);

/// Shares objects among the heads of one rig, each of which asks on a thread of its own. A head
/// keeps an object that has no pose for kKept. Any thread.
class FollowSharing {
 public:
  /// `head` (any number of its own) may follow `bids` now. Empty: nothing, or what it keeps has no
  /// pose.
  std::optional<ObjectId> choose(int head, Time now, std::span<const FollowBid> bids);
  /// It follows nothing: somebody else has it, or its angles are not known.
  void leave(int head);

  static constexpr Duration kKept = std::chrono::milliseconds(500);
  static constexpr Duration kHeard = std::chrono::milliseconds(500);  ///< who asks no more is gone

 private:
  struct Head {
    std::vector<FollowBid> bids;
    Time asked{};
    std::optional<FollowBid> had;
    bool beside = false;
    Time had_seen{};
  };
  BiddingHead bidding(const Head& head) const;

  std::mutex mutex_;
  std::map<int, Head> heads_;
};

}  // namespace sightline
