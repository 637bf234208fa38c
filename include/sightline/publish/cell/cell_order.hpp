// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/publish/cell/observation_gate.hpp"

namespace sightline {

/// What an operator has ordered at one host of a cell, for all of them.
struct CellOrder {
  enum class Kind : uint8_t {
    kHintImage = 1,
    kHintPose,
    kForget,
    kReload,
    kRecord,
    kStopRecording,
    kMark
  };
  Kind kind = Kind::kReload;
  std::string object;  ///< of hints, and to forget
  std::string camera;  ///< of kHintImage, as the next two
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  std::optional<double> radius_px{};
  Rigid3 world_from_object;             ///< of kHintPose, about
  std::vector<std::string> recordings;  ///< kinds; none: as each host is configured
  std::optional<double> seconds{};      ///< of kRecord: then it ends by itself
  std::string text;                     ///< of kMark

  // Filled in where it is sent.
  std::string host;
  uint64_t boot = 0;
  uint64_t sequence = 0;
  int64_t time_utc_ns = 0;
};
/// "hint", "forget", ... for people.
std::string_view to_string(CellOrder::Kind kind);

/// Topics of orders: that of a host, and all of them.
std::string order_topic(const CellTopics& topics, const std::string& host);
std::string order_topics(const CellTopics& topics);

std::string encode(const CellOrder& order);
/// Refuses what is not complete, as decode_observation() does.
Result<CellOrder> decode_order(std::string_view bytes);

/// Lets each order through once, while it is young. Passive; one thread at a time.
class OrderGate {
 public:
  /// kTaken, kLate, kFuture, kDuplicate, kOldBoot or, of more hosts than a cell has, kForeign.
  CellVerdict check(const CellOrder& order, int64_t now_utc_ns);

  /// Of the time of an order and now, either way: an operator does not care for less, and clocks
  /// that are not fit may still be told to do something.
  static constexpr Duration kAgeLimit = std::chrono::seconds(5);

 private:
  struct Host {
    uint64_t boot = 0;
    uint64_t sequence = 0;
    std::set<uint64_t> earlier;  // boots
  };
  std::map<std::string, Host> hosts_;
};

}  // namespace sightline
