// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes_reader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "calibrate/toml_numbers.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// A key that holds a number: where it goes, its unit, and what it may be.
struct NumberKey {
  const char* name;
  double CameraAxes::*member;
  double unit, least, most;  ///< in the file's unit
};
constexpr std::array<NumberKey, 9> kNumbers = {
    {{"pan_scale", &CameraAxes::pan_scale, 1, -1000, 1000},
     {"tilt_scale", &CameraAxes::tilt_scale, 1, -1000, 1000},
     {"latency_s", &CameraAxes::latency_s, 1, 0, 0.5},
     {"latency_sigma_s", &CameraAxes::latency_sigma_s, 1, 0, 0.2},
     {"sigma_deg", &CameraAxes::sigma, kDegree, 1e-5, 10},
     {"backlash_deg", &CameraAxes::backlash, kDegree, 0, 10},
     {"max_rate_deg_s", &CameraAxes::max_rate, kDegree, 1, 10'000},
     {"acceleration_deg_s2", &CameraAxes::acceleration, kDegree, 1, 1e6},
     {"stale_s", &CameraAxes::stale_s, 1, 0.02, 2}}};

struct PoseKey {
  const char* name;
  Rigid3 CameraAxes::*member;
};
constexpr std::array<PoseKey, 3> kPoses = {{{"world_from_base", &CameraAxes::world_from_base},
                                            {"pan_from_tilt", &CameraAxes::pan_from_tilt},
                                            {"tilt_from_camera", &CameraAxes::tilt_from_camera}}};

struct LensKey {
  const char* name;
  double ZoomLens::*member;
};
constexpr std::array<LensKey, 6> kLens = {{{"setting", &ZoomLens::setting},
                                           {"fx", &ZoomLens::fx},
                                           {"fy", &ZoomLens::fy},
                                           {"cx", &ZoomLens::cx},
                                           {"cy", &ZoomLens::cy},
                                           {"sigma", &ZoomLens::sigma}}};
constexpr size_t kMostLenses = 1000;

class AxesReader {
 public:
  AxesReader(const toml::table& table, size_t coefficients, const std::string& file)
      : table_(table), coefficients_(coefficients), file_(file) {}

  Result<CameraAxes> read() {
    for (const auto& [key, node] : table_) {
      SL_RETURN_IF_ERROR(read_key(std::string(key.str()), key.source(), node));
    }
    if (table_.get("world_from_base") == nullptr || table_.get("tilt_from_camera") == nullptr) {
      return fault(table_.source(), "axes without 'world_from_base' or 'tilt_from_camera'");
    }
    for (const char* scale : {"pan_scale", "tilt_scale"}) {
      const toml::node* node = table_.get(scale);
      const double value = scale[0] == 'p' ? axes_.pan_scale : axes_.tilt_scale;
      if (node != nullptr && std::abs(value) < 1e-6) {
        return fault(node->source(), "'{}' must not be zero", scale);
      }
    }
    return axes_;
  }

 private:
  template <typename... Args>
  Error fault(const toml::source_region& at, fmt::format_string<Args...> format,
              Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, place(file_, at), format,
                      std::forward<Args>(args)...);
  }

  Status read_key(const std::string& key, const toml::source_region& at, const toml::node& node) {
    for (const PoseKey& pose : kPoses) {
      if (key != pose.name) continue;
      SL_ASSIGN(axes_.*pose.member, pose_of(node, pose.name, file_));
      return {};
    }
    for (const NumberKey& number : kNumbers) {
      if (key == number.name) return read_number(number, node);
    }
    if (key == "zoom") return read_zoom(node);
    return fault(at, "unknown key '{}' of axes", key);
  }

  Status read_number(const NumberKey& key, const toml::node& node) {
    SL_ASSIGN(const double value, number_of(node, key.name, file_));
    if (value < key.least || value > key.most) {
      return fault(node.source(), "'{}' is {}, it must be {} to {}", key.name, value, key.least,
                   key.most);
    }
    axes_.*key.member = value * key.unit;
    return {};
  }

  Status read_zoom(const toml::node& node) {
    const toml::array* tables = node.as_array();
    if (tables == nullptr || !tables->is_homogeneous(toml::node_type::table)) {
      return fault(node.source(), "'zoom' must be a list of tables, written [[camera.axes.zoom]]");
    }
    if (tables->size() < 2 || tables->size() > kMostLenses) {
      return fault(node.source(), "'zoom' holds {} settings, it takes 2 to {}", tables->size(),
                   kMostLenses);
    }
    for (const toml::node& element : *tables) {
      SL_ASSIGN(const ZoomLens lens, read_lens(*element.as_table()));
      if (!axes_.zoom.empty() && lens.setting <= axes_.zoom.back().setting) {
        return fault(element.source(), "settings of 'zoom' must grow: {} after {}", lens.setting,
                     axes_.zoom.back().setting);
      }
      axes_.zoom.push_back(lens);
    }
    return {};
  }

  Result<ZoomLens> read_lens(const toml::table& table) const {
    ZoomLens lens;
    for (const auto& [key, node] : table) {
      const auto known = std::find_if(kLens.begin(), kLens.end(),
                                      [k = key.str()](const LensKey& l) { return k == l.name; });
      if (known != kLens.end()) {
        SL_ASSIGN(lens.*known->member, number_of(node, known->name, file_));
      } else if (key.str() == "distortion") {
        SL_ASSIGN(const std::vector<double> values, numbers_of(node, "distortion", file_));
        if (values.size() > coefficients_) {
          return fault(node.source(), "'distortion' has {} numbers, the camera's model takes {}",
                       values.size(), coefficients_);
        }
        std::copy(values.begin(), values.end(), lens.distortion.begin());
      } else {
        return fault(key.source(), "unknown key '{}' of a zoom setting", key.str());
      }
    }
    if (!(lens.fx > 0 && lens.fy > 0 && lens.fx < 1e7 && lens.fy < 1e7 && lens.sigma >= 0)) {
      return fault(table.source(),
                   "a zoom setting takes 'setting', 'fx' and 'fy' above 0, 'cx', "
                   "'cy', and 'sigma' of 0 or more");
    }
    return lens;
  }

  const toml::table& table_;
  const size_t coefficients_;
  const std::string& file_;
  CameraAxes axes_;
};

}  // namespace

Result<CameraAxes> read_camera_axes(const toml::table& table, size_t coefficients,
                                    const std::string& file) {
  return AxesReader(table, coefficients, file).read();
}

std::string number_text(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string list_text(const double* values, size_t count) {
  std::string text = "[";
  for (size_t i = 0; i < count; ++i) text += (i == 0 ? "" : ", ") + number_text(values[i]);
  return text + "]";
}

std::string pose_text(const char* key, const Rigid3& pose) {
  std::string text = fmt::format("{} = [\n", key);
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> m = pose.matrix();
  for (int row = 0; row < 4; ++row) text += "  " + list_text(m.data() + 4 * row, 4) + ",\n";
  return text + "]\n";
}

std::string format_camera_axes(const CameraAxes& axes, size_t coefficients) {
  std::string text = "[camera.axes]\n";
  for (const PoseKey& pose : kPoses) text += pose_text(pose.name, axes.*pose.member);
  for (const NumberKey& key : kNumbers) {
    text += fmt::format("{} = {}\n", key.name, number_text(axes.*key.member / key.unit));
  }
  for (const ZoomLens& lens : axes.zoom) {
    text += "[[camera.axes.zoom]]\n";
    for (const LensKey& key : kLens) {
      text += fmt::format("{} = {}\n", key.name, number_text(lens.*key.member));
    }
    text += fmt::format("distortion = {}\n", list_text(lens.distortion.data(), coefficients));
  }
  return text;
}

}  // namespace sightline::calibrate
