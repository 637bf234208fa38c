// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_configure.hpp"

#include <arpa/inet.h>
#include <net/ethernet.h>
#include <sys/socket.h>

#include <algorithm>
#include <cmath>

#include "capture/common/stop_check.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::capture {
namespace {

constexpr double kRateSlack = 1.001;  // cameras round their largest rate

bool is_triggered(const AravisOptions& options) {
  return !options.trigger.empty() && options.trigger != "free";
}

bool has(ArvCamera* camera, const char* feature) {
  return ask(false,
             [&](GError** e) { return arv_camera_is_feature_available(camera, feature, e) != 0; });
}

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

Status set_format(ArvCamera* camera, const AravisOptions& options, const std::string& name) {
  const std::vector<std::string> usable = usable_formats(camera);
  std::string chosen = options.pixel_format;
  if (chosen.empty()) {
    const std::string current = text_or_empty(ask<const char*>(
        nullptr, [&](GError** e) { return arv_camera_get_pixel_format_as_string(camera, e); }));
    if (find_genicam_format(current) != nullptr || usable.empty()) return {};
    chosen = usable.front();
  }
  if (std::find(usable.begin(), usable.end(), chosen) == usable.end()) {
    return make_error(ErrorCode::kInvalidInput, name, "no pixel format {}; this camera has: {}",
                      chosen, usable.empty() ? "none that can be used" : join(usable));
  }
  return attempt(name, "set pixel format " + chosen, [&](GError** e) {
    arv_camera_set_pixel_format_from_string(camera, chosen.c_str(), e);
  });
}

Status set_region(ArvCamera* camera, const AravisOptions& options, const std::string& name) {
  if (options.width == 0 && options.height == 0) return {};
  int low_w = 0, high_w = 0, low_h = 0, high_h = 0;
  // The offset limits the size: take it away first.
  ask(0, [&](GError** e) { return arv_camera_set_integer(camera, "OffsetX", 0, e), 0; });
  ask(0, [&](GError** e) { return arv_camera_set_integer(camera, "OffsetY", 0, e), 0; });
  SL_RETURN_IF_ERROR(attempt(name, "ask for the width", [&](GError** e) {
    arv_camera_get_width_bounds(camera, &low_w, &high_w, e);
  }));
  SL_RETURN_IF_ERROR(attempt(name, "ask for the height", [&](GError** e) {
    arv_camera_get_height_bounds(camera, &low_h, &high_h, e);
  }));
  if (options.width < low_w || options.width > high_w || options.height < low_h ||
      options.height > high_h) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "no size {}x{}: this camera takes {}x{} to {}x{}", options.width,
                      options.height, low_w, low_h, high_w, high_h);
  }
  SL_RETURN_IF_ERROR(attempt(name, "set the region", [&](GError** e) {
    arv_camera_set_region(camera, options.offset_x, options.offset_y, options.width, options.height,
                          e);
  }));
  return {};
}

Status set_exposure_and_gain(ArvCamera* camera, const AravisOptions& options,
                             const std::string& name) {
  if (options.exposure_us > 0) {
    ask(0,
        [&](GError** e) { return arv_camera_set_exposure_time_auto(camera, ARV_AUTO_OFF, e), 0; });
    double low = 0, high = 0;
    SL_RETURN_IF_ERROR(attempt(name, "ask for the exposure time", [&](GError** e) {
      arv_camera_get_exposure_time_bounds(camera, &low, &high, e);
    }));
    if (options.exposure_us < low || options.exposure_us > high) {
      return make_error(ErrorCode::kInvalidInput, name,
                        "no exposure of {} us: this camera takes {} to {} us", options.exposure_us,
                        low, high);
    }
    SL_RETURN_IF_ERROR(attempt(name, "set the exposure time", [&](GError** e) {
      arv_camera_set_exposure_time(camera, options.exposure_us, e);
    }));
  }
  if (options.gain >= 0) {
    ask(0, [&](GError** e) { return arv_camera_set_gain_auto(camera, ARV_AUTO_OFF, e), 0; });
    SL_RETURN_IF_ERROR(attempt(name, "set the gain",
                               [&](GError** e) { arv_camera_set_gain(camera, options.gain, e); }));
  }
  return {};
}

Status set_rate(ArvCamera* camera, const AravisOptions& options, const std::string& name) {
  // A triggered camera's rate is that of its triggers.
  if (options.rate_hz <= 0 || is_triggered(options)) return {};
  double low = 0, high = 0;
  SL_RETURN_IF_ERROR(attempt(name, "ask for the frame rate", [&](GError** e) {
    arv_camera_get_frame_rate_bounds(camera, &low, &high, e);
  }));
  if (options.rate_hz < low / kRateSlack || options.rate_hz > high * kRateSlack) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "no rate of {} Hz: with this size, format and exposure the camera takes "
                      "{:.4g} to {:.4g} Hz",
                      options.rate_hz, low, high);
  }
  return attempt(name, "set the frame rate", [&](GError** e) {
    arv_camera_set_frame_rate(camera, std::clamp(options.rate_hz, low, high), e);
  });
}

Status set_action(ArvCamera* camera, const GigeActionKeys& action, const std::string& name) {
  // One signal is chosen by most cameras; those with several count from 1.
  ask(0, [&](GError** e) { return arv_camera_set_integer(camera, "ActionSelector", 1, e), 0; });
  const auto set = [&](const char* feature, uint32_t value) {
    return attempt(name, fmt::format("set {} to {}", feature, value),
                   [&](GError** e) { arv_camera_set_integer(camera, feature, int64_t{value}, e); });
  };
  SL_RETURN_IF_ERROR(set("ActionDeviceKey", action.device_key));
  SL_RETURN_IF_ERROR(set("ActionGroupKey", action.group_key));
  return set("ActionGroupMask", action.group_mask);
}

Status set_trigger(ArvCamera* camera, const AravisOptions& options, const std::string& name) {
  if (!is_triggered(options)) {
    if (!has(camera, "TriggerSelector")) return {};
    return attempt(name, "switch triggers off",
                   [&](GError** e) { arv_camera_clear_triggers(camera, e); });
  }
  const std::string source = options.trigger == "software" ? "Software" : options.trigger;
  unsigned count = 0;
  const GArray1<const char*> sources(ask<const char**>(nullptr, [&](GError** e) {
    return arv_camera_dup_available_trigger_sources(camera, &count, e);
  }));
  std::vector<std::string> names;
  for (unsigned i = 0; sources && i < count; ++i) names.emplace_back(sources[i]);
  if (std::find(names.begin(), names.end(), source) == names.end()) {
    return make_error(ErrorCode::kInvalidInput, name, "no trigger {}; this camera has: {}", source,
                      names.empty() ? "none" : join(names));
  }
  SL_RETURN_IF_ERROR(attempt(name, "set trigger " + source, [&](GError** e) {
    arv_camera_set_trigger(camera, source.c_str(), e);
  }));
  if (source.starts_with("Action")) SL_RETURN_IF_ERROR(set_action(camera, options.action, name));
  if (options.trigger_edge != TriggerEdge::kAsIs) {
    const char* const edge =
        options.trigger_edge == TriggerEdge::kRising ? "RisingEdge" : "FallingEdge";
    SL_RETURN_IF_ERROR(attempt(name, fmt::format("trigger at the {}", edge), [&](GError** e) {
      arv_camera_set_string(camera, "TriggerActivation", edge, e);
    }));
  }
  if (options.trigger_delay_us < 0) return {};
  return attempt(name, "set the trigger's delay", [&](GError** e) {
    arv_camera_set_float(camera, "TriggerDelay", options.trigger_delay_us, e);
  });
}

// One camera's strobe is the others' trigger.
Status set_strobe(ArvCamera* camera, const AravisOptions& options, const std::string& name) {
  if (options.strobe.empty()) return {};
  const auto set = [&](const char* feature, const char* value) {
    return attempt(name,
                   fmt::format("put the strobe on {} ({} = {})", options.strobe, feature, value),
                   [&](GError** e) { arv_camera_set_string(camera, feature, value, e); });
  };
  SL_RETURN_IF_ERROR(set("LineSelector", options.strobe.c_str()));
  // A line that is an output for good has no mode to set.
  ask(0, [&](GError** e) { return arv_camera_set_string(camera, "LineMode", "Output", e), 0; });
  return set("LineSource", "ExposureActive");
}

Status set_ptp(ArvCamera* camera, const AravisOptions& options, const std::string& name) {
  for (const char* feature : {"PtpEnable", "GevIEEE1588"}) {
    if (!has(camera, feature)) continue;
    if (!options.ptp) return {};  // what somebody else has set stays
    return attempt(name, "switch PTP on",
                   [&](GError** e) { arv_camera_set_boolean(camera, feature, TRUE, e); });
  }
  if (!options.ptp) return {};
  return make_error(ErrorCode::kInvalidInput, name, "this camera has no PTP: set ptp = false");
}

Status set_transport(ArvCamera* camera, const AravisOptions& options, const std::string& name) {
  if (arv_camera_is_uv_device(camera)) {
    // Aravis' asynchronous mode loses buffers that are returned at once, and then stalls silently.
    arv_camera_uv_set_usb_mode(camera, ARV_UV_USB_MODE_SYNC);
    return {};
  }
  if (!arv_camera_is_gv_device(camera)) return {};
  if (!options.packet_socket) {
    arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  }
  if (options.packet_size > 0) {
    arv_camera_gv_set_packet_size_adjustment(camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
    SL_RETURN_IF_ERROR(attempt(
        name, fmt::format("set packets of {} bytes", options.packet_size),
        [&](GError** e) { arv_camera_gv_set_packet_size(camera, options.packet_size, e); }));
  } else {
    SL_RETURN_IF_ERROR(attempt(name, "negotiate the packet size (try packet_size = 1400)",
                               [&](GError** e) { arv_camera_gv_auto_packet_size(camera, e); }));
  }
  if (options.packet_delay_ns < 0) return {};
  return attempt(name, "set the packet delay", [&](GError** e) {
    arv_camera_gv_set_packet_delay(camera, options.packet_delay_ns, e);
  });
}

// As Aravis tries: where it fails, an ordinary socket is read.
bool may_open_packet_socket() {
  return UniqueFd(::socket(PF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons(ETH_P_ALL))).is_open();
}

Status read_back(ArvCamera* camera, const std::string& name, AravisSettings& settings) {
  ArvPixelFormat code = 0;
  SL_RETURN_IF_ERROR(attempt(name, "ask for the pixel format",
                             [&](GError** e) { code = arv_camera_get_pixel_format(camera, e); }));
  settings.format = find_genicam_format(static_cast<uint32_t>(code));
  if (settings.format == nullptr) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "the camera sends pixel format {:#010x}, which is not one of: {}",
                      static_cast<uint32_t>(code), join(usable_formats(camera)));
  }
  int x = 0, y = 0;
  SL_RETURN_IF_ERROR(attempt(name, "ask for the region", [&](GError** e) {
    arv_camera_get_region(camera, &x, &y, &settings.width, &settings.height, e);
  }));
  if (genicam_row_bytes(*settings.format, settings.width) == 0) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "{} rows of {} pixels do not end on a byte: take a width divisible by 4",
                      settings.format->name, settings.width);
  }
  unsigned payload = 0;
  SL_RETURN_IF_ERROR(attempt(name, "ask for the size of a frame",
                             [&](GError** e) { payload = arv_camera_get_payload(camera, e); }));
  settings.payload = payload;
  return {};
}

void read_times(ArvCamera* camera, AravisSettings& settings) {
  if (settings.triggered) {
    settings.rate_hz = settings.fire_hz;
  } else {
    settings.rate_hz = ask(0.0, [&](GError** e) { return arv_camera_get_frame_rate(camera, e); });
  }
  settings.exposure_us =
      ask(0.0, [&](GError** e) { return arv_camera_get_exposure_time(camera, e); });
  if (!std::isfinite(settings.rate_hz) || settings.rate_hz < 0) settings.rate_hz = 0;
  if (!std::isfinite(settings.exposure_us) || settings.exposure_us < 0) settings.exposure_us = 0;
  const bool automatic = ask(false, [&](GError** e) {
    return arv_camera_is_exposure_auto_available(camera, e) != 0 &&
           arv_camera_get_exposure_time_auto(camera, e) != ARV_AUTO_OFF;
  });
  if (!automatic) return;
  const double period_us = settings.rate_hz > 0 ? 1e6 / settings.rate_hz : 1e5;
  settings.exposure_range_us = std::max(period_us, settings.exposure_us);
}

}  // namespace

std::vector<std::string> usable_formats(ArvCamera* camera) {
  unsigned count = 0;
  const GArray1<const char*> offered(ask<const char**>(nullptr, [&](GError** e) {
    return arv_camera_dup_available_pixel_formats_as_strings(camera, &count, e);
  }));
  std::vector<std::string> names;
  for (const GenicamFormat& format : genicam_formats()) {
    for (unsigned i = 0; offered && i < count; ++i) {
      if (format.name == offered[i]) names.emplace_back(format.name);
    }
  }
  return names;
}

std::string ptp_state(ArvCamera* camera) {
  for (const char* feature : {"PtpStatus", "GevIEEE1588Status"}) {
    if (!has(camera, feature)) continue;
    return text_or_empty(ask<const char*>(
        nullptr, [&](GError** e) { return arv_camera_get_string(camera, feature, e); }));
  }
  return "";
}

std::optional<int64_t> ptp_offset(ArvCamera* camera) {
  if (!has(camera, "PtpOffsetFromMaster")) return std::nullopt;
  if (has(camera, "PtpDataSetLatch")) {
    ask(0, [&](GError** e) { return arv_camera_execute_command(camera, "PtpDataSetLatch", e), 0; });
  }
  ErrorSlot slot;
  const int64_t offset = arv_camera_get_integer(camera, "PtpOffsetFromMaster", slot.out());
  if (slot) return std::nullopt;
  return offset;
}

Result<AravisSettings> configure_aravis(ArvCamera* camera, const AravisOptions& options,
                                        const std::string& name, AravisChunks& chunks,
                                        const std::stop_token& stop) {
  // A client that crashed may have left it running, and then most features are locked.
  const Status stopped =
      attempt(name, "stop the camera", [&](GError** e) { arv_camera_stop_acquisition(camera, e); });
  if (!stopped && stopped.error().code == ErrorCode::kTimeout) return stopped.error();
  using Step = Status (*)(ArvCamera*, const AravisOptions&, const std::string&);
  for (const Step step : {set_format, set_region, set_exposure_and_gain, set_trigger, set_strobe,
                          set_rate, set_ptp, set_transport}) {
    SL_RETURN_IF_ERROR(check_not_stopped(stop, name));
    SL_RETURN_IF_ERROR(step(camera, options, name));
  }
  SL_RETURN_IF_ERROR(check_not_stopped(stop, name));
  chunks = AravisChunks::set_up(camera, options.chunks);
  SL_RETURN_IF_ERROR(attempt(name, "choose continuous acquisition", [&](GError** e) {
    arv_camera_set_acquisition_mode(camera, ARV_ACQUISITION_MODE_CONTINUOUS, e);
  }));
  AravisSettings settings;
  settings.triggered = is_triggered(options);
  if (options.trigger == "software") settings.fire_hz = std::max(options.rate_hz, 0.0);
  settings.gige = arv_camera_is_gv_device(camera) != 0;
  settings.packet_socket = settings.gige && options.packet_socket && may_open_packet_socket();
  if (settings.gige) {
    settings.packet_size = static_cast<int>(
        ask(0u, [&](GError** e) { return arv_camera_gv_get_packet_size(camera, e); }));
  }
  SL_RETURN_IF_ERROR(read_back(camera, name, settings));
  read_times(camera, settings);
  return settings;
}

}  // namespace sightline::capture
