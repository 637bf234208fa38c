// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "sightline/capture/aravis/aravis_source.hpp"
#include "sightline/capture/axes/axis_source.hpp"
#include "sightline/capture/libcamera/libcamera_source.hpp"
#include "sightline/capture/network/network_source.hpp"
#include "sightline/capture/v4l2/v4l2_source.hpp"
#include "sightline/config/follow_config.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/render/overlay/overlay_style.hpp"

namespace sightline {

/// "file:line:column" of a table, for errors that are found later. Tables that differ in nothing
/// but their place are equal: a line above them restarts nothing.
struct TablePlace {
  std::string text;

  bool operator==(const TablePlace&) const { return true; }
};

enum class CameraRole : uint8_t {
  kObserveAndStream,
  kStream,
  kObserve,
  kFollow,  ///< observes and streams, and its head turns after objects
};
constexpr bool observes(CameraRole role) { return role != CameraRole::kStream; }
constexpr bool streams(CameraRole role) { return role != CameraRole::kObserve; }

/// Where a camera's images come from: "replay:FOLDER", an RTSP or HTTP address, "aravis:ID",
/// "v4l2:DEVICE", "libcamera:ID".
enum class SourceKind : uint8_t { kReplay, kNetwork, kAravis, kV4l2, kLibcamera };

/// One camera of an installation; its index in Installation::cameras is its CameraId.
struct CameraConfig {
  std::string name;
  SourceKind source = SourceKind::kReplay;
  NetworkOptions network{};  ///< of the four, the one that `source` says is complete, ...
  AravisOptions aravis{};    ///< ... but for the epoch
  V4l2Options v4l2{};
  LibcameraOptions libcamera{};
  AxisSourceOptions axes{};         ///< who tells the angles of a camera that turns
  bool axes_by_picture = true;      ///< and whether its picture refines them
  FollowConfig follow{};            ///< of role kFollow
  std::filesystem::path recording;  ///< folder of the recording that is played ("replay:...")
  std::string recorded_as;          ///< name of the camera in it
  bool loop = true;                 ///< play it again and again
  bool in_step = false;             ///< with the other hosts that play it, by their clocks
  double rate_hz = 0;               ///< nominal, for the encoder; 0: what the source says
  CameraRole role = CameraRole::kObserveAndStream;
  double gamma = 0;              ///< FiducialOptions::gamma of this camera; 0: that of [fiducial]
  CalibratedCamera calibration;  ///< lens, size and place
  OverlayStyle overlay;          ///< [overlay] with this camera's own changes
  /// Depth image of the static scene as this camera sees it; empty: none.
  std::filesystem::path scene_depth{};
  double scene_depth_scale = 0;      ///< [m] per unit of the image; 0: 0.001 (EXR: 1)
  uint64_t scene_depth_content = 0;  ///< hash of the file
  TablePlace place{};

  bool operator==(const CameraConfig&) const = default;
};

/// Of a camera's lens and place: hosts that use it must agree.
uint64_t camera_hash(const CalibratedCamera& camera);

/// The same depth image, read the same way.
inline bool same_scene_depth(const CameraConfig& a, const CameraConfig& b) {
  return a.scene_depth == b.scene_depth && a.scene_depth_scale == b.scene_depth_scale &&
         a.scene_depth_content == b.scene_depth_content;
}

}  // namespace sightline
