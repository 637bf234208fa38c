// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "cell/cell_cameras.hpp"
#include "cell/cell_fusion.hpp"
#include "cell/cell_orders.hpp"
#include "cell/cell_parts.hpp"
#include "cell/cell_sender.hpp"
#include "cell/clock_service.hpp"
#include "heartbeat.hpp"

namespace sightline {

/// How the cell looks from this host.
struct CellStatus {
  bool connected = false;
  std::string problem;   ///< why it is not
  std::string fusion;    ///< the host that keeps the estimates; empty: none is known
  bool refused = false;  ///< this host is to keep them too, and does not
  ClockState clock;
  std::vector<CellHostState> hosts;  ///< all that have said something, this one among them
  struct Neighbor {
    std::string cell;
    std::string fusion;  ///< the host that keeps its estimates; empty: none is known
  };
  std::vector<Neighbor> neighbors;
  std::vector<std::string> holders;  ///< by ObjectId: the cell that has it; empty: none
  std::vector<bool> local;  ///< by ObjectId: this host estimates it by itself; empty: it never does
};

/// The thread ("cell") that works with the cell's other hosts, through their broker: sends what
/// this one sees, or what it makes of what all see. A broker that is away or slow costs nobody else
/// anything.
class CellWorker {
 public:
  /// Null without a broker in the options.
  static std::shared_ptr<CellWorker> start(CellParts parts, Registry& registry,
                                           HeartbeatBoard& beats);
  ~CellWorker() { (void)stop_unless_waiting(std::chrono::seconds(1)); }
  /// Says farewell. False: it waits for the broker, and the thread is left.
  bool stop_unless_waiting(Duration patience);

  /// Of a host that takes frames: one of its observations, and what its search doubts; from any
  /// thread, never waits.
  void push(const Observation& observation);
  void set_doubted(ObjectId object, bool doubted);
  /// Of a host that estimates: one of its estimates, as FusionWorker tells it.
  void push(const PoseEstimate& estimate, FusionWorker::Cause cause);

  /// Passes an operator's order on to the other hosts; from any thread, never waits. Refused while
  /// the broker is away.
  Status order(CellOrder order);

  /// Which of this host's cameras give no frames, by CameraId: the other hosts show it. Any thread.
  void set_away(std::vector<bool> away);

  CellStatus status() const;
  const CellOptions& options() const { return parts_.options; }

 private:
  CellWorker(CellParts parts, std::shared_ptr<HttpWaker> waker, Registry& registry,
             HeartbeatBoard& beats);
  void run(const std::stop_token& stop, Heartbeat& heartbeat);
  std::unique_ptr<MqttClient> make_client();
  MqttSession session();
  void on_connect();
  void on_message(std::string_view topic, std::string_view payload);
  void on_own(std::string_view topic, std::string_view payload, Time now);
  void on_neighbor(const std::string& cell, std::string_view topic, std::string_view payload,
                   Time now);
  void on_host(std::string_view topic, std::string_view payload);
  void on_claim(std::string_view payload);
  void step(MqttClient* client, Time now);
  void step_fusion(MqttClient* client, Time now);
  void read_clocks(Time now);
  void say_state(MqttClient& client, Time now);
  CellHostState own_state(bool online) const;
  std::vector<bool> away() const;
  void note_status(bool connected, Time now);
  void note(bool connected, const std::string& problem);

  const CellParts parts_;
  const CellIdentity self_;
  const CellTopics topics_;
  const std::shared_ptr<HttpWaker> waker_;
  // One of the two.
  std::unique_ptr<CellFusion> fusion_;
  std::unique_ptr<CellCameras> cameras_;
  std::unique_ptr<CellSender> sender_;  // null: this host's observations do not travel
  CellOrders orders_;
  ClockWatch clock_;
  ClockService clock_service_;
  CellCounters counters_;
  Gauge &connected_, &leads_, &clock_bound_, &clock_fit_;
  Counter& clock_steps_;
  std::map<std::string, CellHostState> hosts_;  // by name
  std::optional<CellHostState> claim_;          // the newest that was said
  uint64_t received_ = 0;                       // observations or tracks
  uint64_t beat_ = 0;                           // of our own claims
  bool greet_ = false;                          // just connected
  std::optional<ClockState> said_clock_;
  std::vector<bool> said_away_;
  std::string told_other_;
  Time next_clock_{}, next_status_{};
  mutable std::mutex mutex_;  // guards status_ and away_
  CellStatus status_;
  std::vector<bool> away_;  // by CameraId; shorter: not known yet
  WatchedThread thread_;
};

}  // namespace sightline
