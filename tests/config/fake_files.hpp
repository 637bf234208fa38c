// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/config/installation.hpp"

namespace sightline::test {

inline CalibratedCamera calibrated(const std::string& name, int width = 640, int height = 480) {
  CameraModel::Parameters lens;
  lens.width = width;
  lens.height = height;
  lens.fx = lens.fy = 600;
  lens.cx = width / 2.0;
  lens.cy = height / 2.0;
  return {name, *CameraModel::create(lens, name), {}, 0.3};
}

/// A world of files with cameras left, right, side (640x480) and odd (641x480), all recorded, and
/// where every file exists unless its name contains "missing".
inline InstallationFiles fake_files() {
  const auto is_there = [](const std::filesystem::path& path) {
    return path.string().find("missing") == std::string::npos;
  };
  InstallationFiles files;
  files.calibration = [is_there](const auto& path) -> Result<std::vector<CalibratedCamera>> {
    if (!is_there(path)) return make_error(ErrorCode::kNotFound, path.string(), "no such file");
    return std::vector{calibrated("left"), calibrated("right"),    calibrated("side"),
                       calibrated("back"), calibrated("odd", 641), calibrated("unrecorded")};
  };
  files.object = [is_there](const auto& path) -> Result<ObjectDescription> {
    if (!is_there(path)) return make_error(ErrorCode::kNotFound, path.string(), "no such file");
    ObjectDescription object;
    object.name = path.stem().string();
    object.file = path;
    object.mesh = path.parent_path() / "mesh.obj";
    return object;
  };
  files.tls = [is_there](const TlsFiles& tls) -> Result<uint64_t> {
    if (is_there(tls.certificate)) return uint64_t{9};
    return make_error(ErrorCode::kNotFound, tls.certificate.string(), "no such file");
  };
  files.tokens = [is_there](const auto& path) -> Result<uint64_t> {
    if (!is_there(path)) return make_error(ErrorCode::kNotFound, path.string(), "no such file");
    return uint64_t{7};
  };
  files.recording = [is_there](const auto& path) -> Result<std::vector<RecordedCameraEntry>> {
    if (!is_there(path)) return make_error(ErrorCode::kNotFound, path.string(), "no such file");
    return std::vector<RecordedCameraEntry>{{"left", 640, 480},
                                            {"right", 640, 480},
                                            {"side", 640, 480},
                                            {"odd", 641, 480},
                                            {"large", 1280, 720}};
  };
  files.depth_image_size = [](const auto& path) -> Result<ImageSize> {
    if (path.string().find("garbage") == std::string::npos) return ImageSize{640, 480};
    return make_error(ErrorCode::kInvalidInput, path.string(), "is no depth image");
  };
  files.is_file = files.is_directory = is_there;
  files.content = [](const std::filesystem::path& path) { return path.string().size(); };
  return files;
}

}  // namespace sightline::test
