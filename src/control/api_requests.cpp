// SPDX-License-Identifier: Apache-2.0
#include "control/api_requests.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <vector>

namespace sightline::control {
namespace {

using Json = nlohmann::json;

constexpr int kDeepest = 4;
constexpr size_t kLongestName = 256;
constexpr size_t kMostKinds = 8, kLongestMark = 1000;
constexpr double kFarthestPx = 1e6, kFarthest = 1e6;

Error wrong(std::string text) { return {ErrorCode::kInvalidInput, std::move(text), ""}; }

/// What the library would take: keys that come twice, and nesting without an end.
class StrictKeys {
 public:
  bool operator()(int depth, Json::parse_event_t event, Json& value) {
    if (depth > kDeepest) fault_ = "is nested too deeply";
    if (event == Json::parse_event_t::object_start) keys_.emplace_back();
    if (event == Json::parse_event_t::object_end) keys_.pop_back();
    if (event == Json::parse_event_t::key && !keys_.back().insert(value.get<std::string>()).second)
      fault_ = "has a key twice: " + value.get<std::string>().substr(0, kLongestName);
    return true;
  }
  const std::string& fault() const { return fault_; }

 private:
  std::vector<std::set<std::string>> keys_;
  std::string fault_;
};

Result<Json> parse_object(std::string_view body) {
  StrictKeys strict;
  Json json;
  try {
    json = Json::parse(body.begin(), body.end(), std::ref(strict));
  } catch (const Json::exception& error) {
    return wrong(fmt::format("the body is not JSON: {}", error.what()));
  }
  if (!strict.fault().empty()) return wrong("the body " + strict.fault());
  if (!json.is_object()) return wrong("the body has to be a JSON object");
  return json;
}

Status only_keys(const Json& json, std::initializer_list<std::string_view> known) {
  for (const auto& [key, value] : json.items()) {
    if (std::ranges::find(known, key) == known.end()) {
      return wrong(fmt::format("\"{}\" is not known; there are {}", key.substr(0, kLongestName),
                               fmt::join(known, ", ")));
    }
  }
  return {};
}

Result<double> number(const Json& json, const char* key, double low, double high) {
  const auto found = json.find(key);
  if (found == json.end()) return wrong(fmt::format("\"{}\" is missing: a number", key));
  if (!found->is_number()) return wrong(fmt::format("\"{}\" has to be a number", key));
  const double value = found->get<double>();
  if (!(value >= low && value <= high)) {
    return wrong(fmt::format("\"{}\" has to be from {} to {}", key, low, high));
  }
  return value;
}

Result<std::vector<double>> numbers(const Json& json, const char* key, size_t count) {
  const auto found = json.find(key);
  const bool good = found != json.end() && found->is_array() && found->size() == count &&
                    std::ranges::all_of(*found, [](const Json& n) {
                      return n.is_number() && std::abs(n.get<double>()) <= kFarthest;
                    });
  if (!good) return wrong(fmt::format("\"{}\" has to be {} numbers", key, count));
  return found->get<std::vector<double>>();
}

Result<HintRequest> parse_place(const Json& json) {
  SL_RETURN_IF_ERROR(only_keys(json, {"camera", "x", "y", "radius_px"}));
  HintRequest::Place place;
  const Json& camera = json.at("camera");
  if (!camera.is_string()) return wrong("\"camera\" has to be a name");
  place.camera = camera.get<std::string>();
  SL_ASSIGN(const double x, number(json, "x", -kFarthestPx, kFarthestPx));
  SL_ASSIGN(const double y, number(json, "y", -kFarthestPx, kFarthestPx));
  place.pixel = {x, y};
  if (json.contains("radius_px")) {
    SL_ASSIGN(const double radius, number(json, "radius_px", 1, 1e4));
    place.radius_px = radius;
  }
  return HintRequest{place};
}

Result<HintRequest> parse_pose(const Json& json) {
  SL_RETURN_IF_ERROR(only_keys(json, {"translation_m", "rotation_wxyz"}));
  SL_ASSIGN(const auto t, numbers(json, "translation_m", 3));
  SL_ASSIGN(const auto q, numbers(json, "rotation_wxyz", 4));
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  if (!(std::abs(rotation.norm() - 1) < 1e-3)) {
    return wrong("\"rotation_wxyz\" has to be a unit quaternion");
  }
  Rigid3 pose;
  pose.rotation = rotation.normalized();
  pose.translation = {t[0], t[1], t[2]};
  return HintRequest{pose};
}

/// Of "cameras"; none where the key is not there.
Result<std::vector<std::string>> camera_names(const Json& json) {
  if (!json.contains("cameras")) return std::vector<std::string>();
  const Json& names = json.at("cameras");
  const bool good = names.is_array() && !names.empty() &&
                    std::ranges::all_of(names, [](const Json& name) { return name.is_string(); });
  if (!good) return wrong("\"cameras\" has to be a list of names");
  return names.get<std::vector<std::string>>();
}

Result<double> parse_number(const std::string& key, const std::string& text, double low,
                            double high) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= low && value <= high))
    return wrong(fmt::format("{} has to be a number from {} to {}", key, low, high));
  return value;
}

Result<bool> parse_bool(const std::string& key, const std::string& text) {
  if (text != "0" && text != "1") return wrong(key + " has to be 0 or 1");
  return text == "1";
}

Status known_once(const Query& query, std::initializer_list<std::string_view> once,
                  std::string_view often = "") {
  for (const auto& [key, value] : query) {
    if (key == often) continue;
    if (std::ranges::find(once, key) == once.end()) {
      return wrong(fmt::format("\"{}\" is not known", key.substr(0, kLongestName)));
    }
    if (query.count(key) > 1) return wrong(key + " comes twice");
  }
  return {};
}

}  // namespace

Result<HintRequest> parse_hint(std::string_view body) {
  SL_ASSIGN(const Json json, parse_object(body));
  if (json.contains("camera")) return parse_place(json);
  if (json.contains("translation_m")) return parse_pose(json);
  return wrong("say where: camera, x and y in pixels, or translation_m and rotation_wxyz");
}

Status parse_nothing(std::string_view body) {
  if (body.empty()) return {};
  SL_ASSIGN(const Json json, parse_object(body));
  if (!json.empty()) return wrong("the body has to be empty or {}");
  return {};
}

Result<RecordingOrder> parse_recording_order(std::string_view body, bool may_last) {
  RecordingOrder order;
  if (body.empty()) return order;
  SL_ASSIGN(const Json json, parse_object(body));
  SL_RETURN_IF_ERROR(may_last ? only_keys(json, {"kinds", "seconds"}) : only_keys(json, {"kinds"}));
  if (json.contains("seconds")) {
    SL_ASSIGN(const double seconds, number(json, "seconds", 1, 86400));
    order.seconds = seconds;
  }
  if (!json.contains("kinds")) return order;
  const Json& kinds = json.at("kinds");
  const bool good = kinds.is_array() && !kinds.empty() && kinds.size() <= kMostKinds &&
                    std::ranges::all_of(kinds, [](const Json& kind) { return kind.is_string(); });
  if (!good) return wrong("\"kinds\" has to be a list of names");
  order.kinds = kinds.get<std::vector<std::string>>();
  return order;
}

Result<TurnOrder> parse_turn(std::string_view body) {
  constexpr double kDegree = std::numbers::pi / 180;
  TurnOrder order;
  if (body.empty()) return order;
  SL_ASSIGN(const Json json, parse_object(body));
  SL_RETURN_IF_ERROR(only_keys(json, {"pan_deg", "tilt_deg", "seconds"}));
  if (json.contains("pan_deg") || json.contains("tilt_deg")) {
    SL_ASSIGN(const double pan, number(json, "pan_deg", -360, 360));
    SL_ASSIGN(const double tilt, number(json, "tilt_deg", -360, 360));
    order.pan_tilt = Eigen::Vector2d(pan, tilt) * kDegree;
  }
  if (json.contains("seconds")) {
    SL_ASSIGN(const double seconds, number(json, "seconds", 1, 86400));
    order.seconds = seconds;
  }
  return order;
}

Result<OverlayRequest> parse_overlay(std::string_view body) {
  SL_ASSIGN(const Json json, parse_object(body));
  OverlayRequest request;
  for (const auto& [key, value] : json.items()) {
    if (key == "camera") {
      if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
        return wrong("\"camera\" has to be a name");
      }
      request.camera = value.get<std::string>();
      continue;
    }
    const bool list = value.is_array() &&
                      std::ranges::all_of(value, [](const Json& one) { return one.is_string(); });
    if (!list && !value.is_boolean() && !value.is_number() && !value.is_string()) {
      return wrong(fmt::format("\"{}\" has to be a number, a text, true, false or a list of texts",
                               key.substr(0, kLongestName)));
    }
    // Texts, numbers and lists of JSON are those of TOML.
    request.keys += Json(key).dump() + " = " + value.dump() + "\n";
  }
  if (request.keys.empty()) return wrong("say what to change, as in {\"theme\": \"minimal\"}");
  return request;
}

Result<std::vector<std::string>> parse_cameras(std::string_view body) {
  if (body.empty()) return std::vector<std::string>();
  SL_ASSIGN(const Json json, parse_object(body));
  SL_RETURN_IF_ERROR(only_keys(json, {"cameras"}));
  return camera_names(json);
}

Result<CaptureOrder> parse_capture(std::string_view body) {
  CaptureOrder order;
  if (body.empty()) return order;
  SL_ASSIGN(const Json json, parse_object(body));
  SL_RETURN_IF_ERROR(only_keys(
      json, {"target", "target_toml", "cameras", "keep_lenses", "moving", "readouts", "resume"}));
  for (const auto& [key, text] :
       {std::pair("target", &order.target), std::pair("target_toml", &order.target_toml)}) {
    if (!json.contains(key)) continue;
    const Json& value = json.at(key);
    if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
      return wrong(fmt::format("\"{}\" has to be a text", key));
    }
    *text = value.get<std::string>();
  }
  if (!order.target.empty() && !order.target_toml.empty()) {
    return wrong("\"target\" and \"target_toml\" are one too many");
  }
  for (const auto& [key, flag] :
       {std::pair("keep_lenses", &order.keep_lenses), std::pair("moving", &order.moving),
        std::pair("readouts", &order.readouts), std::pair("resume", &order.resume)}) {
    if (!json.contains(key)) continue;
    if (!json.at(key).is_boolean()) {
      return wrong(fmt::format("\"{}\" has to be true or false", key));
    }
    *flag = json.at(key).get<bool>();
  }
  if (order.readouts && !order.moving) {
    return wrong("\"readouts\" needs \"moving\": rows tell their times by a target in motion");
  }
  SL_ASSIGN(order.cameras, camera_names(json));
  return order;
}

Result<std::string> parse_mark(std::string_view body) {
  if (body.empty()) return std::string();
  SL_ASSIGN(const Json json, parse_object(body));
  SL_RETURN_IF_ERROR(only_keys(json, {"text"}));
  if (!json.contains("text")) return std::string();
  const Json& text = json.at("text");
  if (!text.is_string() || text.get_ref<const std::string&>().size() > kLongestMark) {
    return wrong(fmt::format("\"text\" has to be a text of at most {} bytes", kLongestMark));
  }
  return text.get<std::string>();
}

Result<PictureRequest> parse_pictures(const Query& query) {
  SL_RETURN_IF_ERROR(known_once(query, {"annotated", "rate_hz"}, "camera"));
  PictureRequest request;
  const auto [first, last] = query.equal_range("camera");
  for (auto it = first; it != last; ++it) {
    if (std::ranges::find(request.cameras, it->second) != request.cameras.end()) {
      return wrong("a camera comes twice");
    }
    request.cameras.push_back(it->second);
  }
  if (const auto found = query.find("annotated"); found != query.end()) {
    SL_ASSIGN(request.annotated, parse_bool(found->first, found->second));
  }
  if (const auto found = query.find("rate_hz"); found != query.end()) {
    SL_ASSIGN(request.max_rate_hz, parse_number(found->first, found->second, 0.1, 240));
  }
  return request;
}

Result<uint64_t> parse_after(const Query& query) {
  SL_RETURN_IF_ERROR(known_once(query, {"after"}));
  const auto found = query.find("after");
  if (found == query.end()) return uint64_t{0};
  const std::string& text = found->second;
  uint64_t number = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (fault != std::errc() || end != text.data() + text.size()) {
    return wrong("after has to be the number of a message");
  }
  return number;
}

Result<bool> parse_flag(const Query& query, const std::string& key) {
  SL_RETURN_IF_ERROR(known_once(query, {key}));
  const auto found = query.find(key);
  if (found == query.end()) return false;
  return parse_bool(found->first, found->second);
}

}  // namespace sightline::control
