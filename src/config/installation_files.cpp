// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <cstdlib>

#include <algorithm>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/control/access.hpp"
#include "sightline/record/recording.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLargestText = size_t{4} << 20;

Result<RecordingManifest> read_manifest(const fs::path& folder) {
  const fs::path file = folder / "recording.toml";
  SL_ASSIGN(const std::string text, read_file(file, kLargestText));
  return parse_recording_toml(text, file.string());
}

Result<std::vector<RecordedCameraEntry>> recorded_cameras(const fs::path& folder) {
  SL_ASSIGN(const RecordingManifest manifest, read_manifest(folder));
  std::vector<RecordedCameraEntry> cameras;
  for (const auto& camera : manifest.cameras) {
    cameras.push_back({camera.name, camera.width, camera.height});
  }
  return cameras;
}

Result<ImageSize> size_of_depth_image(const fs::path& path) {
  SL_ASSIGN(const DepthImage image, read_depth_image(path, 1.0));
  return ImageSize{image.width, image.height};
}

bool file_exists(const fs::path& path) {
  std::error_code code;
  return fs::is_regular_file(path, code);
}

bool directory_exists(const fs::path& path) {
  std::error_code code;
  return fs::is_directory(path, code);
}

// Of a file that is too large to be read whole: size and time of its last change.
uint64_t content_of(const fs::path& path) {
  if (const auto content = read_file(path)) return content_hash(*content);
  std::error_code code;
  const auto size = fs::file_size(path, code);
  if (code) return 0;
  const auto changed = fs::last_write_time(path, code);
  if (code) return 0;
  return content_hash(fmt::format("{} {}", size, changed.time_since_epoch().count()));
}

// Checks one camera of the recording against the calibration beside it.
Result<CameraConfig> camera_of(const RecordingManifest::Camera& recorded, const fs::path& folder,
                               const std::vector<CalibratedCamera>& calibration) {
  const std::string where =
      fmt::format("{}:{}", (folder / "recording.toml").string(), recorded.line);
  const CalibratedCamera* calibrated = find_camera(calibration, recorded.name);
  if (calibrated == nullptr) {
    return make_error(ErrorCode::kNotFound, where,
                      "camera \"{}\" has no calibration in the calibration.toml of the recording",
                      recorded.name);
  }
  const CameraModel& lens = calibrated->model;
  if (lens.width() != recorded.width || lens.height() != recorded.height) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "camera \"{}\" was recorded at {}x{}, but its calibration is for {}x{}",
                      recorded.name, recorded.width, recorded.height, lens.width(), lens.height());
  }
  return CameraConfig{.name = recorded.name,
                      .recording = folder,
                      .recorded_as = recorded.name,
                      .loop = false,
                      .calibration = *calibrated,
                      .overlay = {},
                      .place = {where}};
}

Result<uint64_t> tokens_of(const fs::path& setting) {
  if (setting.string().starts_with("credential:") &&
      std::getenv("CREDENTIALS_DIRECTORY") == nullptr)
    return uint64_t{0};
  SL_RETURN_IF_ERROR(read_tokens(setting));
  SL_ASSIGN(const fs::path path, token_file_path(setting));
  return content_of(path);
}

Result<uint64_t> tls_of(const TlsFiles& tls) {
  const bool later = tls.certificate.string().starts_with("credential:") ||
                     tls.key.string().starts_with("credential:");
  if (later && std::getenv("CREDENTIALS_DIRECTORY") == nullptr) return uint64_t{0};
  SL_RETURN_IF_ERROR(read_tls(tls));
  SL_ASSIGN(const fs::path certificate, token_file_path(tls.certificate));
  SL_ASSIGN(const fs::path key, token_file_path(tls.key));
  return content_of(certificate) * 31 + content_of(key);
}

Result<Installation> read_with(const fs::path& path, const InstallationFiles& files) {
  SL_ASSIGN(const std::string text, read_file(path, kLargestText));
  SL_ASSIGN(Installation installation, parse_installation(text, path, files));
  installation.content = fmt::format("{:016x}", content_hash(text));
  return installation;
}

}  // namespace

InstallationFiles InstallationFiles::on_disk() {
  InstallationFiles files;
  files.calibration = &read_calibration;
  files.object = &read_object_file;
  files.recording = &recorded_cameras;
  files.depth_image_size = &size_of_depth_image;
  files.is_file = &file_exists;
  files.is_directory = &directory_exists;
  files.content = &content_of;
  files.tokens = &tokens_of;
  files.tls = &tls_of;
  return files;
}

Result<Installation> read_installation(const fs::path& path) {
  return read_with(path, InstallationFiles::on_disk());
}

Result<Installation> read_uncalibrated_installation(const fs::path& path) {
  InstallationFiles files = InstallationFiles::on_disk();
  files.uncalibrated = true;
  return read_with(path, files);
}

Result<Installation> recording_installation(const fs::path& folder) {
  SL_ASSIGN(const RecordingManifest manifest, read_manifest(folder));
  Installation installation;
  installation.file = folder;
  installation.name = manifest.name;
  installation.calibration = folder / "calibration.toml";
  SL_ASSIGN(const auto calibration, read_calibration(installation.calibration));
  for (const auto& recorded : manifest.cameras) {
    SL_ASSIGN(CameraConfig camera, camera_of(recorded, folder, calibration));
    installation.cameras.push_back(std::move(camera));
  }
  for (const std::string& file : manifest.objects) {
    const fs::path path = folder / file;
    SL_ASSIGN(ObjectDescription object, read_object_file(path));
    const bool known = std::any_of(
        installation.objects.begin(), installation.objects.end(),
        [&](const ObjectConfig& other) { return other.description.name == object.name; });
    if (known) {
      return make_error(ErrorCode::kInvalidInput, path.string(),
                        "the recording has two objects named \"{}\"", object.name);
    }
    uint64_t content = content_of(path) * 31 + content_of(object.mesh);
    if (!object.features.empty()) content = content * 31 + content_of(object.features);
    installation.objects.push_back({std::move(object), content, {path.string()}});
  }
  if (manifest.scene) {
    installation.scene.meshes = {folder / *manifest.scene};
    installation.scene.content = content_of(installation.scene.meshes[0]);
  }
  installation.rtsp.enabled = installation.http.enabled = installation.record.enabled = false;
  return installation;
}

}  // namespace sightline
