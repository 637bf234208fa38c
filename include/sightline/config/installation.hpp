// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/log.hpp"
#include "sightline/base/result.hpp"
#include "sightline/capture/aravis/gige_action.hpp"
#include "sightline/config/camera_config.hpp"
#include "sightline/config/record_config.hpp"
#include "sightline/config/scene_config.hpp"
#include "sightline/config/watch_config.hpp"
#include "sightline/config/zone_config.hpp"
#include "sightline/control/http_server.hpp"
#include "sightline/fuse/estimator.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/object.hpp"
#include "sightline/observe/detect/detector_options.hpp"
#include "sightline/observe/fiducial/fiducial_observer.hpp"
#include "sightline/observe/scene/background_model.hpp"
#include "sightline/observe/track/object_tracker.hpp"
#include "sightline/publish/cell/cell_options.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/overlay/overlay_style.hpp"
#include "sightline/render/overlay/virtual_camera.hpp"
#include "sightline/stream/encoder.hpp"
#include "sightline/stream/rtsp_server.hpp"

namespace sightline {

/// One object; its index in Installation::objects is its ObjectId.
struct ObjectConfig {
  ObjectDescription description;
  uint64_t content = 0;  ///< hash of object file, mesh and features
  TablePlace place{};
  std::optional<Rigid3> start{};  ///< world_from_object, about, at the start
  bool start_last = false;        ///< there where it was last, before the start

  /// By hash what the files say, and which they are; where it starts matters to nothing that runs.
  bool operator==(const ObjectConfig& other) const {
    return content == other.content && description.file == other.description.file &&
           description.mesh == other.description.mesh;
  }
};

/// One virtual camera; served as a stream of its own.
struct VirtualCameraConfig {
  std::string name;
  ViewPoint point;
  double rate_hz = 15;
  double grid_m = 0;      ///< 0: what fits the rig
  OverlayStyle overlay;   ///< of the objects in it
  CalibratedCamera view;  ///< the camera that the point makes
  TablePlace place{};

  bool operator==(const VirtualCameraConfig&) const = default;
};

/// Stereo points of the tracked objects, live.
struct PointsConfig {
  bool enabled = true;
  double rate_hz = 1;    ///< at most; after each the thread pauses nine times as long as it took
  bool overlay = false;  ///< the cameras' streams show them too

  bool operator==(const PointsConfig&) const = default;
};

struct RtspConfig {
  bool enabled = true;
  RtspOptions server;

  bool operator==(const RtspConfig&) const = default;
};

struct HttpConfig {
  bool enabled = true;
  HttpOptions server;

  bool operator==(const HttpConfig&) const = default;
};

/// Action commands of GigE Vision at a rate: the trigger of cameras whose trigger is "Action1".
struct ActionConfig {
  double rate_hz = 0;  ///< 0: none
  GigeAction command;

  bool operator==(const ActionConfig&) const = default;
};

/// How objects are looked for that nobody knows the place of.
struct DetectConfig {
  bool enabled = true;
  Duration interval = std::chrono::milliseconds(100);  ///< between searches for one object
  double max_load = 0.5;         ///< share of a core, of searches for what is not found for 10 s
  DetectorOptions detector;      ///< nearest, farthest, accept, margin
  bool silhouettes = true;       ///< learn what the cameras see without the object, and use it
  BackgroundOptions background;  ///< learn, absorb

  bool operator==(const DetectConfig&) const = default;
};

struct DaemonConfig {
  log::Level log_level = log::Level::kInfo;

  bool operator==(const DaemonConfig&) const = default;
};

/// An installation file, read and checked against everything it names. Paths are absolute or
/// relative to the working directory.
struct Installation {
  std::filesystem::path file;  ///< itself; the folder for recording_installation()
  std::string content;         ///< content_hash() of its text, 16 hexadecimal digits
  std::string name;
  std::filesystem::path calibration;
  std::vector<CameraConfig> cameras;
  std::vector<ObjectConfig> objects;
  std::vector<VirtualCameraConfig> virtual_cameras;
  SceneConfig scene;
  RenderOptions render;      ///< the parts of [overlay] that all cameras share
  FiducialOptions fiducial;  ///< [fiducial]
  DetectConfig detect;       ///< [detect]
  TrackerOptions tracker;    ///< defaults
  PointsConfig points;
  EstimatorOptions estimator;
  RtspConfig rtsp;
  EncoderOptions encoder;  ///< bitrate_kbps, keyframe_interval, prefer; the rest is the camera's
  HttpConfig http;
  RecordConfig record;
  std::vector<ZoneConfig> zones;
  MqttOptions mqtt;
  CellOptions cell;
  ActionConfig action;
  WatchConfig watch;
  DaemonConfig daemon;
};

/// A camera as a recording lists it: what the configuration checks against.
struct RecordedCameraEntry {
  std::string name;
  int width = 0, height = 0;
};

struct ImageSize {
  int width = 0, height = 0;
};

/// What reading an installation asks of the world beside its text. Tests and fuzzers bring their
/// own.
struct InstallationFiles {
  std::function<Result<std::vector<CalibratedCamera>>(const std::filesystem::path&)> calibration;
  std::function<Result<ObjectDescription>(const std::filesystem::path&)> object;
  std::function<Result<std::vector<RecordedCameraEntry>>(const std::filesystem::path&)> recording;
  /// Of a depth image that can be read.
  std::function<Result<ImageSize>(const std::filesystem::path&)> depth_image_size;
  std::function<bool(const std::filesystem::path&)> is_file;
  std::function<bool(const std::filesystem::path&)> is_directory;
  std::function<uint64_t(const std::filesystem::path&)> content;  ///< hash; 0 if unreadable
  /// Hash of a token file that can be used; 0 for a credential that only the service will have.
  std::function<Result<uint64_t>(const std::filesystem::path&)> tokens;
  /// The same of certificate and key.
  std::function<Result<uint64_t>(const TlsFiles&)> tls;
  /// For the calibration itself: cameras need none, a missing file is no mistake, virtual cameras
  /// are left out. The size is what the file says, else an earlier calibration, else the camera.
  bool uncalibrated = false;

  static InstallationFiles on_disk();
};

/// Reads and checks an installation file (docs/configuration.md). All mistakes are reported at
/// once: `where` is that of the first ("file:line:column"), `text` one line per mistake, the
/// further ones with their own place in front. Nothing is opened but files.
Result<Installation> read_installation(const std::filesystem::path& path);

/// The same for cameras that are to be calibrated: see InstallationFiles::uncalibrated.
Result<Installation> read_uncalibrated_installation(const std::filesystem::path& path);

/// The same from memory; relative paths start at the folder of `path`.
Result<Installation> parse_installation(std::string_view text, const std::filesystem::path& path,
                                        const InstallationFiles& files);

/// An installation for a recording folder as it is: its cameras, calibration, objects and scene,
/// defaults for the rest, and no server. Camera and object ids are those of the recording.
Result<Installation> recording_installation(const std::filesystem::path& folder);

/// Whether any camera or view draws meshes in their own colors, so that these must be read.
bool shows_textures(const Installation& installation);

/// What differs between two installations, so that a reload restarts only that. Cameras and objects
/// are matched by name, names in the order of the new (removed: of the old) file.
struct InstallationChanges {
  std::vector<std::string> cameras_added, cameras_removed;
  std::vector<std::string> cameras_changed;   ///< anything but the overlay
  std::vector<std::string> cameras_restyled;  ///< only the overlay
  std::vector<std::string> objects_added, objects_removed, objects_changed;
  bool name = false, zones = false, cell = false;
  bool scene_depth = false;  ///< of a camera that stays; it is one of cameras_changed
  bool calibration = false;  ///< another file; what it says is the cameras'
  bool views = false;        ///< any of the virtual cameras
  bool camera_ids = false;   ///< a camera that stays has another CameraId now
  bool object_ids = false;
  bool surfaces = false;  ///< textures of the meshes, or their creases
  bool observe = false;   ///< options of markers, search, tracking or points
  bool scene = false, render = false, estimator = false, action = false, watch = false;
  bool rtsp = false, encoder = false, http = false, record = false, mqtt = false, daemon = false;

  bool operator==(const InstallationChanges&) const = default;

  bool none() const;
  /// One line for the log: "camera left changed; overlay of side; rtsp", "nothing".
  std::string summary() const;
};
InstallationChanges compare(const Installation& before, const Installation& after);

}  // namespace sightline
