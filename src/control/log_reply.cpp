// SPDX-License-Identifier: Apache-2.0
#include "control/log_reply.hpp"

#include <nlohmann/json.hpp>

#include "sightline/base/log_history.hpp"

namespace sightline::control {
namespace {

using Json = nlohmann::ordered_json;

const char* word(log::Level level) {
  return level >= log::Level::kError ? "error" : level >= log::Level::kWarning ? "warning" : "info";
}

}  // namespace

HttpReply log_reply(const Query& query) {
  const auto after = parse_after(query);
  if (!after) return HttpReply::error(after.error());
  Json events = Json::array();
  for (const log::Event& event : log::history(*after)) {
    Json json{{"number", event.number},
              {"utc_ns", event.utc_ns},
              {"level", word(event.level)},
              {"text", event.text}};
    if (!event.camera.empty()) json["camera"] = event.camera;
    if (!event.object.empty()) json["object"] = event.object;
    if (!event.cause.empty()) json["cause"] = event.cause;
    events.push_back(std::move(json));
  }
  // Names of files and devices may be any bytes.
  return HttpReply::json(
      Json{{"events", std::move(events)}}.dump(2, ' ', false, Json::error_handler_t::replace) +
      "\n");
}

}  // namespace sightline::control
