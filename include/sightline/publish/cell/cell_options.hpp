// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/publish/mqtt.hpp"

namespace sightline {

/// What a daemon does for its cell: several hosts that track the same objects (docs/cell.md).
enum class CellRole : uint8_t {
  kBoth,     ///< takes frames and keeps the estimates, its own cameras' and other hosts'
  kCameras,  ///< takes frames, observes and draws; the estimates are another host's
  kFusion    ///< keeps the estimates of what other hosts observe
};
constexpr bool fuses(CellRole role) { return role != CellRole::kCameras; }

/// A camera of another host, whose observations this host takes.
struct RemoteCamera {
  std::string name, host;
  uint64_t calibration = 0;  ///< hash of lens and place, which the other host has to have too
  std::string cell{};        ///< whose host it is: one of `neighbors`; empty: this cell's

  bool operator==(const RemoteCamera&) const = default;
};

struct CellOptions {
  CellRole role = CellRole::kBoth;      ///< another one needs a broker
  std::string name = "sightline/cell";  ///< topics begin with it
  std::string host;                     ///< this one's name in the cell
  MqttOptions broker;                   ///< without a host: there is no cell
  /// Observations that come later after their capture are dropped.
  Duration age_limit = std::chrono::milliseconds(250);
  /// How far this host's UTC may be off where no time service says it.
  Duration clock_bound = std::chrono::milliseconds(1);
  /// A clock that may be further off is not fit: observations are held back.
  Duration clock_limit = std::chrono::milliseconds(10);
  std::vector<RemoteCamera> cameras;  ///< of the other hosts; their CameraIds follow the own ones
  /// Names of the cells next to this one, whose messages the broker has too (hand_over.hpp).
  std::vector<std::string> neighbors{};
  /// A host that only takes frames estimates by itself while nobody keeps the cell's estimates.
  bool local = false;
  /// Address at which browsers reach this host's page, as is_page_address(); empty: none.
  std::string page{};

  bool enabled() const { return !broker.host.empty(); }
  bool operator==(const CellOptions&) const = default;
};

/// A name as one level of a topic.
std::string topic_level(std::string name);

/// "http://..." or "https://..." of at most 256 printable characters without quotes: other hosts
/// show it as a link.
bool is_page_address(std::string_view text);

/// Topics of a cell.
struct CellTopics {
  explicit CellTopics(std::string name) : cell(std::move(name)) {}
  std::string cell;

  std::string observations() const { return cell + "/cam/+/obs/+"; }
  std::string observation(const std::string& camera, const std::string& object) const {
    return cell + "/cam/" + topic_level(camera) + "/obs/" + topic_level(object);
  }
  std::string observations_of(const std::string& camera) const {
    return cell + "/cam/" + topic_level(camera) + "/obs/+";
  }
  std::string tracks() const { return cell + "/track/+"; }
  std::string track(const std::string& object) const {
    return cell + "/track/" + topic_level(object);
  }
  std::string last(const std::string& object) const {
    return cell + "/last/" + topic_level(object);
  }
  std::string hosts() const { return cell + "/host/+/state"; }
  std::string host(const std::string& name) const {
    return cell + "/host/" + topic_level(name) + "/state";
  }
  std::string bids() const { return cell + "/bid/+"; }
  std::string bid(const std::string& object) const { return cell + "/bid/" + topic_level(object); }
  /// Who keeps the estimates.
  std::string fusion() const { return cell + "/fusion"; }
};

}  // namespace sightline
