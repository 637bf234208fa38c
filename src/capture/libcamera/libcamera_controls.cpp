// SPDX-License-Identifier: Apache-2.0
#include "capture/libcamera/libcamera_controls.hpp"

#include <libcamera/control_ids.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>

namespace sightline::capture {
namespace {

using libcamera::ControlId;
using libcamera::ControlInfo;
using libcamera::ControlInfoMap;
using libcamera::ControlValue;

// Choices by name; libcamera 0.0.3 does not tell them. The numbers are part of its interface.
struct Choice {
  std::string_view control, name;
  int32_t value;
};
constexpr std::array kChoices = {
    Choice{"AfMode", "manual", 0},
    Choice{"AfMode", "auto", 1},
    Choice{"AfMode", "continuous", 2},
    Choice{"AfRange", "normal", 0},
    Choice{"AfRange", "macro", 1},
    Choice{"AfRange", "full", 2},
    Choice{"AfSpeed", "normal", 0},
    Choice{"AfSpeed", "fast", 1},
    Choice{"AwbMode", "auto", 0},
    Choice{"AwbMode", "incandescent", 1},
    Choice{"AwbMode", "tungsten", 2},
    Choice{"AwbMode", "fluorescent", 3},
    Choice{"AwbMode", "indoor", 4},
    Choice{"AwbMode", "daylight", 5},
    Choice{"AwbMode", "cloudy", 6},
    Choice{"AeMeteringMode", "center", 0},
    Choice{"AeMeteringMode", "spot", 1},
    Choice{"AeMeteringMode", "matrix", 2},
    Choice{"AeConstraintMode", "normal", 0},
    Choice{"AeConstraintMode", "highlight", 1},
    Choice{"AeConstraintMode", "shadows", 2},
    Choice{"AeExposureMode", "normal", 0},
    Choice{"AeExposureMode", "short", 1},
    Choice{"AeExposureMode", "long", 2},
    Choice{"AeFlickerMode", "off", 0},
    Choice{"AeFlickerMode", "manual", 1},
    Choice{"AeFlickerMode", "auto", 2},
    Choice{"ExposureTimeMode", "auto", 0},
    Choice{"ExposureTimeMode", "manual", 1},
    Choice{"AnalogueGainMode", "auto", 0},
    Choice{"AnalogueGainMode", "manual", 1},
};

std::optional<int32_t> choice(std::string_view control, std::string_view name) {
  for (const Choice& c : kChoices) {
    if (c.control == control && c.name == name) return c.value;
  }
  return std::nullopt;
}

std::string choices_of(std::string_view control) {
  std::string names;
  for (const Choice& c : kChoices) {
    if (c.control == control) names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", c.name);
  }
  return names;
}

// These take several numbers, which their type does not say in 0.0.3.
bool is_list(std::string_view control) {
  constexpr std::array<std::string_view, 6> kLists = {
      "FrameDurationLimits", "SensorBlackLevels", "ColourCorrectionMatrix",
      "AfWindows",           "ScalerCrops",       "FrameDurations"};
  return std::find(kLists.begin(), kLists.end(), control) != kLists.end();
}

Error refused(const std::string& where, const std::string& control, std::string_view expected) {
  return make_error(ErrorCode::kInvalidInput, where, "control '{}' takes {}", control, expected);
}

// A number out of any kind of value; nullopt for texts that name none.
std::optional<double> number_of(std::string_view control, const LibcameraControlValue& value) {
  if (const auto* const whole = std::get_if<int64_t>(&value)) return static_cast<double>(*whole);
  if (const auto* const number = std::get_if<double>(&value)) return *number;
  const auto& text = std::get<std::string>(value);
  if (const auto found = choice(control, text)) return *found;
  if (text == "on" || text == "true") return 1;
  if (text == "off" || text == "false") return 0;
  return std::nullopt;
}

std::optional<double> number_of(const ControlValue& value) {
  if (value.isArray()) return std::nullopt;
  switch (value.type()) {
    case libcamera::ControlTypeBool:
      return value.get<bool>() ? 1 : 0;
    case libcamera::ControlTypeByte:
      return value.get<uint8_t>();
    case libcamera::ControlTypeInteger32:
      return value.get<int32_t>();
    case libcamera::ControlTypeInteger64:
      return static_cast<double>(value.get<int64_t>());
    case libcamera::ControlTypeFloat:
      return value.get<float>();
    default:
      return std::nullopt;
  }
}

Result<ControlValue> two_numbers(const std::string& control, const LibcameraControlValue& value,
                                 const std::string& where) {
  std::array<float, 2> numbers{};
  const auto* const text = std::get_if<std::string>(&value);
  const char* at = text != nullptr ? text->data() : nullptr;
  const char* const end = at != nullptr ? at + text->size() : nullptr;
  for (float& number : numbers) {
    while (at != end && (*at == ' ' || *at == ',')) ++at;
    const auto [next, error] = std::from_chars(at, end, number);
    if (at == end || error != std::errc())
      return refused(where, control, "two numbers: \"1.8 1.5\"");
    at = next;
  }
  if (at != end) return refused(where, control, "two numbers: \"1.8 1.5\"");
  return ControlValue(libcamera::Span<const float, 2>(numbers));
}

bool is_whole(double number) { return number == std::floor(number); }

Result<ControlValue> value_for(const ControlId& id, const ControlInfo& info,
                               const LibcameraControlValue& requested, const std::string& where) {
  const std::string& name = id.name();
  if (name == "FrameDurationLimits")
    return refused(where, name, "nothing here: use the key 'rate'");
  if (is_list(name)) return refused(where, name, "several values, which cannot be given here");
  if (name == "ColourGains") return two_numbers(name, requested, where);
  const auto number = number_of(name, requested);
  if (!number) {
    const std::string names = choices_of(name);
    return refused(where, name, names.empty() ? "a number, or true or false" : "one of " + names);
  }
  const auto low = number_of(info.min()), high = number_of(info.max());
  if (low && high && *low < *high && (*number < *low || *number > *high)) {
    return refused(where, name, fmt::format("{} to {}, not {}", *low, *high, *number));
  }
  switch (id.type()) {
    case libcamera::ControlTypeBool:
      if (*number != 0 && *number != 1) return refused(where, name, "true or false");
      return ControlValue(*number != 0);
    case libcamera::ControlTypeByte:
      if (!is_whole(*number) || *number < 0 || *number > 255)
        return refused(where, name, "0 to 255");
      return ControlValue(static_cast<uint8_t>(*number));
    case libcamera::ControlTypeInteger32:
      if (!is_whole(*number) || std::abs(*number) > std::numeric_limits<int32_t>::max()) {
        return refused(where, name, "a whole number");
      }
      return ControlValue(static_cast<int32_t>(*number));
    case libcamera::ControlTypeInteger64:
      if (!is_whole(*number) || std::abs(*number) > 9e15)
        return refused(where, name, "a whole number");
      return ControlValue(static_cast<int64_t>(*number));
    case libcamera::ControlTypeFloat:
      return ControlValue(static_cast<float>(*number));
    default:
      return refused(where, name, "a value of a kind that cannot be given here");
  }
}

const ControlId* find(const ControlInfoMap& offered, const std::string& name) {
  for (const auto& [id, info] : offered) {
    if (id->name() == name) return id;
  }
  return nullptr;
}

}  // namespace

std::string control_names(const ControlInfoMap& offered) {
  std::vector<std::string> names;
  for (const auto& [id, info] : offered) names.push_back(id->name());
  std::sort(names.begin(), names.end());
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

Result<libcamera::ControlList> libcamera_controls(
    const ControlInfoMap& offered, const std::map<std::string, LibcameraControlValue>& requested,
    const std::string& where) {
  libcamera::ControlList list(offered);
  for (const auto& [name, value] : requested) {
    const ControlId* const id = find(offered, name);
    if (id == nullptr) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "the camera has no control '{}'; it has: {}", name, control_names(offered));
    }
    SL_ASSIGN(const ControlValue converted, value_for(*id, offered.at(id->id()), value, where));
    list.set(id->id(), converted);
  }
  return list;
}

std::vector<std::string> control_differences(const libcamera::ControlList& set,
                                             const libcamera::ControlList& metadata) {
  constexpr double kTolerance = 0.05;  // sensors round exposure and gain to lines and steps
  std::vector<std::string> lines;
  for (const auto& [id, value] : set) {
    if (!metadata.contains(id)) continue;
    const auto requested = number_of(value), got = number_of(metadata.get(id));
    if (!requested || !got || std::abs(*requested - *got) <= kTolerance * std::abs(*requested))
      continue;
    const auto& names = libcamera::controls::controls;
    const auto name = names.find(id);
    lines.push_back(fmt::format("control '{}' is {} after it was set to {}",
                                name != names.end() ? name->second->name() : std::to_string(id),
                                *got, *requested));
  }
  return lines;
}

}  // namespace sightline::capture
