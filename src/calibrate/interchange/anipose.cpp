// SPDX-License-Identifier: Apache-2.0
// Files of anipose (which Pose2Sim reads, too) and of Caliscope: the same numbers in other tables.
#include <toml++/toml.h>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "calibrate/interchange/formats.hpp"
#include "sightline/base/toml_nesting.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kFarthest = 1e9;  // from the world's origin, in whatever unit

/// Floating point all through: older readers refuse lists of whole and other numbers.
std::string floats(const std::vector<double>& values) {
  std::string text = "[";
  for (const double value : values) {
    if (text.size() > 1) text += ", ";
    const std::string digits = fmt::format("{}", value);
    text += digits;
    if (digits.find_first_of(".en") == std::string::npos) text += ".0";
  }
  return text + "]";
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) {
      out += fmt::format("\\u{:04x}", byte);
    } else {
      if (c == '"' || c == '\\') out += '\\';
      out += c;
    }
  }
  return out + '"';
}

/// What both write of a camera, behind its name.
Result<std::string> lens_and_place(const CalibratedCamera& camera, const char* format) {
  const CameraModel::Parameters& p = camera.model.parameters();
  const bool fisheye = p.lens == LensModel::kFisheye;
  const bool rational = p.lens == LensModel::kRational;
  const size_t count = fisheye ? 4 : rational ? 8 : 5;
  SL_ASSIGN(const auto distortion, coefficients(camera, count, count, format));
  const Rigid3 camera_from_world = camera.world_from_camera.inverse();
  const Eigen::Vector3d r = rotation_vector(camera_from_world);
  const Eigen::Vector3d& t = camera_from_world.translation;
  return fmt::format(
      "size = [{}, {}]\nmatrix = [{}, {}, [0.0, 0.0, 1.0]]\ndistortions = {}\nrotation = {}\n"
      "translation = {}\n{}",
      p.width, p.height, floats({p.fx, 0, p.cx}), floats({0, p.fy, p.cy}), floats(distortion),
      floats({r.x(), r.y(), r.z()}), floats({t.x(), t.y(), t.z()}),
      fisheye ? "fisheye = true\n" : "");
}

/// Reads one camera's table; errors name file and line.
class CameraTable {
 public:
  CameraTable(const toml::table& table, const std::string& file) : table_(table), file_(file) {}

  Result<CalibratedCamera> camera(const std::string& otherwise) const {
    CameraModel::Parameters p;
    SL_ASSIGN(const auto size, list("size", 2));
    SL_ASSIGN(const auto matrix, list("matrix", 9));
    SL_ASSIGN(const auto distortions, list("distortions", 0));
    const bool fisheye = table_["fisheye"].value_or(false);
    SL_RETURN_IF_ERROR(set_lens(fisheye, distortions, p));
    if (matrix[1] != 0 || matrix[3] != 0 || matrix[6] != 0 || matrix[7] != 0 || matrix[8] != 1) {
      return fault("matrix", "is no [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]");
    }
    p.width = static_cast<int>(std::clamp(size[0], 0.0, 1e6));
    p.height = static_cast<int>(std::clamp(size[1], 0.0, 1e6));
    p.fx = matrix[0];
    p.cx = matrix[2];
    p.fy = matrix[4];
    p.cy = matrix[5];
    SL_ASSIGN(CameraModel lens, CameraModel::create(p, place(table_)));
    if (!table_.contains("rotation") && !table_.contains("translation")) {
      return fault("rotation",
                   "is missing, as is 'translation': this camera has been given no place; take its "
                   "table out, or write ignore = true into it");
    }
    SL_ASSIGN(Rigid3 camera_from_world, rotation());
    SL_ASSIGN(const auto t, list("translation", 3));
    camera_from_world.translation << t[0], t[1], t[2];
    CalibratedCamera out{table_["name"].value_or(otherwise), lens, camera_from_world.inverse()};
    if (!(out.world_from_camera.translation.norm() < kFarthest)) {
      return fault("translation", "is no place of a camera");
    }
    const double error = table_["error"].value_or(0.0);
    if (std::isfinite(error) && error > 0 && error < 100) out.rms_px = error;
    return out;
  }

 private:
  /// A rotation vector, or (Caliscope, some years ago) a matrix, row by row.
  Result<Rigid3> rotation() const {
    SL_ASSIGN(const auto r, list("rotation", 0));
    if (r.size() == 3) {
      Vector6 turn = Vector6::Zero();
      turn.head<3>() << r[0], r[1], r[2];
      return Rigid3::exp(turn);
    }
    constexpr double kCoarse = 1e-3;  // of numbers that were written with few digits
    if (r.size() == 9) {
      const Eigen::Matrix3d m =
          Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
      const bool turns = (m * m.transpose() - Eigen::Matrix3d::Identity()).norm() < kCoarse;
      if (!turns || m.determinant() < 0) return fault("rotation", "is no rotation matrix");
      return Rigid3(Eigen::Quaterniond(m).normalized(), Eigen::Vector3d::Zero());
    }
    return fault("rotation", fmt::format("has {} numbers, not 3 (or 9)", r.size()));
  }

  static Status set_lens(bool fisheye, const std::vector<double>& d, CameraModel::Parameters& p) {
    p.lens = fisheye        ? LensModel::kFisheye
             : d.size() > 5 ? LensModel::kRational
                            : LensModel::kBrownConrady;
    // anipose writes four or five numbers of a fisheye, of which the last may be a zero.
    const size_t most = fisheye ? 4 : 8;
    for (size_t i = 0; i < d.size(); ++i) {
      if (i < most) {
        p.distortion[i] = d[i];
      } else if (d[i] != 0) {
        return make_error(ErrorCode::kInvalidInput, "distortions",
                          "{} coefficients are more than our lens models have ({})", d.size(),
                          most);
      }
    }
    return {};
  }

  std::string place(const toml::node& node) const {
    return fmt::format("{}:{}:{}", file_, node.source().begin.line, node.source().begin.column);
  }
  Error fault(const char* key, const std::string& what) const {
    const toml::node* node = table_.get(key);
    return make_error(ErrorCode::kInvalidInput,
                      place(node != nullptr ? *node : static_cast<const toml::node&>(table_)),
                      "'{}' {}", key, what);
  }

  /// Numbers of a list, rows one behind the other; `count` 0: any.
  Result<std::vector<double>> list(const char* key, size_t count) const {
    const toml::array* array = table_[key].as_array();
    if (array == nullptr) return fault(key, "is missing, or no list of numbers");
    std::vector<double> out;
    bool numeric = true;
    const auto add = [&](const toml::node& node) {
      const auto value = node.value<double>();
      numeric = numeric && value && std::isfinite(*value);
      out.push_back(value.value_or(0));
    };
    for (const toml::node& node : *array) {
      if (const toml::array* row = node.as_array()) {
        for (const toml::node& entry : *row) add(entry);
      } else {
        add(node);
      }
    }
    if (!numeric) return fault(key, "has an entry that is no finite number");
    if (count != 0 && out.size() != count) {
      return fault(key, fmt::format("has {} numbers, not {}", out.size(), count));
    }
    return out;
  }

  const toml::table& table_;
  const std::string& file_;
};

/// Tables of cameras: [cam_N] of anipose, tables by the camera's name of Pose2Sim, [cameras.N] of
/// Caliscope. What has no matrix ([metadata]) is none.
Result<Cameras> cameras_of(const toml::table& root, const std::string& file) {
  Cameras cameras;
  const bool caliscope = root.contains("cameras");
  const toml::table* tables = caliscope ? root["cameras"].as_table() : &root;
  if (tables == nullptr) return cameras;
  std::vector<std::pair<std::string, const toml::table*>> found;
  for (const auto& [key, node] : *tables) {
    const std::string name(key.str());
    const bool lens = node.is_table() && node.as_table()->contains("matrix");
    if (node.is_table() && (lens || caliscope || name.starts_with("cam"))) {
      found.emplace_back(name, node.as_table());
    }
  }
  // cam_2 before cam_10.
  std::ranges::sort(found, {},
                    [](const auto& entry) { return std::pair(entry.first.size(), entry.first); });
  for (const auto& [name, table] : found) {
    if ((*table)["ignore"].value_or(false)) continue;
    SL_ASSIGN(CalibratedCamera camera,
              CameraTable(*table, file).camera(caliscope ? "cam_" + name : name));
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace

Result<Files> export_anipose(const Cameras& cameras) {
  std::string text;
  for (size_t i = 0; i < cameras.size(); ++i) {
    SL_ASSIGN(const std::string rest, lens_and_place(cameras[i], "anipose"));
    text += fmt::format("[cam_{}]\nname = {}\n{}\n", i, quoted(cameras[i].name), rest);
  }
  return Files{{"camera_array_aniposelib.toml", text + "[metadata]\nadjusted = true\n"}};
}

Result<Files> export_caliscope(const Cameras& cameras) {
  std::string text;
  for (size_t i = 0; i < cameras.size(); ++i) {
    SL_ASSIGN(const std::string rest, lens_and_place(cameras[i], "Caliscope"));
    text += fmt::format("[cameras.{}]\ncam_id = {}\nname = {}\n{}error = {}\n\n", i, i,
                        quoted(cameras[i].name), rest, cameras[i].rms_px);
  }
  return Files{{"camera_array.toml", text}};
}

Result<Cameras> import_anipose(const Files& files) {
  Cameras cameras;
  for (const NamedText& file : files) {
    SL_RETURN_IF_ERROR(check_toml_nesting(file.text, file.name));
    try {
      const toml::table root = toml::parse(file.text, file.name);
      SL_ASSIGN(Cameras found, cameras_of(root, file.name));
      std::ranges::move(found, std::back_inserter(cameras));
    } catch (const toml::parse_error& error) {
      return make_error(ErrorCode::kInvalidInput,
                        fmt::format("{}:{}:{}", file.name, error.source().begin.line,
                                    error.source().begin.column),
                        "{}", error.description());
    }
  }
  return cameras;
}

}  // namespace sightline::calibrate
