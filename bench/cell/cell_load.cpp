// SPDX-License-Identifier: Apache-2.0
// The load of a whole cell on one fusion host: simulated cameras send observations of a moving
// object through the broker, as fast as real ones would, and the tracks that come back are timed.
// bench/cell/load.py starts broker and fusion host.
//   cell_load INSTALLATION SECONDS RATE_HZ     -> one line of JSON
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <thread>

#include "sightline/config/installation.hpp"
#include "sightline/publish/cell/cell_messages.hpp"

namespace {

using namespace sightline;
using namespace std::chrono_literals;

constexpr double kSigmaRotation = 0.01, kSigmaTranslation = 0.002;  // of one camera [rad, m]

Rigid3 truth_at(int64_t utc_ns) {
  const double phase = 2 * M_PI * static_cast<double>(utc_ns % 4'000'000'000) / 4e9;
  Vector6 d;
  d << 0.3 * std::sin(phase), 0, 0, 0.2 * std::cos(phase), 0.2 * std::sin(phase), 1.5;
  return Rigid3::exp(d);
}

struct Noise {
  std::mt19937 chance{17};
  std::normal_distribution<double> normal;
  Vector6 draw() {
    Vector6 d;
    for (int i = 0; i < 6; ++i)
      d[i] = normal(chance) * (i < 3 ? kSigmaRotation : kSigmaTranslation);
    return d;
  }
};

CellObservation observe(const RemoteCamera& camera, const std::string& object, int64_t utc_ns,
                        uint64_t boot, uint64_t sequence, Noise& noise) {
  CellObservation o;
  o.object = object;
  o.camera = camera.name;
  o.host = camera.host;
  o.boot = boot;
  o.calibration = camera.calibration;
  o.sequence = o.frame = sequence;
  o.capture_utc_ns = utc_ns;
  const Rigid3 seen = truth_at(utc_ns) * Rigid3::exp(noise.draw());
  FrozenPart part{FrozenKind::kOther, {}};
  part.term.information.diagonal().head<3>().setConstant(1 / (kSigmaRotation * kSigmaRotation));
  part.term.information.diagonal().tail<3>().setConstant(1 /
                                                         (kSigmaTranslation * kSigmaTranslation));
  part.term.residuals = 40;
  part.term.cost = 17;
  part.term.quality = 0.95;
  o.at = {{seen, {part}}};
  o.hypotheses = {{seen, 17}};
  return o;
}

struct Arrivals {
  std::vector<double> age_ms, error_mm;
  int64_t newest = 0;
  void take(const CellTrack& track) {
    if (!has_pose(track.estimate.state) || track.time_utc_ns <= newest) return;
    newest = track.time_utc_ns;
    age_ms.push_back(1e-6 * static_cast<double>(utc_now_ns() - track.time_utc_ns));
    error_mm.push_back(
        1e3 * translation_distance(track.estimate.world_from_object, truth_at(track.time_utc_ns)));
  }
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return -1;
  const auto at =
      values.begin() + static_cast<ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

int fail(const Error& error) {
  fmt::print(stderr, "{}\n", error.message());
  return 1;
}

// Cameras expose one after the other, spread over their period.
void send_until(Time end, double rate_hz, const CellOptions& cell, const std::string& object,
                MqttClient& client, uint64_t& sent, uint64_t& unsent) {
  const CellTopics topics(cell.name);
  const uint64_t boot = static_cast<uint64_t>(utc_now_ns());
  const Duration step = from_seconds(1 / (rate_hz * static_cast<double>(cell.cameras.size())));
  Noise noise;
  Time due = MonotonicClock::now();
  for (uint64_t i = 0; MonotonicClock::now() < end; ++i, due += step) {
    while (MonotonicClock::now() < due)
      client.step(std::min<Duration>(due - MonotonicClock::now(), 1ms), -1);
    const RemoteCamera& camera = cell.cameras[i % cell.cameras.size()];
    const std::string bytes = encode(observe(camera, object, utc_now_ns(), boot, i + 1, noise));
    const bool gone = client.publish(topics.observation(camera.name, object), bytes, false);
    ++(gone ? sent : unsent);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const auto installation = read_installation(argv[1]);
  if (!installation) return fail(installation.error());
  const CellOptions& cell = installation->cell;
  const std::string object = installation->objects.at(0).description.name;
  const CellTopics topics(cell.name);
  MqttOptions broker;
  broker.host = cell.broker.host;
  broker.port = cell.broker.port;
  MqttSession sender, listener;
  sender.will_topic = listener.will_topic = cell.name + "/load";
  Arrivals arrivals;
  bool measuring = false;
  listener.subscriptions = {{topics.track(object), 0}};
  listener.on_message = [&](std::string_view, std::string_view payload, bool) {
    const auto track = measuring ? decode_track(payload) : Result<CellTrack>(CellTrack{});
    if (measuring && track) arrivals.take(*track);
  };
  auto out = MqttClient::create(broker, sender), in = MqttClient::create(broker, listener);
  if (!out) return fail(out.error());
  if (!in) return fail(in.error());
  for (int i = 0; i < 100 && !((*out)->connected() && (*in)->connected()); ++i) {
    (*out)->step(20ms, -1);
    (*in)->step(20ms, -1);
  }
  std::jthread listening([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) (*in)->step(20ms, -1);
  });
  uint64_t sent = 0, unsent = 0;
  const double rate_hz = std::atof(argv[3]);
  send_until(MonotonicClock::now() + 3s, rate_hz, cell, object, **out, sent, unsent);
  sent = unsent = 0;
  measuring = true;
  const double seconds = std::atof(argv[2]);
  send_until(MonotonicClock::now() + from_seconds(seconds), rate_hz, cell, object, **out, sent,
             unsent);
  listening.request_stop();
  listening.join();
  fmt::print(R"({{"cameras": {}, "rate_hz": {}, "sent_per_s": {:.0f}, "unsent": {}, "tracks": {}, )"
             R"("age_ms_p50": {:.2f}, "age_ms_p99": {:.2f}, )"
             R"("error_mm_p50": {:.2f}, "error_mm_p99": {:.2f}}})"
             "\n",
             cell.cameras.size(), rate_hz, static_cast<double>(sent) / seconds, unsent,
             arrivals.age_ms.size(), quantile(arrivals.age_ms, 0.5),
             quantile(arrivals.age_ms, 0.99), quantile(arrivals.error_mm, 0.5),
             quantile(arrivals.error_mm, 0.99));
  return 0;
}
