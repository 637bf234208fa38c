// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/calibration_file.hpp"

#include <algorithm>
#include <exception>

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

/// Shortest text that reads back to the same number, and reads as a number with fraction.
std::string number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string list(const double* values, size_t count) {
  std::string text = "[";
  for (size_t i = 0; i < count; ++i) text += (i == 0 ? "" : ", ") + number(values[i]);
  return text + "]";
}

std::string format_camera(const CalibratedCamera& camera) {
  const CameraModel::Parameters& p = camera.model.parameters();
  std::string text = fmt::format(
      "\n[[camera]]\nname = \"{}\"\nwidth = {}\nheight = {}\nmodel = \"{}\"\nfx = {}\nfy = {}\n"
      "cx = {}\ncy = {}\ndistortion = {}\nworld_from_camera = [\n",
      camera.name, p.width, p.height, name_of(p.lens), number(p.fx), number(p.fy), number(p.cx),
      number(p.cy), list(p.distortion.data(), coefficients_of(p.lens)));
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> m = camera.world_from_camera.matrix();
  for (int row = 0; row < 4; ++row) text += "  " + list(m.data() + 4 * row, 4) + ",\n";
  text += fmt::format("]\nrms_px = {}\n", number(camera.rms_px));
  if (camera.time_offset_s == 0) return text;
  return text + fmt::format("time_offset_s = {}\n", number(camera.time_offset_s));
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
  for (const CalibratedCamera& camera : cameras) text += format_camera(camera);
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
      text += fmt::format("fx = {}\nfy = {}\ncx = {}\ncy = {}\ndistortion = {}\n", number(s.fx),
                          number(s.fy), number(s.cx), number(s.cy),
                          list(s.distortion.data(), s.distortion.size()));
    }
    text += fmt::format("rotation = {}\ntranslation = {}\n", list(s.rotation.data(), 3),
                        list(s.translation.data(), 3));
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
