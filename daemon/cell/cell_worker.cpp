// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_worker.hpp"

#include <algorithm>
#include <random>

#include "sightline/base/log.hpp"
#include "sightline/control/access.hpp"
#include "workers/wait_to_reopen.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 20ms;         // silence is noticed this late
constexpr Duration kStallLimit = 10s;    // besides what it waits for the broker
constexpr Duration kNextTry = 5s;        // to make a client, where a file of it is missing
constexpr Duration kLongestWait = 2s;    // between attempts to connect: the cell stands still
constexpr Duration kClockEvery = 100ms;  // readings of the clocks
constexpr Duration kStatusEvery = 100ms;
constexpr Duration kSmallBound = 10us;  // below it nobody cares how small it is
constexpr int kClockReadings = 5;       // the best of these counts
constexpr int kKeepAlive_s = 5;
constexpr int kMostTurns = 256;  // messages in one go before the rest is served
constexpr size_t kMostHosts = 256;

CellIdentity identity(const CellOptions& options) {
  std::random_device chance;
  const uint64_t boot = (uint64_t{chance()} << 32 | chance()) | 1;  // 0 is nobody
  return {options.host, boot, utc_now_ns()};
}

bool same_clock(const ClockState& a, const ClockState& b) {
  const auto near = [](Duration bound, Duration other) {
    return bound <= 2 * std::max(other, kSmallBound);
  };
  return a.fit == b.fit && a.text == b.text && near(a.bound, b.bound) && near(b.bound, a.bound);
}

// Only root reads the key of a service that runs as a user of its own: it comes as a credential.
MqttOptions with_credential(MqttOptions broker) {
  const auto key = token_file_path("credential:cell.key");
  std::error_code ignored;
  if (!broker.key.empty() && key && std::filesystem::exists(*key, ignored)) broker.key = *key;
  return broker;
}

}  // namespace

std::shared_ptr<CellWorker> CellWorker::start(CellParts parts, Registry& registry,
                                              HeartbeatBoard& beats) {
  if (!parts.options.enabled()) return nullptr;
  auto waker = HttpWaker::create();
  if (!waker) {
    log::error("cell: {}", waker.error().message());
    return nullptr;
  }
  std::shared_ptr<CellWorker> worker(
      new CellWorker(std::move(parts), *std::move(waker), registry, beats));
  worker->thread_ = WatchedThread(
      beats, "cell", kStallLimit,
      [raw = worker.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return worker;
}

CellWorker::CellWorker(CellParts parts, std::shared_ptr<HttpWaker> waker, Registry& registry,
                       HeartbeatBoard& beats)
    : parts_(std::move(parts)),
      self_(identity(parts_.options)),
      topics_(parts_.options.name),
      waker_(std::move(waker)),
      orders_(parts_, self_, registry),
      clock_(parts_.options.clock_bound, parts_.options.clock_limit),
      clock_service_(beats),
      counters_(cell_counters(registry, "state")),
      connected_(registry.gauge("sightline_cell_connected", "1 while the broker is connected")),
      leads_(registry.gauge("sightline_cell_leads", "1 while this host keeps the estimates")),
      clock_bound_(registry.gauge("sightline_cell_clock_bound_seconds",
                                  "How far this host's UTC may be off")),
      clock_fit_(registry.gauge("sightline_cell_clock_fit",
                                "1 while this host's clock is good enough for the cell")),
      clock_steps_(registry.counter("sightline_cell_clock_steps_total",
                                    "Times that this host's UTC was set anew")) {
  if (fuses(parts_.options.role)) {
    fusion_ = std::make_unique<CellFusion>(parts_, self_, registry);
  } else {
    cameras_ = std::make_unique<CellCameras>(parts_, registry);
  }
  const bool travel = cameras_ || !parts_.options.neighbors.empty();
  if (travel && !parts_.cameras.empty()) {
    sender_ = std::make_unique<CellSender>(parts_, self_, registry);
  }
  read_clocks(MonotonicClock::now());
}

bool CellWorker::stop_unless_waiting(Duration patience) {
  thread_.request_stop();
  waker_->wake();
  return !thread_.joinable() || thread_.join_unless_waiting(patience);
}

void CellWorker::push(const Observation& observation) {
  if (!sender_) return;
  if (cameras_ && cameras_->local() != nullptr) cameras_->local()->push(observation);
  sender_->push(observation);
  waker_->wake();
}

void CellWorker::set_doubted(ObjectId object, bool doubted) {
  if (sender_) sender_->set_doubted(object, doubted);
}

void CellWorker::push(const PoseEstimate& estimate, FusionWorker::Cause cause) {
  if (fusion_) fusion_->push(estimate, cause);
  if (cameras_ && cameras_->local() != nullptr) cameras_->local()->push(estimate, cause);
  waker_->wake();
}

Status CellWorker::order(CellOrder order) {
  const CellStatus now = status();
  if (!now.connected) {
    return make_error(ErrorCode::kUnavailable, "the other hosts",
                      "are not told: the broker of the cell is away{}{}",
                      now.problem.empty() ? "" : ": ", now.problem);
  }
  orders_.push(std::move(order));
  waker_->wake();
  return {};
}

CellStatus CellWorker::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void CellWorker::set_away(std::vector<bool> away) {
  const std::lock_guard lock(mutex_);
  away_ = std::move(away);
}

std::vector<bool> CellWorker::away() const {
  const std::lock_guard lock(mutex_);
  return away_;
}

CellHostState CellWorker::own_state(bool online) const {
  CellHostState state;
  state.host = self_.host;
  state.boot = self_.boot;
  state.online = online;
  state.role = parts_.options.role;
  state.since_utc_ns = self_.since_utc_ns;
  state.cameras = parts_.cameras;
  const std::vector<bool> missing = away();
  for (size_t i = 0; i < std::min(missing.size(), state.cameras.size()); ++i) {
    state.cameras[i].away = missing[i];
  }
  state.page = parts_.options.page;
  const ClockState clock = clock_.state(MonotonicClock::now());
  state.clock_bound = clock.bound;
  state.clock_fit = clock.fit;
  state.clock = clock.text;
  return state;
}

// One last will only: a host that keeps the estimates is missed as that, its state goes with it.
MqttSession CellWorker::session() {
  MqttSession session;
  session.will_topic = fusion_ ? topics_.fusion() : topics_.host(self_.host);
  session.will = encode(own_state(false));
  session.subscriptions = {{topics_.hosts(), 1}, {topics_.fusion(), 1}, {order_topics(topics_), 1}};
  session.subscriptions.push_back(fusion_ ? MqttSession::Subscription{topics_.observations(), 0}
                                          : MqttSession::Subscription{topics_.tracks(), 0});
  for (const std::string& neighbor : parts_.options.neighbors) {
    const CellTopics topics(neighbor);
    session.subscriptions.push_back({topics.fusion(), 1});
    session.subscriptions.push_back({topics.tracks(), 0});
    if (fusion_) session.subscriptions.push_back({topics.bids(), 0});
  }
  for (const RemoteCamera& camera : parts_.options.cameras) {
    if (!fusion_ || camera.cell.empty()) continue;
    session.subscriptions.push_back({CellTopics(camera.cell).observations_of(camera.name), 0});
  }
  session.on_connect = [this] { greet_ = true; };
  session.on_message = [this](std::string_view topic, std::string_view payload, bool) {
    on_message(topic, payload);
  };
  session.keep_alive_s = kKeepAlive_s;
  session.longest_wait = kLongestWait;
  return session;
}

std::unique_ptr<MqttClient> CellWorker::make_client() {
  auto made = MqttClient::create(with_credential(parts_.options.broker), session());
  if (made) return *std::move(made);
  note(false, made.error().message());
  return nullptr;
}

void CellWorker::note(bool connected, const std::string& problem) {
  connected_.set(connected ? 1 : 0);
  const std::lock_guard lock(mutex_);
  const MqttOptions& broker = parts_.options.broker;
  if (connected && !status_.connected) {
    log::info("cell: connected to {}:{}", broker.host, broker.port);
  } else if (!connected && !problem.empty() && problem != status_.problem) {
    log::warning({.cause = "broker"}, "cell: {}:{}: {}; it is tried again", broker.host,
                 broker.port, problem);
  }
  status_.problem = connected ? "" : problem.empty() ? status_.problem : problem;
  status_.connected = connected;
}

// The two clocks are never read at one time: the tightest of a few readings counts.
void CellWorker::read_clocks(Time now) {
  if (now < next_clock_) return;
  next_clock_ = now + kClockEvery;
  if (const auto reading = clock_service_.reading()) {
    clock_.set_service(reading->bound, reading->problem);
  }
  Duration tightest = Duration::max();
  Time middle{};
  int64_t utc_ns = 0;
  for (int i = 0; i < kClockReadings; ++i) {
    const Time before = MonotonicClock::now();
    const int64_t utc = utc_now_ns();
    const Duration taken = MonotonicClock::now() - before;
    if (taken >= tightest) continue;
    tightest = taken;
    middle = before + taken / 2;
    utc_ns = utc;
  }
  if (clock_.note(middle, utc_ns, tightest)) {
    clock_steps_.add();
    log::warning({.cause = "clock"}, "cell: this host's clock has been set anew");
  }
  const ClockState state = clock_.state(now);
  clock_bound_.set(to_seconds(state.bound));
  clock_fit_.set(state.fit ? 1 : 0);
}

void CellWorker::on_message(std::string_view topic, std::string_view payload) {
  const Time now = MonotonicClock::now();
  for (const std::string& cell : parts_.options.neighbors) {
    if (topic.starts_with(cell + "/")) return on_neighbor(cell, topic, payload, now);
  }
  on_own(topic, payload, now);
}

void CellWorker::on_own(std::string_view topic, std::string_view payload, Time now) {
  if (topic == topics_.fusion()) return on_claim(payload);
  if (topic.starts_with(topics_.cell + "/host/")) return on_host(topic, payload);
  if (topic.starts_with(topics_.cell + "/order/")) {
    return orders_.on_message(topic, payload, clock_, now);
  }
  ++received_;
  if (fusion_) return fusion_->on_observation({}, topic, payload, clock_, now);
  cameras_->on_track(topics_.cell, topic, payload, clock_, now);
}

void CellWorker::on_neighbor(const std::string& cell, std::string_view topic,
                             std::string_view payload, Time now) {
  const CellTopics topics(cell);
  if (topic == topics.fusion()) {
    const auto claim = decode_host_state(payload);
    counters_[static_cast<size_t>(claim ? CellVerdict::kTaken : CellVerdict::kMalformed)]->add();
    if (claim && fusion_) fusion_->neighbors()->on_claim(cell, *claim, now);
    if (claim && cameras_) cameras_->on_claim(cell, *claim, now);
    return;
  }
  ++received_;
  if (cameras_) return cameras_->on_track(cell, topic, payload, clock_, now);
  if (topic.starts_with(cell + "/track/")) {
    fusion_->neighbors()->on_track(cell, topic, payload, clock_, now);
  } else if (topic.starts_with(cell + "/bid/")) {
    fusion_->neighbors()->on_bid(cell, topic, payload, clock_, now);
  } else {
    fusion_->on_observation(cell, topic, payload, clock_, now);
  }
}

void CellWorker::on_host(std::string_view topic, std::string_view payload) {
  const auto state = decode_host_state(payload);
  CellVerdict verdict = CellVerdict::kTaken;
  if (!state) {
    verdict = CellVerdict::kMalformed;
  } else if (topic != topics_.host(state->host) ||
             (hosts_.size() >= kMostHosts && !hosts_.contains(state->host))) {
    verdict = CellVerdict::kForeign;
  }
  counters_[static_cast<size_t>(verdict)]->add();
  if (verdict != CellVerdict::kTaken || state->boot == self_.boot) return;
  CellHostState& host = hosts_[state->host] = *state;
  // The last will of a host that kept the estimates stands in its claim.
  if (claim_ && claim_->boot == host.boot && !claim_->online) host.online = false;
}

void CellWorker::on_claim(std::string_view payload) {
  const auto claim = decode_host_state(payload);
  counters_[static_cast<size_t>(claim ? CellVerdict::kTaken : CellVerdict::kMalformed)]->add();
  if (!claim) return;
  claim_ = *claim;
  const Time now = MonotonicClock::now();
  if (fusion_) fusion_->claim().hear(*claim, now);
  if (cameras_) cameras_->on_claim(topics_.cell, *claim, now);
  const auto host = hosts_.find(claim->host);
  if (host != hosts_.end() && host->second.boot == claim->boot) {
    host->second.online = claim->online;
  }
}

void CellWorker::run(const std::stop_token& stop, Heartbeat& heartbeat) {
  std::unique_ptr<MqttClient> client;
  Time next_try{};
  while (!stop.stop_requested()) {
    heartbeat.beat();
    if (!client && MonotonicClock::now() >= next_try) {
      client = make_client();
      next_try = MonotonicClock::now() + kNextTry;
    }
    if (client) {
      client->step(kTurn, waker_->fd());
      waker_->clear();
      for (int i = 0; i < kMostTurns && client->connected(); ++i) {
        const size_t before = received_;
        client->step(0ns, -1);
        if (received_ == before) break;
      }
      note(client->connected(), client->problem());
    } else {
      sleep_unless_stopped(stop, kTurn);
    }
    step(client && client->connected() ? client.get() : nullptr, MonotonicClock::now());
  }
  if (client && client->connected()) {
    orders_.send(client.get(), clock_, MonotonicClock::now());  // a reload may end this thread
    (void)client->publish(topics_.host(self_.host), encode(own_state(false)), true, 1);
  }
  client.reset();
  if (fusion_) fusion_->end_doubts();
  connected_.set(0);
}

void CellWorker::step(MqttClient* client, Time now) {
  read_clocks(now);
  if (client != nullptr) {
    if (std::exchange(greet_, false)) {
      said_clock_.reset();
      if (fusion_) fusion_->claim().connected(now);
    }
    say_state(*client, now);
  }
  orders_.send(client, clock_, now);
  if (sender_) {
    sender_->send(client, clock_, now, [this, now](ObjectId object) {
      if (fusion_) fusion_->neighbors()->note_seen(object, now);
    });
  }
  if (fusion_) step_fusion(client, now);
  if (cameras_) cameras_->advance(client != nullptr, now);
  if (now >= next_status_) note_status(client != nullptr, now);
}

void CellWorker::step_fusion(MqttClient* client, Time now) {
  const bool held = fusion_->claim().holds();
  if (client != nullptr && fusion_->claim().step(now)) {
    CellHostState claim = own_state(true);
    claim.beat = ++beat_;
    claim.observations = fusion_->verdicts();
    (void)client->publish(topics_.fusion(), encode(claim), true, 1);
  }
  fusion_->step(client, clock_, now);
  const std::string other = fusion_->claim().other();
  if (!other.empty() && other != told_other_) {
    log::error({.cause = "cell"},
               "cell: host {} keeps the estimates already, so this one ({}) does not; give one "
               "of them the role \"cameras\", or stop it",
               other, self_.host);
  }
  told_other_ = other;
  leads_.set(fusion_->claim().holds() ? 1 : 0);
  if (held != fusion_->claim().holds()) next_status_ = now;  // told before any estimate
}

void CellWorker::note_status(bool connected, Time now) {
  next_status_ = now + kStatusEvery;
  CellHostState own = own_state(connected);
  const std::lock_guard lock(mutex_);
  status_.refused = fusion_ && !fusion_->claim().other().empty();
  status_.fusion = !fusion_                   ? cameras_->fusion(topics_.cell)
                   : fusion_->claim().holds() ? self_.host
                                              : fusion_->claim().other();
  status_.clock = clock_.state(now);
  status_.hosts.clear();
  status_.hosts.push_back(std::move(own));
  for (const auto& [name, state] : hosts_) {
    if (name != self_.host) status_.hosts.push_back(state);
  }
  status_.neighbors.clear();
  for (const std::string& cell : parts_.options.neighbors) {
    const CellNeighbors* const seen = fusion_ ? fusion_->neighbors() : nullptr;
    status_.neighbors.push_back({cell, seen ? seen->fusion(cell) : cameras_->fusion(cell)});
  }
  status_.local =
      cameras_ && cameras_->local() != nullptr ? cameras_->local()->running() : std::vector<bool>();
  if (status_.neighbors.empty()) return;
  status_.holders = fusion_ ? fusion_->neighbors()->holders() : cameras_->holders();
}

void CellWorker::say_state(MqttClient& client, Time now) {
  const ClockState clock = clock_.state(now);
  std::vector<bool> missing = away();
  if (said_clock_ && same_clock(*said_clock_, clock) && missing == said_away_) return;
  if (said_clock_ && said_clock_->fit != clock.fit) {
    log::warning({.cause = "clock"}, "cell: the clock is {}: {}", clock.fit ? "fit" : "not fit",
                 clock.text);
  }
  said_clock_ = clock;
  said_away_ = std::move(missing);
  (void)client.publish(topics_.host(self_.host), encode(own_state(true)), true, 1);
}

}  // namespace sightline
