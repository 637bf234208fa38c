// SPDX-License-Identifier: Apache-2.0
#include "sightline/config/installation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "config/camera_source.hpp"
#include "config/follow.hpp"
#include "config/names.hpp"
#include "config/object_start.hpp"
#include "config/publishing.hpp"
#include "config/section_reader.hpp"
#include "config/servers.hpp"
#include "config/toml_reader.hpp"
#include "config/zones.hpp"

namespace sightline {
namespace {

using config::PlacedText;
using config::SectionReader;
using config::TomlTable;
namespace fs = std::filesystem;

constexpr size_t kMaxCameras = 64;  // bits of a CameraSet
constexpr size_t kMaxObjects = 255;

// Reads one installation; its methods follow the file from top to bottom.
class InstallationReader {
 public:
  InstallationReader(config::TomlDocument& document, const fs::path& path,
                     const InstallationFiles& files)
      : document_(document), root_(document.root()), path_(path), files_(files) {}

  Result<Installation> read() {
    result_.file = path_;
    result_.http.server.port = 8080;
    result_.name = path_.stem().string();
    if (const auto name = root_.text("name")) result_.name = name->text;
    read_calibration_file();
    read_overlay();
    config::read_cell(root_, path_, files_, result_);
    read_cameras();
    read_objects();
    read_scene();
    read_virtual_cameras();
    section("fiducial", result_.fiducial);
    section("detect", result_.detect);
    section("points", result_.points);
    section("estimator", result_.estimator);
    config::read_servers(root_, path_, files_, result_);
    config::name_page(result_);
    section("encoder", result_.encoder);
    read_record();
    config::read_zones(root_, path_, files_, result_);
    config::read_publish(root_, path_, files_, result_);
    read_action();
    section("watch", result_.watch);
    section("daemon", result_.daemon);
    config::check_cell(root_, result_);
    config::check_followed(root_, result_);
    root_.finish();
    if (!document_.problems().empty()) return document_.problems().error();
    return std::move(result_);
  }

 private:
  template <typename Section>
  void section(std::string_view key, Section& fields) {
    if (auto table = root_.table(key)) {
      SectionReader reader(*table, path_, files_);
      config::visit(reader, fields);
      table->finish();
    }
  }

  void read_calibration_file();
  void read_overlay();
  void read_cameras();
  void read_camera(TomlTable table);
  void add_remote(const CalibratedCamera& camera, RemoteCamera remote);
  void check_recorded(TomlTable& table, const CameraConfig& camera);
  std::optional<CalibratedCamera> calibration_of(TomlTable& table, const std::string& name);
  void check_scene_depth(TomlTable& table, CameraConfig& camera, bool calibrated);
  void check_size(TomlTable& table, const CameraConfig& camera, bool calibrated);
  void read_objects();
  void read_scene();
  void read_virtual_cameras();
  void read_virtual_camera(TomlTable table);
  void read_record();
  void read_action();

  config::TomlDocument& document_;
  TomlTable root_;
  const fs::path& path_;
  const InstallationFiles& files_;
  Installation result_;
  OverlayStyle overlay_;
  std::optional<std::vector<CalibratedCamera>> calibrated_;
  std::vector<CalibratedCamera> remote_;  // of other hosts
  std::map<fs::path, Result<std::vector<RecordedCameraEntry>>> recordings_;
  std::map<std::string, unsigned> camera_lines_;
};

void InstallationReader::read_calibration_file() {
  if (files_.uncalibrated) {
    calibrated_.emplace();
    if (!root_.has("calibration")) return;
  } else if (!root_.require("calibration",
                            "the file of the calibration, as in \"calibration.toml\"")) {
    return;
  }
  const auto file = root_.text("calibration");
  if (!file) return;
  result_.calibration = config::resolve(path_, file->text);
  if (files_.uncalibrated && !files_.is_file(result_.calibration)) return;
  auto cameras = files_.calibration(result_.calibration);
  if (cameras) {
    calibrated_ = *std::move(cameras);
  } else {
    root_.problem("calibration",
                  fmt::format("cannot use this calibration\n  {}", cameras.error().message()),
                  cameras.error().code);
  }
}

void InstallationReader::read_overlay() {
  auto table = root_.table("overlay");
  if (!table) return;
  SectionReader reader(*table, path_, files_);
  config::visit(reader, overlay_);
  config::visit(reader, result_.render);
  table->finish();
}

void InstallationReader::read_cameras() {
  if (!root_.require("camera", "at least one table [[camera]]")) return;
  auto tables = root_.tables("camera");
  if (tables.size() > kMaxCameras) {
    root_.problem("camera",
                  fmt::format("{} cameras; at most {} work together", tables.size(), kMaxCameras));
    return;
  }
  for (TomlTable& table : tables) read_camera(table);
}

std::optional<CalibratedCamera> InstallationReader::calibration_of(TomlTable& table,
                                                                   const std::string& name) {
  if (!calibrated_) return std::nullopt;
  std::vector<std::string> names;
  for (const CalibratedCamera& camera : *calibrated_) {
    if (camera.name == name) return camera;
    names.push_back(camera.name);
  }
  if (files_.uncalibrated) return std::nullopt;
  table.problem("name",
                fmt::format("camera \"{}\" has no calibration in {}{}", name,
                            result_.calibration.string(), config::suggestion(name, names)),
                ErrorCode::kNotFound);
  return std::nullopt;
}

void InstallationReader::read_camera(TomlTable table) {
  std::string name;
  std::optional<CalibratedCamera> calibration;
  if (table.require("name", "the camera's name, as in the calibration")) {
    if (const auto text = table.text("name")) {
      name = text->text;
      const std::string_view fault = config::camera_name_fault(name);
      const auto [first, is_new] = camera_lines_.emplace(name, text->place.line);
      if (!fault.empty()) {
        table.problem("name", fault);
      } else if (!is_new) {
        table.problem("name", fmt::format("there is a camera \"{}\" already, in line {}", name,
                                          first->second));
      } else {
        calibration = calibration_of(table, name);
      }
    }
  }
  if (RemoteCamera remote; config::is_remote(table, result_, remote)) {
    if (calibration) add_remote(*calibration, std::move(remote));
    return;  // the rest is for that host to check
  }
  // Stands in for a calibration that is missing, so that the rest of the table is checked too.
  const bool calibrated = calibration.has_value();
  if (!calibrated) {
    const CameraModel::Parameters any{.width = 2, .height = 2, .fx = 1, .fy = 1};
    calibration = CalibratedCamera{name, *CameraModel::create(any, ""), {}, 0.5};
  }
  CameraConfig camera{.name = name,
                      .recording = {},
                      .recorded_as = name,
                      .calibration = *calibration,
                      .overlay = overlay_,
                      .place = {document_.problems().where(table.place())}};
  SectionReader reader(table, path_, files_);
  reader.number("rate", camera.rate_hz, 0.1, 1000, "a frame rate in Hz");
  reader.choice("role", camera.role, config::kRoles);
  reader.number("gamma", camera.gamma, 0.2, 5, "an exponent");
  if (auto overlay = table.table("overlay")) {
    SectionReader overlay_reader(*overlay, path_, files_);
    config::visit(overlay_reader, camera.overlay);
    overlay->finish();
  }
  reader.file("scene_depth", camera.scene_depth);
  reader.number("scene_depth_scale", camera.scene_depth_scale, 1e-9, 1000, "meters per unit");
  check_scene_depth(table, camera, calibrated);
  config::read_camera_source(table, path_, files_, camera);
  config::read_axes(table, path_, calibrated, camera);
  config::read_follow(table, camera);
  if (files_.uncalibrated) {
    config::read_own_size(table, calibrated, camera);
  } else {
    check_size(table, camera, calibrated);
  }
  if (calibrated || files_.uncalibrated) check_recorded(table, camera);
  table.finish();
  result_.cameras.push_back(std::move(camera));
}

void InstallationReader::add_remote(const CalibratedCamera& camera, RemoteCamera remote) {
  remote.name = camera.name;
  remote.calibration = camera_hash(camera);
  result_.cell.cameras.push_back(std::move(remote));
  remote_.push_back(camera);
}

void InstallationReader::check_size(TomlTable& table, const CameraConfig& camera, bool calibrated) {
  constexpr int kLargest = 32768;
  const CameraModel& lens = camera.calibration.model;
  const auto check = [&](std::string_view key, int calibrated_size) {
    const auto size = table.integer(key, 1, kLargest, "a whole number of pixels");
    if (!size || !calibrated || *size == calibrated_size) return;
    table.problem(key, fmt::format("{} differs from the calibration, which is for {}x{}: give that "
                                   "size or calibrate at this one",
                                   *size, lens.width(), lens.height()));
  };
  check("width", lens.width());
  check("height", lens.height());
  if (calibrated && streams(camera.role) && (lens.width() % 2 != 0 || lens.height() % 2 != 0)) {
    table.problem("name", fmt::format("a camera that is streamed has even width and height; \"{}\" "
                                      "is {}x{}",
                                      camera.name, lens.width(), lens.height()));
  }
}

void InstallationReader::check_scene_depth(TomlTable& table, CameraConfig& camera,
                                           bool calibrated) {
  if (camera.scene_depth.empty() || !files_.is_file(camera.scene_depth)) return;
  camera.scene_depth_content = files_.content(camera.scene_depth);
  const auto size = files_.depth_image_size(camera.scene_depth);
  if (!size) {
    table.problem("scene_depth",
                  fmt::format("cannot use this depth image\n  {}", size.error().message()),
                  size.error().code);
    return;
  }
  const CameraModel& lens = camera.calibration.model;
  if (calibrated && (size->width != lens.width() || size->height != lens.height())) {
    table.problem("scene_depth", fmt::format("{} is {}x{}, the calibration of \"{}\" {}x{}",
                                             camera.scene_depth.string(), size->width, size->height,
                                             camera.name, lens.width(), lens.height()));
  }
}

void InstallationReader::check_recorded(TomlTable& table, const CameraConfig& camera) {
  if (camera.recording.empty()) return;
  auto known = recordings_.find(camera.recording);
  if (known == recordings_.end()) {
    known = recordings_.emplace(camera.recording, files_.recording(camera.recording)).first;
  }
  if (!known->second) {
    const Error& error = known->second.error();
    table.problem("source", fmt::format("cannot play this recording\n  {}", error.message()),
                  error.code);
    return;
  }
  std::vector<std::string> names;
  for (const RecordedCameraEntry& entry : *known->second) {
    if (entry.name != camera.recorded_as) {
      names.push_back(entry.name);
      continue;
    }
    if (files_.uncalibrated) return;
    const CameraModel& lens = camera.calibration.model;
    if (entry.width != lens.width() || entry.height != lens.height()) {
      table.problem("source",
                    fmt::format("the recording of \"{}\" is {}x{}, the calibration of \"{}\" {}x{}",
                                entry.name, entry.width, entry.height, camera.name, lens.width(),
                                lens.height()));
    }
    return;
  }
  table.problem(table.has("recorded_as") ? "recorded_as" : "source",
                fmt::format("the recording has no camera \"{}\"{}", camera.recorded_as,
                            config::suggestion(camera.recorded_as, names)),
                ErrorCode::kNotFound);
}

void InstallationReader::read_action() {
  auto table = root_.table("action");
  if (!table) return;
  SectionReader reader(*table, path_, files_);
  config::visit(reader, result_.action);
  if (result_.action.rate_hz <= 0) {
    table->require("rate", "how many action commands a second are sent");
  }
  const auto& cameras = result_.cameras;
  const bool wanted = std::any_of(cameras.begin(), cameras.end(), [](const CameraConfig& camera) {
    return camera.source == SourceKind::kAravis && camera.aravis.trigger.starts_with("Action");
  });
  if (!wanted) {
    table->problem("rate", "no camera waits for action commands: none has trigger = \"Action1\"");
  }
  table->finish();
}

void InstallationReader::read_objects() {
  std::map<std::string, unsigned> lines;
  auto tables = root_.tables("object");
  if (tables.size() > kMaxObjects) {
    root_.problem("object", fmt::format("{} objects; at most {}", tables.size(), kMaxObjects));
    return;
  }
  for (TomlTable& table : tables) {
    if (table.require("file", "an object file, as in \"objects/carton.toml\"")) {
      if (const auto file = table.text("file")) {
        const fs::path path = config::resolve(path_, file->text);
        auto object = files_.object(path);
        if (!object) {
          table.problem("file",
                        fmt::format("cannot use this object\n  {}", object.error().message()),
                        object.error().code);
        } else if (const auto [first, is_new] = lines.emplace(object->name, file->place.line);
                   !is_new) {
          table.problem("file", fmt::format("there is an object \"{}\" already, in line {}",
                                            object->name, first->second));
        } else {
          uint64_t content = files_.content(path) * 31 + files_.content(object->mesh);
          if (!object->features.empty()) content = content * 31 + files_.content(object->features);
          result_.objects.push_back(
              {*std::move(object), content, {document_.problems().where(table.place())}});
          config::read_start(table, result_.objects.back());
        }
      }
    }
    table.allow("start");
    table.finish();
  }
}

void InstallationReader::read_scene() {
  auto table = root_.table("scene");
  if (!table) return;
  if (const auto meshes = table->texts("meshes")) {
    for (const PlacedText& mesh : *meshes) {
      const fs::path path = config::resolve(path_, mesh.text);
      if (!files_.is_file(path)) {
        document_.problems().add(mesh.place,
                                 fmt::format("meshes: there is no file {}", path.string()),
                                 ErrorCode::kNotFound);
      }
      result_.scene.content = result_.scene.content * 31 + files_.content(path);
      result_.scene.meshes.push_back(path);
    }
  }
  if (const auto unit = table->text("unit")) {
    const auto meters = config::meters_per_unit(unit->text);
    if (!meters) {
      table->problem("unit", fmt::format("expected \"m\", \"cm\", \"mm\" or \"in\", found \"{}\"",
                                         unit->text));
    }
    result_.scene.meters_per_unit = meters.value_or(1.0);
  }
  SectionReader(*table, path_, files_).flag("learn", result_.scene.learn);
  if (auto volume = table->table("volume")) result_.scene.volume = config::read_box(*volume);
  table->finish();
}

void InstallationReader::read_virtual_cameras() {
  if (files_.uncalibrated) return root_.allow("virtual_camera");
  for (TomlTable& table : root_.tables("virtual_camera")) read_virtual_camera(table);
}

void InstallationReader::read_virtual_camera(TomlTable table) {
  VirtualCameraConfig view{
      .name = {},
      .point = {},
      .overlay = virtual_camera_style(overlay_),
      .view = {"", *CameraModel::create({.width = 2, .height = 2, .fx = 1, .fy = 1}, ""), {}},
      .place = {document_.problems().where(table.place())}};
  SectionReader reader(table, path_, files_);
  config::visit(reader, view);
  if (auto overlay = table.table("overlay")) {
    SectionReader overlay_reader(*overlay, path_, files_);
    config::visit(overlay_reader, view.overlay);
    overlay->finish();
  }
  if (table.require("name", "the name of its stream")) {
    if (const auto text = table.text("name")) {
      view.name = text->text;
      const std::string_view fault = config::camera_name_fault(view.name);
      const auto [first, is_new] = camera_lines_.emplace(view.name, text->place.line);
      if (!fault.empty()) {
        table.problem("name", fault);
      } else if (!is_new) {
        table.problem("name",
                      fmt::format("there is a camera or virtual camera \"{}\" already, in line {}",
                                  view.name, first->second));
      }
    }
  }
  std::vector<CalibratedCamera> cameras;
  for (const CameraConfig& camera : result_.cameras) cameras.push_back(camera.calibration);
  cameras.insert(cameras.end(), remote_.begin(), remote_.end());
  auto made = make_view_camera(view.point, cameras, view.name, view.place.text);
  if (made) {
    view.view = *std::move(made);
  } else {
    document_.problems().add(table.place(), "virtual_camera: " + made.error().text);
  }
  table.finish();
  result_.virtual_cameras.push_back(std::move(view));
}

void InstallationReader::read_record() {
  section("record", result_.record);
  const bool wanted = result_.record.enabled || !result_.record.on_lost.empty();
  if (wanted && result_.record.directory.empty()) {
    auto table = root_.table("record");
    if (!table->has("directory")) table->require("directory", "the folder that takes recordings");
  }
  if (result_.record.pose_video && result_.record.pose_files == PoseFiles::kCsv) {
    root_.table("record")->problem("poses_video", "needs poses = \"mcap\" or \"both\"");
  }
}

}  // namespace

Result<Installation> parse_installation(std::string_view text, const fs::path& path,
                                        const InstallationFiles& files) {
  SL_ASSIGN(auto document, config::TomlDocument::parse(text, path.string()));
  return InstallationReader(document, path, files).read();
}

}  // namespace sightline
