// SPDX-License-Identifier: Apache-2.0
#include "config/camera_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "config/section_reader.hpp"

namespace sightline::config {
namespace {

constexpr std::string_view kReplayScheme = "replay:";
constexpr std::string_view kAravisScheme = "aravis:";
constexpr std::string_view kV4l2Scheme = "v4l2:";
constexpr std::string_view kLibcameraScheme = "libcamera:";

// Notes the keys that exist for some kind of source, so that one at the wrong kind is told so.
class KeyList {
 public:
  explicit KeyList(std::vector<std::string>& keys) : keys_(keys) {}
  template <typename... Rest>
  void flag(std::string_view key, Rest&&...) {
    add(key);
  }
  template <typename... Rest>
  void integer(std::string_view key, Rest&&...) {
    add(key);
  }
  template <typename... Rest>
  void number(std::string_view key, Rest&&...) {
    add(key);
  }
  template <typename... Rest>
  void seconds(std::string_view key, Rest&&...) {
    add(key);
  }
  template <typename... Rest>
  void text(std::string_view key, Rest&&...) {
    add(key);
  }
  template <typename... Rest>
  void choice(std::string_view key, Rest&&...) {
    add(key);
  }
  template <typename... Rest>
  void controls(std::string_view key, Rest&&...) {
    add(key);
  }

 private:
  void add(std::string_view key) { keys_.emplace_back(key); }
  std::vector<std::string>& keys_;
};

template <typename Options>
std::vector<std::string> keys_of() {
  std::vector<std::string> keys;
  KeyList list(keys);
  Options options;
  visit(list, options);
  return keys;
}

std::vector<std::string> all_source_keys() {
  std::vector<std::string> all{"loop", "recorded_as", "in_step"};
  for (const auto& keys : {keys_of<NetworkOptions>(), keys_of<AravisOptions>(),
                           keys_of<V4l2Options>(), keys_of<LibcameraOptions>()}) {
    all.insert(all.end(), keys.begin(), keys.end());
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

bool is_network_address(const std::string& source) {
  for (const std::string_view scheme : {"rtsp://", "rtsps://", "http://", "https://"}) {
    if (source.starts_with(scheme)) return true;
  }
  return false;
}

void refuse_other_keys(TomlTable& table, const std::vector<std::string>& own,
                       std::string_view kind) {
  for (const std::string& key : all_source_keys()) {
    if (std::find(own.begin(), own.end(), key) == own.end()) {
      table.refuse(key, fmt::format("is not for {}", kind));
    }
  }
}

// Which keys fit cannot be said while the source is wrong.
void allow_all_source_keys(TomlTable& table) {
  for (const std::string& key : all_source_keys()) table.allow(key);
}

// One table while its source is read.
class SourceReader {
 public:
  SourceReader(TomlTable& table, const std::filesystem::path& file, const InstallationFiles& files,
               CameraConfig& camera)
      : table_(table), file_(file), files_(files), camera_(camera) {}

  void read(const std::string& source) {
    if (source.starts_with(kReplayScheme)) {
      read_recorded(source.substr(kReplayScheme.size()));
    } else if (is_network_address(source)) {
      camera_.source = SourceKind::kNetwork;
      camera_.network.url = source;
      if (const auto url = check_network_url(source); !url) {
        table_.problem("source", url.error().text);
      }
      read_live(camera_.network);
    } else if (source.starts_with(kAravisScheme)) {
      read_device(SourceKind::kAravis, kAravisScheme, source, camera_.aravis, camera_.aravis.id);
    } else if (source.starts_with(kV4l2Scheme)) {
      read_device(SourceKind::kV4l2, kV4l2Scheme, source, camera_.v4l2, camera_.v4l2.device);
    } else if (source.starts_with(kLibcameraScheme)) {
      read_device(SourceKind::kLibcamera, kLibcameraScheme, source, camera_.libcamera,
                  camera_.libcamera.id);
    } else {
      refuse(source);
    }
  }

 private:
  void read_recorded(const std::string& folder) {
    SectionReader reader(table_, file_, files_);
    reader.flag("loop", camera_.loop);
    reader.flag("in_step", camera_.in_step);
    reader.text("recorded_as", camera_.recorded_as);
    if (folder.empty()) {
      table_.problem("source", "\"replay:\" needs the folder of a recording behind it");
    } else {
      camera_.recording = resolve(file_, folder);
    }
    refuse_other_keys(table_, {"loop", "recorded_as", "in_step"}, "a recording");
  }

  template <typename Options>
  void read_device(SourceKind kind, std::string_view scheme, const std::string& source,
                   Options& options, std::string& id) {
    camera_.source = kind;
    id = source.substr(scheme.size());
    if (id.empty()) {
      table_.problem(
          "source",
          fmt::format("\"{}\" needs a camera behind it, as `sightline cameras` names it", scheme));
    }
    options.rate_hz = camera_.rate_hz;
    read_live(options);
  }

  // The size is the calibration's: an image of another one could not be drawn into.
  template <typename Options>
  void read_live(Options& options) {
    SectionReader reader(table_, file_, files_);
    visit(reader, options);
    options.width = camera_.calibration.model.width();
    options.height = camera_.calibration.model.height();
    refuse_other_keys(table_, keys_of<Options>(), "this kind of source");
  }

  void refuse(const std::string& source) {
    allow_all_source_keys(table_);
    // What has an @ may hold a password.
    const bool quotable = source.find('@') == std::string::npos;
    table_.problem("source",
                   fmt::format("{} is no source; known: replay:FOLDER (a recording), "
                               "v4l2:DEVICE, aravis:ID, libcamera:ID, rtsp://ADDRESS, "
                               "http://ADDRESS",
                               quotable ? fmt::format("\"{}\"", source.substr(0, 200)) : "this"));
  }

  TomlTable& table_;
  const std::filesystem::path& file_;
  const InstallationFiles& files_;
  CameraConfig& camera_;
};

}  // namespace

void read_camera_source(TomlTable& table, const std::filesystem::path& file,
                        const InstallationFiles& files, CameraConfig& camera) {
  const bool named =
      table.require("source", "where its images come from, as in \"v4l2:/dev/v4l/by-id/...\"");
  const auto source = named ? table.text("source") : std::nullopt;
  if (source) {
    SourceReader(table, file, files, camera).read(source->text);
  } else {
    allow_all_source_keys(table);
  }
}

namespace {

// What goes with some protocols only.
void read_axes_details(TomlTable& table, const std::filesystem::path& file,
                       AxisSourceOptions& axes) {
  const bool serial = axes.protocol == AxisProtocol::kViscaSerial;
  const bool counts_places =
      serial || axes.protocol == AxisProtocol::kVisca || axes.protocol == AxisProtocol::kV4l2;
  const bool onvif = axes.protocol == AxisProtocol::kOnvif;
  const auto belongs = [&table](std::string_view key, bool there, bool fits, std::string_view to) {
    if (there && !fits) table.problem(key, fmt::format("goes with axes = \"{}:...\"", to));
    return there && fits;
  };
  const auto counts = table.number("axes_counts_per_degree", 0.01, 1e6, "counts per degree");
  const auto unit = table.number("axes_degrees_per_unit", 0.01, 360, "degrees");
  const auto baud = table.integer("axes_baud", 1200, 115200, "bits per second");
  const auto user = table.text("axes_user"), password = table.text("axes_password_file");
  if (belongs("axes_counts_per_degree", counts.has_value(), counts_places,
              "visca:...\" or \"v4l2")) {
    axes.counts_per_degree = *counts;
  }
  if (belongs("axes_baud", baud.has_value(), serial, "visca:/dev/TTY")) {
    axes.baud = static_cast<int>(*baud);
    if (!is_baud_rate(axes.baud)) {
      table.problem("axes_baud",
                    "serial lines have 1200, 2400, 4800, 9600, 19200, 38400, 57600 or "
                    "115200 bits per second");
    }
  }
  if (belongs("axes_degrees_per_unit", unit.has_value(), onvif, "onvif")) {
    axes.degrees_per_unit = *unit;
  }
  if (belongs("axes_user", user.has_value(), onvif, "onvif")) axes.user = user->text;
  if (belongs("axes_password_file", password.has_value(), onvif, "onvif")) {
    axes.password_file = resolve(file, password->text);
  }
}

// "v4l2" alone means the camera that the images come from.
void name_own_device(TomlTable& table, CameraConfig& camera) {
  if (camera.axes.protocol != AxisProtocol::kV4l2 || !camera.axes.line.empty()) return;
  camera.axes.line = camera.source == SourceKind::kV4l2 ? camera.v4l2.device : "";
  if (camera.axes.line.empty()) {
    table.problem("axes",
                  "the images do not come from V4L2: name the camera whose controls turn "
                  "it, as in \"v4l2:/dev/v4l/by-id/...\"");
  }
}

}  // namespace

void read_axes(TomlTable& table, const std::filesystem::path& file, bool calibrated,
               CameraConfig& camera) {
  const bool turns = calibrated && camera.calibration.axes;
  const auto text = table.text("axes");
  if (turns && !camera.scene_depth.empty()) {
    table.problem("scene_depth",
                  "a depth image is of one place, and this camera turns: give the "
                  "scene as meshes");
  }
  if (text && calibrated && !turns) {
    table.problem("axes", "the calibration has no [camera.axes] of this camera: it stands still");
  } else if (text && camera.source == SourceKind::kReplay) {
    table.problem("axes", "a recording brings its own angles (axes.csv)");
  } else if (text) {
    auto options = parse_axis_source(text->text, camera.name);
    if (options) {
      camera.axes = *std::move(options);
      name_own_device(table, camera);
    } else {
      table.problem("axes", options.error().text);
    }
  } else if (turns && camera.source != SourceKind::kReplay) {
    table.problem("name", fmt::format("the calibration says that \"{}\" turns: 'axes' must say who "
                                      "tells its angles",
                                      camera.name));
  }
  read_axes_details(table, file, camera.axes);
  const auto by_picture = table.flag("axes_by_picture");
  if (by_picture && calibrated && !turns) {
    table.problem("axes_by_picture",
                  "the calibration has no [camera.axes] of this camera: it stands still");
  }
  camera.axes_by_picture = by_picture.value_or(camera.axes_by_picture);
}

void read_own_size(TomlTable& table, bool calibrated, CameraConfig& camera) {
  constexpr int kLargest = 32768;
  const auto width = table.integer("width", 1, kLargest, "a whole number of pixels");
  const auto height = table.integer("height", 1, kLargest, "a whole number of pixels");
  if (width.has_value() != height.has_value()) {
    table.problem(width ? "width" : "height", "width and height go together");
  }
  const bool own = width && height;
  const CameraModel& lens = camera.calibration.model;
  const int w = own ? static_cast<int>(*width) : calibrated ? lens.width() : 0;
  const int h = own ? static_cast<int>(*height) : calibrated ? lens.height() : 0;
  const auto set = [&](auto& options) {
    options.width = w;
    options.height = h;
  };
  set(camera.network);
  set(camera.aravis);
  set(camera.v4l2);
  set(camera.libcamera);
}

}  // namespace sightline::config
