// SPDX-License-Identifier: Apache-2.0
#include <linux/videodev2.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>

#include "capture/common/stop_check.hpp"
#include "capture/v4l2/v4l2_device.hpp"
#include "sightline/base/log.hpp"

namespace sightline::capture {
namespace {

constexpr int kMaxControls = 512;
constexpr int64_t kMaxTextBytes = 4096;

struct Control {
  std::string name;
  v4l2_query_ext_ctrl query{};

  bool is_switch() const { return query.type == V4L2_CTRL_TYPE_BOOLEAN || is_menu(); }
  bool is_menu() const {
    return query.type == V4L2_CTRL_TYPE_MENU || query.type == V4L2_CTRL_TYPE_INTEGER_MENU;
  }
};

// "Exposure Time, Absolute" -> "exposure_time_absolute", as v4l2-ctl has it.
std::string plain_name(std::string_view name) {
  std::string plain;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte)) {
      plain += static_cast<char>(std::tolower(byte));
    } else if (!plain.empty() && plain.back() != '_') {
      plain += '_';
    }
  }
  while (!plain.empty() && plain.back() == '_') plain.pop_back();
  return plain;
}

std::string bounded(const char* text, size_t size) { return {text, strnlen(text, size)}; }

std::vector<Control> controls_of(const V4l2Device& device) {
  std::vector<Control> controls;
  uint32_t id = 0;
  for (int i = 0; i < kMaxControls; ++i) {
    Control control;
    control.query.id = id | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (device.call(VIDIOC_QUERY_EXT_CTRL, control.query) < 0 || control.query.id <= id) break;
    id = control.query.id;
    if (control.query.type == V4L2_CTRL_TYPE_CTRL_CLASS ||
        (control.query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) {
      continue;
    }
    control.name = plain_name(bounded(control.query.name, sizeof control.query.name));
    controls.push_back(std::move(control));
  }
  return controls;
}

Error no_such_control(const V4l2Device& device, const std::string& name,
                      const std::vector<Control>& controls) {
  std::string names;
  for (const Control& control : controls) names += (names.empty() ? "" : ", ") + control.name;
  return make_error(ErrorCode::kInvalidInput, device.where(),
                    "{} ({}) has no control '{}'; it has: {}", device.path(), device.card(), name,
                    names.empty() ? "none" : names);
}

Result<int64_t> menu_value(const V4l2Device& device, const Control& control,
                           const std::string& entry) {
  std::string names;
  for (int64_t i = control.query.minimum;
       i <= control.query.maximum && i - control.query.minimum < 256; ++i) {
    v4l2_querymenu menu{};
    menu.id = control.query.id;
    menu.index = static_cast<uint32_t>(i);
    if (device.call(VIDIOC_QUERYMENU, menu) < 0) continue;
    const std::string name =
        control.query.type == V4L2_CTRL_TYPE_INTEGER_MENU
            ? std::to_string(menu.value)
            : plain_name(bounded(reinterpret_cast<const char*>(menu.name), sizeof menu.name));
    if (name == plain_name(entry)) return i;
    names += (names.empty() ? "" : ", ") + name;
  }
  return make_error(ErrorCode::kInvalidInput, device.where(),
                    "control '{}' has no entry '{}'; it has: {}", control.name, entry, names);
}

Result<int64_t> number_for(const V4l2Device& device, const Control& control,
                           const V4l2ControlValue& value) {
  if (const auto* const number = std::get_if<int64_t>(&value)) {
    if (*number >= control.query.minimum && *number <= control.query.maximum) return *number;
    return make_error(ErrorCode::kInvalidInput, device.where(), "control '{}' takes {}..{}, not {}",
                      control.name, control.query.minimum, control.query.maximum, *number);
  }
  const auto& text = std::get<std::string>(value);
  if (control.is_menu()) return menu_value(device, control, text);
  if (control.query.type == V4L2_CTRL_TYPE_BOOLEAN && (text == "on" || text == "true")) return 1;
  if (control.query.type == V4L2_CTRL_TYPE_BOOLEAN && (text == "off" || text == "false")) return 0;
  return make_error(ErrorCode::kInvalidInput, device.where(),
                    "control '{}' takes a number, not '{}'", control.name, text);
}

Error refused(const V4l2Device& device, const Control& control, int r) {
  Error error = device.error(V4l2Step::kControl, r);
  error.text = fmt::format("control '{}': {}", control.name, error.text);
  return error;
}

v4l2_ext_controls list_with(v4l2_ext_control& one) {
  v4l2_ext_controls list{};
  list.which = V4L2_CTRL_WHICH_CUR_VAL;
  list.count = 1;
  list.controls = &one;
  return list;
}

Status set_text(const V4l2Device& device, const Control& control, std::string text) {
  if (static_cast<int64_t>(text.size()) > std::min<int64_t>(control.query.maximum, kMaxTextBytes)) {
    return make_error(ErrorCode::kInvalidInput, device.where(),
                      "control '{}' takes at most {} characters", control.name,
                      control.query.maximum);
  }
  text.resize(
      std::max(text.size(), static_cast<size_t>(std::max<int64_t>(control.query.minimum, 0))), ' ');
  v4l2_ext_control one{};
  one.id = control.query.id;
  one.size = static_cast<uint32_t>(text.size() + 1);
  one.string = text.data();
  v4l2_ext_controls list = list_with(one);
  const int r = device.call(VIDIOC_S_EXT_CTRLS, list);
  return r < 0 ? Status(refused(device, control, r)) : Status();
}

Status set_number(const V4l2Device& device, const Control& control, int64_t value) {
  const bool wide = control.query.type == V4L2_CTRL_TYPE_INTEGER64;
  v4l2_ext_control one{};
  one.id = control.query.id;
  if (wide) {
    one.value64 = value;
  } else {
    one.value = static_cast<int32_t>(value);
  }
  v4l2_ext_controls list = list_with(one);
  if (const int r = device.call(VIDIOC_S_EXT_CTRLS, list); r < 0) {
    return refused(device, control, r);
  }
  if ((control.query.flags & V4L2_CTRL_FLAG_WRITE_ONLY) != 0 ||
      device.call(VIDIOC_G_EXT_CTRLS, list) < 0) {
    return {};
  }
  const int64_t got = wide ? one.value64 : one.value;
  if (got != value) {
    log::warning("{}: control '{}' is {} after it was set to {}", device.where(), control.name, got,
                 value);
  }
  return {};
}

Status set_one(const V4l2Device& device, const Control& control, const V4l2ControlValue& value) {
  if (control.query.type == V4L2_CTRL_TYPE_STRING && std::holds_alternative<std::string>(value)) {
    return set_text(device, control, std::get<std::string>(value));
  }
  SL_ASSIGN(const int64_t number, number_for(device, control, value));
  return set_number(device, control, number);
}

std::optional<int32_t> get_control(const V4l2Device& device, uint32_t id) {
  v4l2_control control{};
  control.id = id;
  if (device.call(VIDIOC_G_CTRL, control) < 0) return std::nullopt;
  return control.value;
}

}  // namespace

Status set_v4l2_controls(const V4l2Device& device,
                         const std::map<std::string, V4l2ControlValue>& controls,
                         const std::stop_token& stop) {
  const auto offered = controls_of(device);
  std::vector<std::pair<const Control*, const V4l2ControlValue*>> chosen;
  bool names_frame_rate_control = false;
  for (const auto& [name, value] : controls) {
    const std::string plain = plain_name(name);
    const auto found =
        std::find_if(offered.begin(), offered.end(),
                     [&plain](const Control& control) { return control.name == plain; });
    if (found == offered.end()) return no_such_control(device, name, offered);
    names_frame_rate_control |= found->query.id == V4L2_CID_EXPOSURE_AUTO_PRIORITY;
    chosen.emplace_back(&*found, &value);
  }
  const V4l2ControlValue off = int64_t{0};
  for (const Control& control : offered) {
    if (!names_frame_rate_control && control.query.id == V4L2_CID_EXPOSURE_AUTO_PRIORITY) {
      chosen.emplace_back(&control, &off);
    }
  }
  // An automatic mode must be off before the value that it steers can be set.
  std::stable_partition(chosen.begin(), chosen.end(),
                        [](const auto& entry) { return entry.first->is_switch(); });
  for (const auto& [control, value] : chosen) {
    SL_RETURN_IF_ERROR(check_not_stopped(stop, device.where()));
    const Status status = set_one(device, *control, *value);
    if (!status && value == &off) continue;  // ours, not the user's
    SL_RETURN_IF_ERROR(status);
  }
  return {};
}

std::optional<Duration> v4l2_exposure(const V4l2Device& device) {
  const auto mode = get_control(device, V4L2_CID_EXPOSURE_AUTO);
  if (mode && *mode != V4L2_EXPOSURE_MANUAL && *mode != V4L2_EXPOSURE_SHUTTER_PRIORITY) {
    return std::nullopt;
  }
  const auto units = get_control(device, V4L2_CID_EXPOSURE_ABSOLUTE);
  if (!units || *units <= 0) return std::nullopt;
  return std::chrono::microseconds(100) * *units;
}

}  // namespace sightline::capture
