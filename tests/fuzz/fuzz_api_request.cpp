// SPDX-License-Identifier: Apache-2.0
// What HTTP clients send, by its first byte: a body, a query, a path, headers, a file of tokens.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "control/api_requests.hpp"
#include "control/gatekeeper.hpp"
#include "control/host_name.hpp"
#include "control/router.hpp"
#include "sightline/base/check.hpp"

namespace {

using namespace sightline;
using namespace sightline::control;

void body(std::string_view text) {
  const auto hint = parse_hint(text);
  if (!hint) {
    SL_CHECK(!hint.error().text.empty(), "every refusal says why");
    (void)HttpReply::error(hint.error());
  } else if (const auto* pose = std::get_if<Rigid3>(&hint->where)) {
    SL_CHECK(std::abs(pose->rotation.norm() - 1) < 1e-9, "a rotation");
    SL_CHECK(pose->translation.allFinite(), "finite");
  } else {
    SL_CHECK(std::get<HintRequest::Place>(hint->where).pixel.allFinite(), "finite");
  }
  (void)parse_nothing(text);
  const auto order = parse_recording_order(text, true);
  SL_CHECK(!order || !order->seconds || (*order->seconds >= 1 && *order->seconds <= 86400), "time");
  const auto mark = parse_mark(text);
  SL_CHECK(!mark || mark->size() <= 1000, "a mark has an end");
  (void)parse_overlay(text);
  (void)parse_cameras(text);
  const auto capture = parse_capture(text);
  SL_CHECK(!capture || capture->target.empty() || capture->target_toml.empty(), "one target");
  const auto turn = parse_turn(text);
  SL_CHECK(!turn || !turn->pan_tilt || turn->pan_tilt->cwiseAbs().maxCoeff() < 6.3, "angles");
}

void query(std::string_view text) {
  Query query;
  while (!text.empty()) {
    const auto pair = text.substr(0, text.find('&'));
    const auto key = pair.substr(0, pair.find('='));
    query.emplace(key, pair.size() > key.size() ? pair.substr(key.size() + 1) : "");
    text.remove_prefix(std::min(text.size(), pair.size() + 1));
  }
  const auto pictures = parse_pictures(query);
  SL_CHECK(!pictures || pictures->max_rate_hz == 0 ||
               (pictures->max_rate_hz >= 0.1 && pictures->max_rate_hz <= 240),
           "a rate");
  (void)parse_flag(query, "state");
  (void)parse_after(query);
}

void path(std::string_view text) {
  for (const char* const method : {"GET", "POST", "PUT", "DELETE"}) {
    const Match found = match(method, text);
    SL_CHECK(found.route == nullptr || found.route->method == method, "of that method");
    const auto slashes = std::ranges::count(found.name, '/');
    const bool two = found.route != nullptr && found.route->pattern.ends_with("{path}");
    SL_CHECK(slashes == (two ? 1 : 0), "as many parts of a path as the pattern has");
  }
}

void headers(std::string_view text) {
  static const std::vector<AccessToken> tokens = {{"a", Role::kOperator, "0123456789abcdef"}};
  Gatekeeper keeper(tokens, Role::kNone);
  const auto secret = secret_of(text);
  const auto answer = keeper.ask(text, {}, time_from_ns(1));
  const bool known = answer.role != Role::kNone;
  SL_CHECK(known == (secret && *secret == tokens[0].secret), "by the token alone");
  if (names_loopback(text)) SL_CHECK(text.find("evil") == std::string_view::npos, "loopback");
  (void)names_this(text, {"rig.example"});
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0]) {
    case 'b':
      body(text);
      break;
    case 'q':
      query(text);
      break;
    case 'p':
      path(text);
      break;
    case 'h':
      headers(text);
      break;
    default:
      (void)parse_tokens(text, "tokens");
  }
  return 0;
}
