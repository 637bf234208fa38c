// SPDX-License-Identifier: Apache-2.0
//
// ONVIF PTZ over HTTP: its status is asked for some 20 times a second. Requests wait for 200 ms at
// the longest, those of the beginning for a second. A head is told to turn by the first that it has
// of AbsoluteMove, ContinuousMove and RelativeMove.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <thread>

#include "capture/axes/axis_sources.hpp"
#include "capture/axes/onvif_messages.hpp"
#include "capture/axes/rate_order.hpp"
#include "capture/axes/soap_client.hpp"
#include "sightline/base/log.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 50ms;
constexpr Duration kRepeat = 400ms;  // of a velocity, which ends by itself after a second
constexpr long kPatienceMs = 200, kOpenPatienceMs = 1000;
constexpr int kMostFailures = 5;  // in a row
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kSameVelocity = 0.01;     // of the fastest
constexpr double kNoWay = 0.25 * kDegree;  // that a relative order is not worth
constexpr int kTries = 3;                  // of orders that it may not know

struct Profile {
  std::string path, token;
  HeadOrders orders = HeadOrders::kAbsolute;
  bool tried = true;  ///< it is known that it takes such orders, or they were chosen
};

class OnvifSource final : public AxisSource {
 public:
  OnvifSource(SoapClient client, Profile profile, const AxisSourceOptions& options,
              std::string name)
      : client_(std::move(client)),
        profile_(std::move(profile)),
        name_(std::move(name)),
        unit_(options.degrees_per_unit * kDegree),
        fastest_(options.fastest) {}
  OnvifSource(const OnvifSource&) = delete;
  OnvifSource& operator=(const OnvifSource&) = delete;
  ~OnvifSource() override {
    if (!velocity_.isZero()) {
      (void)client_.ask(profile_.path, format_onvif_stop(profile_.token), kPatienceMs);
    }
  }

  Result<std::optional<AxisReading>> next(Duration timeout) override {
    send_orders();
    const Duration early = asked_ + kPeriod - MonotonicClock::now();
    if (early > timeout) {
      sleep_for(timeout);
      return std::optional<AxisReading>();
    }
    sleep_for(std::max<Duration>(early, 0ms));
    asked_ = MonotonicClock::now();
    const auto answer =
        client_.ask(profile_.path, format_onvif_get_status(profile_.token), kPatienceMs);
    const Time answered = MonotonicClock::now();
    const auto status = answer ? parse_onvif_status(*answer) : std::optional<OnvifStatus>();
    if (!status) {
      ++counts_.bad;
      if (++failures_ >= kMostFailures && !answer) return answer.error();
      return std::optional<AxisReading>();
    }
    failures_ = 0;
    ++counts_.good;
    degrees_ = status->degrees;
    AxisReading reading;
    reading.stamp = asked_ + (answered - asked_) / 2;
    reading.pan = status->pan * unit();
    reading.tilt = status->tilt * unit();
    angles_ = HeadAngles(reading.pan, reading.tilt);
    reading.zoom = status->zoom;
    reading.moving = status->moving;
    return std::optional(reading);
  }
  Counts counts() const override { return counts_; }
  void turn(const HeadOrder& order) override { order_ = order; }

 private:
  double unit() const { return degrees_ ? kDegree : unit_; }

  static void sleep_for(Duration time) { std::this_thread::sleep_for(time); }

  // Not before the first status: it says how places are counted.
  void send_orders() {
    if (counts_.good == 0) return;
    const bool by_rate = profile_.orders == HeadOrders::kContinuous;
    if (order_) {
      const HeadOrder order = *order_;
      order_.reset();
      if (by_rate) {
        rate_.take(order, MonotonicClock::now());
      } else {
        send_place(order);
      }
    }
    if (by_rate) send_velocity();
  }

  HeadAngles shares(const HeadAngles& rates) const {
    return (rates.array().abs() / fastest_).min(1.0).max(0.01).matrix();
  }

  void send_place(const HeadOrder& order) {
    const HeadAngles speed = shares(order.rate);
    if (profile_.orders == HeadOrders::kAbsolute) {
      const HeadAngles place = order.place / unit();
      return send(format_onvif_move(profile_.token, place, degrees_, speed));
    }
    const HeadAngles way = order.place - angles_;
    if (way.cwiseAbs().maxCoeff() < kNoWay) return;
    send(format_onvif_relative(profile_.token, way / unit(), degrees_, speed));
  }

  void send_velocity() {
    const Time now = MonotonicClock::now();
    const HeadAngles velocity = (rate_.rates(now, angles_) / fastest_).cwiseMax(-1.0).cwiseMin(1.0);
    const bool same = (velocity - velocity_).cwiseAbs().maxCoeff() < kSameVelocity;
    if (velocity.isZero() ? velocity_.isZero() : same && now - sent_ < kRepeat) return;
    sent_ = now;
    send(velocity.isZero() ? format_onvif_stop(profile_.token)
                           : format_onvif_continuous(profile_.token, velocity));
    velocity_ = velocity;
  }

  // Not every camera says what it can do: who refuses to go to places is turned at rates.
  void send(const std::string& body) {
    ++counts_.ordered;
    const auto answer = client_.ask(profile_.path, body, kPatienceMs);
    if (answer) {
      profile_.tried = true;
      return;
    }
    ++counts_.refused;
    const bool silent = answer.error().code == ErrorCode::kTimeout;
    if (profile_.tried || silent || ++untried_ < kTries) return;
    profile_.tried = true;
    profile_.orders = HeadOrders::kContinuous;
    log::info({.camera = name_}, "{}: its head takes no places ({}): it is turned at rates", name_,
              answer.error().text);
  }

  SoapClient client_;
  Profile profile_;
  const std::string name_;
  const double unit_, fastest_;  ///< [rad], [rad/s]
  bool degrees_ = false;
  Time asked_{}, sent_{};
  HeadAngles angles_ = HeadAngles::Zero();    ///< newest, as the device counts
  HeadAngles velocity_ = HeadAngles::Zero();  ///< in force; shares of the fastest
  int failures_ = 0, untried_ = 0;
  std::optional<HeadOrder> order_;  ///< not sent yet
  RateOrder rate_;
  Counts counts_;
};

// By what it says of its node, or as it is chosen.
void choose_orders(SoapClient& client, const std::string& node, HeadOrders chosen,
                   Profile& profile) {
  if (chosen != HeadOrders::kAny) {
    profile.orders = chosen;
    return;
  }
  const auto answer = client.ask(profile.path, format_onvif_get_nodes(), kOpenPatienceMs);
  const auto moves = answer ? parse_onvif_moves(*answer, node) : std::optional<OnvifMoves>();
  profile.tried = moves && (moves->absolute || moves->continuous || moves->relative);
  if (!profile.tried || moves->absolute) return;
  profile.orders = moves->continuous ? HeadOrders::kContinuous : HeadOrders::kRelative;
}

}  // namespace

Result<std::unique_ptr<AxisSource>> open_onvif(const AxisSourceOptions& options,
                                               const std::string& name) {
  SL_ASSIGN(SoapClient client, SoapClient::create(options, name));
  SL_ASSIGN(const std::string services,
            client.ask("/onvif/device_service", format_onvif_capabilities(), kOpenPatienceMs));
  const std::string media = parse_onvif_path(services, "Media");
  const std::string ptz = parse_onvif_path(services, "PTZ");
  if (media.empty() || ptz.empty()) {
    return make_error(ErrorCode::kInvalidInput, name, "{} has no ONVIF services of media and PTZ",
                      options.host);
  }
  SL_ASSIGN(const std::string profiles,
            client.ask(media, format_onvif_profiles(), kOpenPatienceMs));
  Profile profile{ptz, parse_onvif_profile(profiles, options.profile)};
  if (profile.token.empty()) {
    return make_error(ErrorCode::kInvalidInput, name, "{} has no profile {} with a head",
                      options.host, options.profile);
  }
  choose_orders(client, parse_onvif_node(profiles, profile.token), options.orders, profile);
  return std::unique_ptr<AxisSource>(
      std::make_unique<OnvifSource>(std::move(client), std::move(profile), options, name));
}

}  // namespace sightline::capture
