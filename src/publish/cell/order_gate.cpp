// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/cell_order.hpp"

namespace sightline {
namespace {

constexpr size_t kMostHosts = 256;
constexpr size_t kMostBoots = 1024;  // kept of one host; older ones are beyond the age limit

}  // namespace

std::string_view to_string(CellOrder::Kind kind) {
  switch (kind) {
    case CellOrder::Kind::kHintImage:
    case CellOrder::Kind::kHintPose:
      return "hint";
    case CellOrder::Kind::kForget:
      return "forget";
    case CellOrder::Kind::kReload:
      return "reload";
    case CellOrder::Kind::kRecord:
      return "record";
    case CellOrder::Kind::kStopRecording:
      return "stop recording";
    case CellOrder::Kind::kMark:
      return "mark";
  }
  return "";
}

std::string order_topic(const CellTopics& topics, const std::string& host) {
  return topics.cell + "/order/" + topic_level(host);
}
std::string order_topics(const CellTopics& topics) { return topics.cell + "/order/+"; }

CellVerdict OrderGate::check(const CellOrder& order, int64_t now_utc_ns) {
  // Age before boots: what is replayed from long ago must not pass for a start of the host.
  const Duration age(now_utc_ns - order.time_utc_ns);
  if (age > kAgeLimit) return CellVerdict::kLate;
  if (-age > kAgeLimit) return CellVerdict::kFuture;
  if (hosts_.size() >= kMostHosts && !hosts_.contains(order.host)) return CellVerdict::kForeign;
  Host& host = hosts_[order.host];
  if (host.boot != order.boot) {
    if (host.earlier.contains(order.boot)) return CellVerdict::kOldBoot;
    if (host.earlier.size() >= kMostBoots) host.earlier.clear();
    if (host.boot != 0) host.earlier.insert(host.boot);
    host.boot = order.boot;
    host.sequence = 0;
  }
  if (order.sequence <= host.sequence) return CellVerdict::kDuplicate;
  host.sequence = order.sequence;
  return CellVerdict::kTaken;
}

}  // namespace sightline
