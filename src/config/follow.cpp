// SPDX-License-Identifier: Apache-2.0
#include "config/follow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

namespace sightline::config {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

void number(TomlTable& table, std::string_view key, double& field, double low, double high,
            std::string_view unit, double scale = 1) {
  if (const auto value = table.number(key, low, high, unit)) field = *value * scale;
}

// Two angles [deg], at most a turn to either side.
std::optional<Eigen::Vector2d> angles(TomlTable& table, std::string_view key) {
  const auto value = table.numbers(key, 2);
  if (!value) return std::nullopt;
  const Eigen::Vector2d both((*value)[0], (*value)[1]);
  if (both.cwiseAbs().maxCoeff() <= 360) return both * kDegree;
  table.problem(key, "angles from -360 to 360 degrees");
  return std::nullopt;
}

void read_range(TomlTable& table, std::string_view key, int axis, HeadLimits& limits) {
  const auto range = angles(table, key);
  if (!range) return;
  if (range->x() >= range->y()) table.problem(key, "the smaller angle comes first");
  limits.low[axis] = range->x();
  limits.high[axis] = range->y();
}

// Not every head knows every way to be told.
void read_orders(TomlTable& table, AxisSourceOptions& axes) {
  constexpr std::pair<std::string_view, HeadOrders> kNames[] = {
      {"any", HeadOrders::kAny},
      {"absolute", HeadOrders::kAbsolute},
      {"continuous", HeadOrders::kContinuous},
      {"relative", HeadOrders::kRelative}};
  const auto text = table.text("orders");
  if (!text) return;
  const auto* const found =
      std::ranges::find_if(kNames, [&](const auto& one) { return one.first == text->text; });
  if (found == std::end(kNames)) {
    return table.problem("orders", "known: \"any\", \"absolute\", \"continuous\", \"relative\"");
  }
  axes.orders = found->second;
  const bool onvif = axes.protocol == AxisProtocol::kOnvif;
  const bool rates = onvif || axes.protocol == AxisProtocol::kV4l2;
  if ((axes.orders == HeadOrders::kContinuous && !rates) ||
      (axes.orders == HeadOrders::kRelative && !onvif)) {
    table.problem("orders",
                  "\"continuous\" goes with axes = \"onvif:...\" and \"v4l2:...\", "
                  "\"relative\" with \"onvif:...\"");
  }
}

}  // namespace

void read_follow(TomlTable& table, CameraConfig& camera) {
  const bool follows = camera.role == CameraRole::kFollow;
  if (follows && camera.axes.protocol == AxisProtocol::kNone) {
    table.problem("role",
                  "\"follow\" is for a camera whose head tells its angles and can be "
                  "turned: it needs axes = \"visca:...\", "
                  "\"onvif:...\" or \"v4l2:...\"");
  } else if (follows && !can_turn(camera.axes.protocol)) {
    table.problem("role",
                  "\"follow\" needs a head that can be turned: axes = \"visca:...\", "
                  "\"onvif:...\" or \"v4l2:...\"");
  }
  if (!follows) return table.refuse("follow", "goes with role = \"follow\"");
  auto own = table.table("follow");
  if (!own) return;
  FollowConfig& follow = camera.follow;
  if (const auto names = own->texts("objects")) {
    for (const PlacedText& name : *names) follow.objects.push_back(name.text);
  }
  HeadLimits& limits = follow.limits;
  read_range(*own, "pan_range_deg", 0, limits);
  read_range(*own, "tilt_range_deg", 1, limits);
  number(*own, "rate_deg_s", limits.max_rate, 0.1, 1000, "degrees per second", kDegree);
  number(*own, "acceleration_deg_s2", limits.acceleration, 1, 10000, "degrees per second squared",
         kDegree);
  number(*own, "gain", limits.gain, 0.1, 10, "a number per second");
  number(*own, "latency", limits.latency_s, 0, 1, "a time in seconds");
  number(*own, "dead_zone_deg", limits.dead_zone, 0.01, 10, "degrees", kDegree);
  number(*own, "fastest_deg_s", camera.axes.fastest, 1, 1000, "degrees per second", kDegree);
  if (const auto value = own->number("home_after", 0, 86400, "a time in seconds")) {
    follow.home_after = from_seconds(*value);
  }
  if (const auto value = own->number("scan", 0, 3600, "a time in seconds")) {
    follow.scan = from_seconds(*value);
  }
  read_orders(*own, camera.axes);
  if (const auto value = own->number("yield", 0, 86400, "a time in seconds")) {
    follow.yield = from_seconds(*value);
  }
  if (const auto home = angles(*own, "home_deg")) follow.home = *home;
  if ((follow.home.array() < limits.low.array()).any() ||
      (follow.home.array() > limits.high.array()).any()) {
    own->problem("home_deg", "lies outside of pan_range_deg and tilt_range_deg");
  }
  own->finish();
}

void check_followed(TomlTable& root, const Installation& installation) {
  std::vector<std::string> known;
  for (const ObjectConfig& object : installation.objects) {
    known.push_back(object.description.name);
  }
  for (const CameraConfig& camera : installation.cameras) {
    for (const std::string& name : camera.follow.objects) {
      if (std::ranges::find(known, name) != known.end()) continue;
      root.problem("camera",
                   fmt::format("\"{}\" is to follow \"{}\", and there is no such object{}",
                               camera.name, name, suggestion(name, known)));
    }
  }
}

}  // namespace sightline::config
