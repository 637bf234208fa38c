// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/camera_file.hpp"

#include "sightline/calibrate/calibration_file.hpp"

namespace sightline {
namespace {

Result<CalibratedCamera> from_calibration(const std::string& path, const std::string& camera) {
  SL_ASSIGN(const auto cameras, read_calibration(path));
  if (camera.empty() && cameras.size() == 1) return cameras.front();
  const CalibratedCamera* found = find_camera(cameras, camera);
  if (found != nullptr) return *found;
  std::string names;
  for (const CalibratedCamera& each : cameras) {
    names += fmt::format("{}{}", names.empty() ? "" : ", ", each.name);
  }
  return make_error(
      ErrorCode::kInvalidInput, path, "{}; say one of them: {}#NAME ({})",
      camera.empty() ? "holds several cameras" : fmt::format("has no camera '{}'", camera), path,
      names);
}

}  // namespace

Result<CalibratedCamera> read_camera(const std::string& name, const CameraFileDefaults& defaults) {
  const size_t mark = name.rfind('#');
  const std::string path = name.substr(0, mark);
  const std::string camera = mark == std::string::npos ? "" : name.substr(mark + 1);
  if (path.ends_with(".toml")) return from_calibration(path, camera);
  if (mark == std::string::npos) return read_opencv_camera(path, defaults);
  return make_error(ErrorCode::kInvalidInput, name,
                    "names a camera in a file, which only calibration files (.toml) have");
}

}  // namespace sightline
