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
#include "sightline/capture/aravis_source.hpp"
#include "sightline/capture/libcamera_source.hpp"
#include "sightline/capture/network_source.hpp"
#include "sightline/capture/v4l2_source.hpp"
#include "sightline/control/http_server.hpp"
#include "sightline/fuse/estimator.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/object.hpp"
#include "sightline/observe/background_model.hpp"
#include "sightline/observe/fiducial_observer.hpp"
#include "sightline/observe/object_detector.hpp"
#include "sightline/observe/object_tracker.hpp"
#include "sightline/record/writer.hpp"
#include "sightline/render/camera_renderer.hpp"
#include "sightline/render/free_view.hpp"
#include "sightline/render/overlay_style.hpp"
#include "sightline/stream/encoder.hpp"
#include "sightline/stream/rtsp_server.hpp"

namespace sightline {

enum class CameraRole : uint8_t { kObserveAndStream, kStream, kObserve };
constexpr bool observes(CameraRole role) { return role != CameraRole::kStream; }
constexpr bool streams(CameraRole role) { return role != CameraRole::kObserve; }

/// Where a camera's pictures come from: "replay:FOLDER", an RTSP or HTTP address, "aravis:ID",
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
  std::filesystem::path recording;  ///< folder of the recording that is played ("replay:...")
  std::string recorded_as;          ///< name of the camera in it
  bool loop = true;                 ///< play it again and again
  double rate_hz = 0;               ///< nominal, for the encoder; 0: what the source says
  CameraRole role = CameraRole::kObserveAndStream;
  double gamma = 0;              ///< FiducialOptions::gamma of this camera; 0: that of [observe]
  CalibratedCamera calibration;  ///< lens, size and place
  OverlayStyle overlay;          ///< [overlay] with this camera's own changes
  /// Depth image of the static scene as this camera sees it; empty: none.
  std::filesystem::path scene_depth{};
  double scene_depth_scale = 0;      ///< [m] per unit of the image; 0: 0.001 (EXR: 1)
  uint64_t scene_depth_content = 0;  ///< hash of the image
  std::string where;                 ///< "file:line:column" of its table, for later errors
};

/// One object; its index in Installation::objects is its ObjectId.
struct ObjectConfig {
  ObjectDescription description;
  uint64_t content = 0;  ///< hash of object file and mesh, so that a reload sees a change
  std::string where;
};

/// Static things that hide objects.
struct SceneConfig {
  std::vector<std::filesystem::path> meshes;
  double meters_per_unit = 1.0;
  uint64_t content = 0;  ///< hash of the files
  bool learn = false;    ///< what hides objects is learned from the cameras as well
};

/// One free view; served as a stream of its own.
struct ViewConfig {
  std::string name;
  ViewPoint point;
  double rate_hz = 15;
  double grid_m = 0;      ///< 0: what fits the rig
  OverlayStyle overlay;   ///< of the objects in it
  CalibratedCamera view;  ///< the camera that the point makes
  std::string where;
};

/// Stereo points of the tracked objects, live.
struct PointsConfig {
  bool enabled = true;
  double rate_hz = 1;    ///< at most; a look rests nine times as long as it took
  bool overlay = false;  ///< the cameras' streams show them too
};

struct RtspConfig {
  bool enabled = true;
  RtspOptions server;
};

struct HttpConfig {
  bool enabled = true;
  HttpOptions server;
};

/// Action commands of GigE Vision at a rate: the trigger of cameras whose trigger is "Action1".
struct ActionConfig {
  double rate_hz = 0;  ///< 0: none
  GigeAction command;
};

struct RecordConfig {
  bool enabled = false;
  std::filesystem::path directory;  ///< each run makes a folder of its own in it
  RawStorage raw_storage = RawStorage::kRaw;
};

/// How objects are looked for that nobody knows the place of.
struct DetectConfig {
  bool enabled = true;
  Duration interval = std::chrono::milliseconds(100);  ///< between searches for one object
  DetectorOptions detector;                            ///< nearest, farthest, accept, margin
  bool silhouettes = true;       ///< learn what the cameras see without the object, and use it
  BackgroundOptions background;  ///< learn, absorb
};

struct DaemonConfig {
  log::Level log_level = log::Level::kInfo;
};

/// An installation file, read and checked against everything it names. Paths are absolute or
/// relative to the working directory.
struct Installation {
  std::filesystem::path file;  ///< itself; the folder for recording_installation()
  std::string name;
  std::filesystem::path calibration;
  std::vector<CameraConfig> cameras;
  std::vector<ObjectConfig> objects;
  std::vector<ViewConfig> views;
  SceneConfig scene;
  RenderOptions render;     ///< the parts of [overlay] that all cameras share
  FiducialOptions observe;  ///< [observe]
  DetectConfig detect;      ///< [detect]
  TrackerOptions tracker;   ///< defaults
  PointsConfig points;
  EstimatorOptions estimator;
  RtspConfig rtsp;
  EncoderOptions encoder;  ///< bitrate_kbps, keyframe_interval, prefer; the rest is the camera's
  HttpConfig http;
  RecordConfig record;
  ActionConfig action;
  DaemonConfig daemon;
};

/// A camera as a recording lists it: what the configuration checks against.
struct RecordedCameraEntry {
  std::string name;
  int width = 0, height = 0;
};

/// What reading an installation asks of the world beside its text. Tests and fuzzers bring their
/// own.
struct InstallationFiles {
  std::function<Result<std::vector<CalibratedCamera>>(const std::filesystem::path&)> calibration;
  std::function<Result<ObjectDescription>(const std::filesystem::path&)> object;
  std::function<Result<std::vector<RecordedCameraEntry>>(const std::filesystem::path&)> recording;
  std::function<bool(const std::filesystem::path&)> is_file;
  std::function<bool(const std::filesystem::path&)> is_directory;
  std::function<uint64_t(const std::filesystem::path&)> content;  ///< hash; 0 if unreadable

  static InstallationFiles on_disk();
};

/// Reads and checks an installation file (docs/configuration.md). All mistakes are reported at
/// once: `where` is that of the first ("file:line:column"), `text` one line per mistake, the
/// further ones with their own place in front. Nothing is opened but files.
Result<Installation> read_installation(const std::filesystem::path& path);

/// The same from memory; relative paths start at the folder of `path`.
Result<Installation> parse_installation(std::string_view text, const std::filesystem::path& path,
                                        const InstallationFiles& files);

/// An installation for a recording folder as it is: its cameras, calibration, objects and scene,
/// defaults for the rest, and no server. Camera and object ids are those of the recording.
Result<Installation> recording_installation(const std::filesystem::path& folder);

/// Whether any camera or view draws meshes in their own colours, so that these must be read.
bool shows_textures(const Installation& installation);

/// What differs between two installations, so that a reload restarts only that. Cameras and objects
/// are matched by name, names in the order of the new (removed: of the old) file.
struct InstallationChanges {
  std::vector<std::string> cameras_added, cameras_removed;
  std::vector<std::string> cameras_changed;   ///< source, role, rate or calibration
  std::vector<std::string> cameras_restyled;  ///< only the overlay
  std::vector<std::string> objects_added, objects_removed, objects_changed;
  bool views = false;       ///< any of the free views
  bool camera_ids = false;  ///< a camera that stays has another CameraId now
  bool object_ids = false;
  bool surfaces = false;  ///< textures of the meshes, or their creases
  bool scene = false, render = false, observe = false, estimator = false;
  bool rtsp = false, encoder = false, http = false, record = false, daemon = false;
  bool action = false;

  bool none() const;
  /// One line for the log: "camera left changed; overlay of side; rtsp", "nothing".
  std::string summary() const;
};
InstallationChanges compare(const Installation& before, const Installation& after);

}  // namespace sightline
