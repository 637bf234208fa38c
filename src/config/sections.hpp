// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string_view>
#include <utility>

#include "sightline/config/installation.hpp"

namespace sightline::config {

// The keys of each section, once: SectionReader fills the fields from a table. Numbers carry range
// and unit for messages.

template <typename Value, size_t kCount>
using Choices = std::array<std::pair<std::string_view, Value>, kCount>;

inline constexpr Choices<CameraRole, 4> kRoles{{{"observe+stream", CameraRole::kObserveAndStream},
                                                {"observe", CameraRole::kObserve},
                                                {"stream", CameraRole::kStream},
                                                {"follow", CameraRole::kFollow}}};
inline constexpr Choices<log::Level, 4> kLogLevels{{{"debug", log::Level::kDebug},
                                                    {"info", log::Level::kInfo},
                                                    {"warning", log::Level::kWarning},
                                                    {"error", log::Level::kError}}};
inline constexpr Choices<RasterChoice, 3> kRasterChoices{
    {{"auto", RasterChoice::kAuto}, {"cpu", RasterChoice::kCpu}, {"egl", RasterChoice::kEgl}}};
inline constexpr Choices<FillKind, 2> kFillKinds{
    {{"shaded", FillKind::kShaded}, {"textured", FillKind::kTextured}}};
inline constexpr Choices<Shading, 2> kShadings{
    {{"flat", Shading::kFlat}, {"smooth", Shading::kSmooth}}};
inline constexpr Choices<RawStorage, 2> kRawStorages{
    {{"raw", RawStorage::kRaw}, {"ffv1", RawStorage::kFfv1}}};
inline constexpr Choices<RecordingKind, 3> kRecordingKindNames{
    {{"viewing", RecordingKind::kViewing},
     {"source", RecordingKind::kSource},
     {"poses", RecordingKind::kPoses}}};
inline constexpr Choices<PoseFiles, 3> kPoseFiles{
    {{"csv", PoseFiles::kCsv}, {"mcap", PoseFiles::kMcap}, {"both", PoseFiles::kBoth}}};

inline constexpr Choices<RtspTransport, 3> kTransports{
    {{"tcp", RtspTransport::kTcp}, {"udp", RtspTransport::kUdp}, {"auto", RtspTransport::kAuto}}};
inline constexpr Choices<ExposureStamp, 2> kExposureStamps{
    {{"start", ExposureStamp::kStart}, {"end", ExposureStamp::kEnd}}};

inline constexpr Choices<TriggerEdge, 2> kTriggerEdges{
    {{"rising", TriggerEdge::kRising}, {"falling", TriggerEdge::kFalling}}};

/// The keys of a [[camera]] whose source is a network address. Its size is the calibration's.
template <typename Visitor>
void visit(Visitor& v, NetworkOptions& s) {
  v.text("user", s.user);
  v.text("password", s.password);
  v.choice("transport", s.transport, kTransports);
  v.integer("latency_ms", s.latency_ms, 0, 10000, "a time in milliseconds");
  v.seconds("frame_timeout", s.frame_timeout, 0.1, 3600);
}

/// ... is "v4l2:DEVICE".
template <typename Visitor>
void visit(Visitor& v, V4l2Options& s) {
  v.text("format", s.format);
  v.integer("buffers", s.buffers, 4, 6, "a whole number of buffers");
  v.controls("controls", s.controls);
  v.seconds("frame_timeout", s.frame_timeout, 0.1, 3600);
}

/// ... is "libcamera:ID".
template <typename Visitor>
void visit(Visitor& v, LibcameraOptions& s) {
  v.text("format", s.format);
  v.integer("buffers", s.buffers, 4, 16, "a whole number of buffers");
  v.controls("controls", s.controls);
  v.seconds("frame_timeout", s.frame_timeout, 0.1, 3600);
}

/// ... is "aravis:ID".
template <typename Visitor>
void visit(Visitor& v, AravisOptions& s) {
  v.text("format", s.pixel_format);
  v.integer("offset_x", s.offset_x, 0, 65535, "a whole number of pixels");
  v.integer("offset_y", s.offset_y, 0, 65535, "a whole number of pixels");
  v.number("exposure_us", s.exposure_us, 1, 60e6, "a time in microseconds");
  v.number("gain", s.gain, 0, 1000, "a gain in the camera's unit");
  v.text("trigger", s.trigger);
  v.choice("trigger_edge", s.trigger_edge, kTriggerEdges);
  v.number("trigger_delay_us", s.trigger_delay_us, 0, 10e6, "a time in microseconds");
  v.text("strobe", s.strobe);
  v.integer("action_device_key", s.action.device_key, 0, 0xFFFFFFFF, "a key");
  v.integer("action_group_key", s.action.group_key, 0, 0xFFFFFFFF, "a key");
  v.integer("action_group_mask", s.action.group_mask, 1, 0xFFFFFFFF, "a mask");
  v.choice("stamp", s.stamp, kExposureStamps);
  v.number("transit_us", s.transit_us, 0, 1e6, "a time in microseconds");
  v.flag("latch", s.latch);
  v.flag("chunks", s.chunks);
  v.integer("packet_size", s.packet_size, 576, 65535, "a whole number of bytes");
  v.integer("packet_delay_ns", s.packet_delay_ns, 0, 1'000'000'000, "a time in nanoseconds");
  v.flag("resend", s.resend);
  v.number("resend_ratio", s.resend_ratio, 0, 2, "a share of the packets of a frame");
  v.integer("packet_timeout_us", s.packet_timeout_us, 100, 1'000'000, "a time in microseconds");
  v.integer("frame_retention_us", s.frame_retention_us, 1000, 10'000'000, "a time in microseconds");
  v.integer("socket_buffer", s.socket_buffer, 1 << 16, 1 << 30, "a whole number of bytes");
  v.flag("packet_socket", s.packet_socket);
  v.flag("ptp", s.ptp);
  v.integer("buffers", s.buffers, 4, 64, "a whole number of buffers");
  v.seconds("frame_timeout", s.frame_timeout, 0.1, 3600);
}

template <typename Visitor>
void visit(Visitor& v, OverlayStyle& s) {
  v.theme("theme", s);  // first: it sets all the others
  v.styles("styles", s);
  v.flag("last_seen", s.last_seen);
  v.flag("status", s.status);
  v.flag("hidden_lines", s.hidden_lines);
  v.color("color", s.color);
  v.color("degraded_color", s.degraded_color);
  v.color("coasting_color", s.coasting_color);
  v.color("hidden_color", s.xray_color);
  v.color("last_seen_color", s.last_seen_color);
  v.choice("fill", s.fill_kind, kFillKinds);
  v.choice("shading", s.shading, kShadings);
  v.number("fill_opacity", s.fill_opacity, 0, 1, "a share (0 invisible, 1 opaque)");
  v.number("halo_opacity", s.halo_opacity, 0, 1, "a share (0 invisible, 1 opaque)");
  v.number("outline_width_px", s.outline_px, 2, 4, "a width in pixels");
  v.number("line_width_px", s.line_px, 2, 8, "a width in pixels");
  v.integer("font_px", s.font_px, 8, 64, "a whole number of pixels");
  v.number("ellipse_sigmas", s.ellipse_sigmas, 0.5, 10, "a number of standard deviations");
  v.number("trail_seconds", s.trail_seconds, 0, 3, "a time in seconds");
}

/// The part of [overlay] that cannot differ from camera to camera.
template <typename Visitor>
void visit(Visitor& v, RenderOptions& s) {
  v.choice("backend", s.backend, kRasterChoices);
  v.number("detail_px", s.detail_px, 0, 2, "a length in pixels");
  v.number("crease_deg", s.crease_deg, 0, 180, "an angle in degrees");
  v.file("font_file", s.font_file);
  v.number("depth_tolerance", s.depth_tolerance, 0, 0.5, "a share of the range");
}

template <typename Visitor>
void visit(Visitor& v, VirtualCameraConfig& s) {
  v.integer("width", s.point.width, 16, 8192, "a whole number of pixels");
  v.integer("height", s.point.height, 16, 8192, "a whole number of pixels");
  v.number("rate", s.rate_hz, 0.1, 120, "a frame rate in Hz");
  v.point("eye", s.point.eye);
  v.point("target", s.point.target);
  v.direction("up", s.point.up);
  v.number("fov_deg", s.point.fov_deg, 5, 150, "an angle in degrees");
  v.number("grid_m", s.grid_m, 0, 1000, "a length in meters (0: what fits)");
}

template <typename Visitor>
void visit(Visitor& v, FiducialOptions& s) {
  v.number("gamma", s.gamma, 0.2, 5, "an exponent");
  v.number_of("search_scale", s.search_scale, std::array{1.0, 0.5, 0.25});
  v.number("min_side_px", s.min_side_px, 4, 1000, "a length in pixels");
  v.integer("full_search_interval", s.full_search_interval, 1, 1000, "a whole number of frames");
}

template <typename Visitor>
void visit(Visitor& v, DetectConfig& s) {
  v.flag("enabled", s.enabled);
  v.seconds("interval", s.interval, 0.01, 60);
  v.number("max_load", s.max_load, 0.01, 1, "a share of one core");
  v.number("nearest_m", s.detector.nearest, 0.01, 1000, "a distance in meters");
  v.number("farthest_m", s.detector.farthest, 0.01, 1000, "a distance in meters");
  v.number("accept", s.detector.accept, 0.05, 10, "an evidence");
  v.flag("silhouettes", s.silhouettes);
  v.seconds("learn", s.background.learn, 0.1, 60);
  v.seconds("absorb", s.background.absorb, 5, 100);
}

template <typename Visitor>
void visit(Visitor& v, PointsConfig& s) {
  v.flag("enabled", s.enabled);
  v.number("rate", s.rate_hz, 0.05, 30, "a rate in Hz");
  v.flag("overlay", s.overlay);
}

template <typename Visitor>
void visit(Visitor& v, EstimatorOptions& s) {
  v.number("noise_linear", s.noise.linear, 1e-3, 1000, "an acceleration noise in m/s^2/sqrt(Hz)");
  v.number("noise_angular", s.noise.angular, 1e-3, 1000,
           "an acceleration noise in rad/s^2/sqrt(Hz)");
  v.number("gate_probability", s.gate_probability, 0.9, 0.999999, "a probability");
  v.flag("one_camera_is_degraded", s.one_camera_is_degraded);
  v.flag("flat_print_is_degraded", s.flat_print_is_degraded);
  v.number("max_sigma_m", s.max_sigma_translation, 1e-5, 1, "a length in meters");
  v.number("max_sigma_rad", s.max_sigma_rotation, 1e-4, 1, "an angle in radians");
}

template <typename Visitor>
void visit(Visitor& v, RtspConfig& s) {
  v.flag("enabled", s.enabled);
  v.text("address", s.server.address);
  v.integer("port", s.server.port, 0, 65535, "a port number");
  v.flag("open", s.server.open);
  v.integer("max_clients", s.server.max_clients, 1, 10000, "a whole number of viewers");
  v.integer("max_clients_per_address", s.server.max_clients_per_address, 0, 10000,
            "a whole number of viewers (0: three quarters of max_clients)");
}

template <typename Visitor>
void visit(Visitor& v, EncoderOptions& s) {
  v.integer("bitrate_kbps", s.bitrate_kbps, 0, 200000, "a bit rate in kbit/s (0: by image size)");
  v.integer("keyframe_interval", s.keyframe_interval, 1, 10000, "a whole number of frames");
  v.encoders("prefer", s.prefer);
}

template <typename Visitor>
void visit(Visitor& v, HttpConfig& s) {
  v.flag("enabled", s.enabled);
  v.text("address", s.server.address);
  v.integer("port", s.server.port, 0, 65535, "a port number");
  v.flag("open", s.server.open);
  v.host_names("names", s.server.names);
  v.integer("webrtc_viewers", s.server.webrtc_viewers, 0, 1000,
            "a whole number of viewers (0: no WebRTC)");
}

template <typename Visitor>
void visit(Visitor& v, ActionConfig& s) {
  v.number("rate", s.rate_hz, 0.01, 1000, "a rate in Hz");
  v.text("address", s.command.address);
  v.integer("device_key", s.command.keys.device_key, 0, 0xFFFFFFFF, "a key");
  v.integer("group_key", s.command.keys.group_key, 0, 0xFFFFFFFF, "a key");
  v.integer("group_mask", s.command.keys.group_mask, 1, 0xFFFFFFFF, "a mask");
}

template <typename Visitor>
void visit(Visitor& v, RecordConfig& s) {
  v.flag("enabled", s.enabled);
  v.directory("directory", s.directory);
  v.choice("storage", s.raw_storage, kRawStorages);
  v.choices("kinds", s.kinds, kRecordingKindNames);
  v.choices("on_lost", s.on_lost, kRecordingKindNames);
  v.seconds("before", s.before, 0, 60);
  v.seconds("after", s.after, 1, 3600);
  v.seconds("segment", s.viewing.segment, 1, 86400);
  v.integer("segment_bytes", s.viewing.segment_bytes, 1'000'000, int64_t{1} << 40, "bytes");
  v.choice("poses", s.pose_files, kPoseFiles);
  v.flag("poses_video", s.pose_video);
  v.number("quota_gb", s.quota_gb, 0, 1e6, "gigabytes");
}

template <typename Visitor>
void visit(Visitor& v, MqttOptions& s) {
  v.text("host", s.host);
  v.integer("port", s.port, 1, 65535, "a port number");
  v.text("topic", s.topic);
  v.text("client_id", s.client_id);
  v.text("user", s.user);
  v.file("password_file", s.password_file);
  v.file("ca_file", s.ca_file);
}

inline constexpr Choices<CellRole, 3> kCellRoles{
    {{"both", CellRole::kBoth}, {"cameras", CellRole::kCameras}, {"fusion", CellRole::kFusion}}};

template <typename Visitor>
void visit(Visitor& v, CellOptions& s) {
  v.choice("role", s.role, kCellRoles);
  v.text("name", s.name);
  v.text("host", s.host);
  v.text("broker", s.broker.host);
  v.integer("port", s.broker.port, 1, 65535, "a port number");
  v.text("user", s.broker.user);
  v.file("password_file", s.broker.password_file);
  v.file("ca_file", s.broker.ca_file);
  v.file("certificate", s.broker.certificate);
  v.file("key", s.broker.key);
  v.seconds("age_limit", s.age_limit, 0.01, 0.3);
  v.seconds("clock_bound", s.clock_bound, 1e-6, 1);
  v.seconds("clock_limit", s.clock_limit, 1e-6, 1);
  v.flag("local", s.local);
  v.text("page", s.page);
}

template <typename Visitor>
void visit(Visitor& v, WatchConfig& s) {
  v.flag("enabled", s.enabled);
  v.flag("background", s.background);
  v.flag("auto_recover", s.auto_recover);
}

template <typename Visitor>
void visit(Visitor& v, DaemonConfig& s) {
  v.choice("log_level", s.log_level, kLogLevels);
}

}  // namespace sightline::config
