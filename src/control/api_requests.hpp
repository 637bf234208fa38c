// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/control/http_content.hpp"

namespace sightline::control {

/// Of a request's address; a key that comes several times keeps all values, in order.
using Query = std::multimap<std::string, std::string>;

/// Body of a hint: {"camera", "x", "y"[, "radius_px"]} in pixels, or {"translation_m": [3 numbers],
/// "rotation_wxyz": [4 numbers]}. Strict: what is unknown, missing, given twice, no finite number
/// or not a rotation is kInvalidInput with the key's name.
Result<HintRequest> parse_hint(std::string_view body);

/// A body that has to be empty or {}.
Status parse_nothing(std::string_view body);

/// Body of an order to record: {"kinds": ["viewing", ...], "seconds": 1 .. 86400}, both optional;
/// `may_last`: whether "seconds" is known. Which kinds there are is not its affair.
Result<RecordingOrder> parse_recording_order(std::string_view body, bool may_last);

/// Body of a mark: {"text": "..."}, of at most 1000 bytes.
Result<std::string> parse_mark(std::string_view body);

/// Body of an order to turn: {"pan_deg", "tilt_deg", "seconds": 1 .. 86400}, all optional; the
/// angles go together.
Result<TurnOrder> parse_turn(std::string_view body);

/// Body of another overlay: "camera" (a name) and keys of [overlay], which are handed on as TOML:
/// what they may be is the configuration's affair.
Result<OverlayRequest> parse_overlay(std::string_view body);

/// {"cameras": ["left", ...]}; empty where none are named.
Result<std::vector<std::string>> parse_cameras(std::string_view body);

/// Body of an order to capture: {"target" or "target_toml", "cameras": [...], "keep_lenses",
/// "moving", "readouts", "resume": true or false}, all optional; "readouts" with "moving".
Result<CaptureOrder> parse_capture(std::string_view body);

/// "camera" (several), "annotated" (0 or 1), "rate_hz" (0.1 .. 240).
Result<PictureRequest> parse_pictures(const Query& query);

/// "after" (the number of a message, 0 without it).
Result<uint64_t> parse_after(const Query& query);

/// One of the keys that are known, each of which may come once; kInvalidInput names any other.
Result<bool> parse_flag(const Query& query, const std::string& key);

}  // namespace sightline::control
