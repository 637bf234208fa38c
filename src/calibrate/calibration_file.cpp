// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/calibration_file.hpp"

#include <algorithm>
#include <exception>

#include "calibrate/axes_reader.hpp"
#include "calibrate/calibration_reader.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/toml_nesting.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr size_t kMaxBytes = size_t{16} << 20;
constexpr const char* kHead = "# calibration of the cameras: pixels and meters\n";

const char* name_of(LensModel lens) {
  switch (lens) {
    case LensModel::kBrownConrady:
      return "brown_conrady";
    case LensModel::kRational:
      return "rational";
    case LensModel::kFisheye:
      return "fisheye";
  }
  return "";
}

size_t coefficients_of(LensModel lens) {
  return lens == LensModel::kBrownConrady ? 5 : lens == LensModel::kRational ? 8 : 4;
}

// Without its axes, which are a table of their own and come last.
std::string format_camera(const CalibratedCamera& camera) {
  const CameraModel::Parameters& p = camera.model.parameters();
  std::string text = fmt::format(
      "\n[[camera]]\nname = \"{}\"\nwidth = {}\nheight = {}\nmodel = \"{}\"\nfx = {}\nfy = {}\n"
      "cx = {}\ncy = {}\ndistortion = {}\n",
      camera.name, p.width, p.height, name_of(p.lens), number_text(p.fx), number_text(p.fy),
      number_text(p.cx), number_text(p.cy),
      list_text(p.distortion.data(), coefficients_of(p.lens)));
  if (!camera.axes) text += pose_text("world_from_camera", camera.world_from_camera);
  text += fmt::format("rms_px = {}\n", number_text(camera.rms_px));
  const auto add_seconds = [&text](const char* key, double value) {
    if (value != 0) text += fmt::format("{} = {}\n", key, number_text(value));
  };
  add_seconds("time_offset_s", camera.time_offset_s);
  add_seconds("readout_s", camera.readout_s);
  return text;
}

std::string format_axes(const CalibratedCamera& camera) {
  if (!camera.axes) return {};
  return format_camera_axes(*camera.axes, coefficients_of(camera.model.parameters().lens));
}

Result<std::vector<CalibratedCamera>> read_cameras(const toml::table& root,
                                                   const std::string& where) {
  for (const auto& [key, node] : root) {
    if (key.str() != "camera") {
      return make_error(ErrorCode::kInvalidInput, place(where, key.source()),
                        "unknown key '{}'; a calibration holds [[camera]] tables", key.str());
    }
  }
  const toml::node* node = root.get("camera");
  if (node == nullptr) {
    return make_error(ErrorCode::kInvalidInput, where, "no [[camera]] in the calibration");
  }
  const toml::array* tables = node->as_array();
  if (tables == nullptr || !tables->is_homogeneous(toml::node_type::table)) {
    return make_error(ErrorCode::kInvalidInput, place(where, node->source()),
                      "'camera' must be a list of tables, written [[camera]]");
  }
  std::vector<CalibratedCamera> cameras;
  for (const toml::node& element : *tables) {
    const toml::table& table = *element.as_table();
    SL_ASSIGN(CalibratedCamera camera, read_camera(table, where));
    if (find_camera(cameras, camera.name) != nullptr) {
      return make_error(ErrorCode::kInvalidInput, place(where, table.get("name")->source()),
                        "two cameras are called '{}'", camera.name);
    }
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace

Result<std::vector<CalibratedCamera>> parse_calibration(std::string_view text,
                                                        const std::string& where) try {
  SL_RETURN_IF_ERROR(check_toml_nesting(text, where));
  const toml::table root = toml::parse(text, where);
  return read_cameras(root, where);
} catch (const toml::parse_error& e) {
  return make_error(ErrorCode::kInvalidInput, place(where, e.source()), "{}", e.description());
} catch (const std::exception& e) {
  return make_error(ErrorCode::kInvalidInput, where, "cannot parse: {}", e.what());
}

Result<std::vector<CalibratedCamera>> read_calibration(const std::filesystem::path& path) {
  SL_ASSIGN(const std::string text, read_file(path, kMaxBytes));
  return parse_calibration(text, path.string());
}

std::string format_calibration(const std::vector<CalibratedCamera>& cameras) {
  std::string text = kHead;
  for (const CalibratedCamera& camera : cameras) {
    text += format_camera(camera) + format_axes(camera);
  }
  return text;
}

std::string format_calibration(const std::vector<CalibratedCamera>& cameras,
                               const std::vector<CalibrationSigmas>& sigmas,
                               const std::string& date, const std::string& remark) {
  SL_CHECK(sigmas.size() == cameras.size(), "sigmas of each camera");
  std::string text = kHead;
  if (!remark.empty()) text += "# " + remark + "\n";
  for (size_t c = 0; c < cameras.size(); ++c) {
    const CalibrationSigmas& s = sigmas[c];
    text += format_camera(cameras[c]);
    if (!date.empty()) text += fmt::format("date = {}\n", date);
    text += "[camera.sigmas]\n";
    if (s.fx > 0) {
      text += fmt::format("fx = {}\nfy = {}\ncx = {}\ncy = {}\ndistortion = {}\n",
                          number_text(s.fx), number_text(s.fy), number_text(s.cx),
                          number_text(s.cy), list_text(s.distortion.data(), s.distortion.size()));
    }
    text += fmt::format("rotation = {}\ntranslation = {}\n", list_text(s.rotation.data(), 3),
                        list_text(s.translation.data(), 3));
    text += format_axes(cameras[c]);
  }
  return text;
}

Status write_calibration(const std::filesystem::path& path,
                         const std::vector<CalibratedCamera>& cameras) {
  const std::string text = format_calibration(cameras);
  // What could not be read back must not replace what could.
  if (auto check = parse_calibration(text, path.string()); !check) return std::move(check).error();
  return write_file_atomically(path, text);
}

const CalibratedCamera* find_camera(const std::vector<CalibratedCamera>& cameras,
                                    std::string_view name) {
  const auto found = std::find_if(cameras.begin(), cameras.end(),
                                  [&](const CalibratedCamera& c) { return c.name == name; });
  return found == cameras.end() ? nullptr : &*found;
}

}  // namespace sightline
