// SPDX-License-Identifier: Apache-2.0
#include "calibrate/calibration_reader.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "calibrate/axes_reader.hpp"

namespace sightline::calibrate {
namespace {

constexpr std::array kKeys = {"name",       "width",
                              "height",     "model",
                              "fx",         "fy",
                              "cx",         "cy",
                              "distortion", "world_from_camera",
                              "rvec",       "tvec",
                              "rms_px",     "date",
                              "sigmas",     "time_offset_s",
                              "readout_s",  "axes"};
/// Keys of [camera.sigmas] and how many numbers each takes (0: as many as the distortion).
constexpr std::array<std::pair<const char*, size_t>, 7> kSigmas = {{{"fx", 1},
                                                                    {"fy", 1},
                                                                    {"cx", 1},
                                                                    {"cy", 1},
                                                                    {"distortion", 0},
                                                                    {"rotation", 3},
                                                                    {"translation", 3}}};

constexpr double kLargestRms = 10'000;    // [px]
constexpr double kLargestTimeOffset = 2;  // [s]; the estimator keeps less of the past than that

struct LensName {
  const char* name;
  LensModel lens;
  size_t coefficients;
};
constexpr std::array<LensName, 4> kLenses = {{{"brown_conrady", LensModel::kBrownConrady, 5},
                                              {"rational", LensModel::kRational, 8},
                                              {"fisheye", LensModel::kFisheye, 4},
                                              {"equidistant", LensModel::kFisheye, 4}}};

class CameraReader {
 public:
  CameraReader(const toml::table& table, const std::string& file) : table_(table), file_(file) {}

  Result<CalibratedCamera> read() {
    SL_RETURN_IF_ERROR(refuse_unknown_keys());
    SL_ASSIGN(const std::string name, read_name());
    CameraModel::Parameters p;
    SL_ASSIGN(p.width, pixels("width"));
    SL_ASSIGN(p.height, pixels("height"));
    SL_ASSIGN(const LensName lens, read_lens());
    p.lens = lens.lens;
    SL_ASSIGN(p.fx, required_number("fx"));
    SL_ASSIGN(p.fy, required_number("fy"));
    SL_ASSIGN(p.cx, required_number("cx"));
    SL_ASSIGN(p.cy, required_number("cy"));
    SL_ASSIGN(const std::vector<double> distortion, read_distortion(lens));
    std::copy(distortion.begin(), distortion.end(), p.distortion.begin());
    SL_ASSIGN(std::optional<CameraAxes> axes, read_axes(lens));
    Rigid3 world_from_camera;
    if (axes) {
      SL_RETURN_IF_ERROR(refuse_pose_beside_axes());
      world_from_camera = axes->world_from_camera(0, 0);
    } else {
      SL_ASSIGN(world_from_camera, read_pose());
    }
    SL_ASSIGN(const double rms_px, read_rms());
    SL_ASSIGN(const double time_offset_s, read_seconds("time_offset_s", kLargestTimeOffset));
    SL_ASSIGN(const double readout_s, read_seconds("readout_s", kLargestReadout));
    SL_RETURN_IF_ERROR(check_date());
    SL_RETURN_IF_ERROR(check_sigmas(distortion.size()));
    SL_ASSIGN(const CameraModel model,
              CameraModel::create(p, place(file_, table_.get("fx")->source())));
    return CalibratedCamera{name,          model,           world_from_camera, rms_px,
                            time_offset_s, std::move(axes), readout_s};
  }

 private:
  template <typename... Args>
  Error fault(const toml::source_region& at, fmt::format_string<Args...> format,
              Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, place(file_, at), format,
                      std::forward<Args>(args)...);
  }

  Status refuse_unknown_keys() const {
    for (const auto& [key, node] : table_) {
      if (std::find(kKeys.begin(), kKeys.end(), key.str()) == kKeys.end()) {
        return fault(key.source(), "unknown key '{}' of a camera", key.str());
      }
    }
    return {};
  }

  Result<const toml::node*> required(const char* key) const {
    const toml::node* node = table_.get(key);
    if (node == nullptr) return fault(table_.source(), "camera without '{}'", key);
    return node;
  }

  Result<std::string> text(const char* key) const {
    SL_ASSIGN(const toml::node* node, required(key));
    const auto* value = node->as_string();
    if (value == nullptr) {
      return fault(node->source(), "'{}' must be text, it is {}", key, kind_of(*node));
    }
    return value->get();
  }

  /// The name is also a file name and part of addresses.
  Result<std::string> read_name() const {
    SL_ASSIGN(std::string name, text("name"));
    const bool plain = std::all_of(name.begin(), name.end(), [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
             c == '_' || c == '-' || c == '.';
    });
    if (name.empty() || name.size() > 64 || !plain || name.front() == '.' || name.front() == '-') {
      return fault(table_.get("name")->source(),
                   "a camera's name is 1 to 64 letters, digits, '_', '-' and '.', beginning with a "
                   "letter, digit or '_'");
    }
    return name;
  }

  Result<int> pixels(const char* key) const {
    SL_ASSIGN(const toml::node* node, required(key));
    const auto* value = node->as_integer();
    if (value == nullptr) {
      return fault(node->source(), "'{}' must be a whole number of pixels, it is {}", key,
                   kind_of(*node));
    }
    if (value->get() < 1 || value->get() > 32768) {
      return fault(node->source(), "'{}' is {}, it must be 1 to 32768", key, value->get());
    }
    return static_cast<int>(value->get());
  }

  Result<LensName> read_lens() const {
    SL_ASSIGN(const std::string model, text("model"));
    for (const LensName& lens : kLenses) {
      if (model == lens.name) return lens;
    }
    return fault(table_.get("model")->source(),
                 "lens model must be brown_conrady, rational or fisheye");
  }

  Result<double> number(const toml::node& node, const char* key) const {
    return number_of(node, key, file_);
  }

  Result<double> required_number(const char* key) const {
    SL_ASSIGN(const toml::node* node, required(key));
    return number(*node, key);
  }

  Result<std::vector<double>> numbers(const toml::node& node, const char* key) const {
    return numbers_of(node, key, file_);
  }

  Result<std::vector<double>> read_distortion(const LensName& lens) const {
    SL_ASSIGN(const toml::node* node, required("distortion"));
    SL_ASSIGN(std::vector<double> out, numbers(*node, "distortion"));
    if (out.size() > lens.coefficients) {
      return fault(node->source(), "'distortion' has {} numbers, model {} takes up to {}",
                   out.size(), lens.name, lens.coefficients);
    }
    return out;
  }

  Result<Rigid3> read_pose() const {
    const toml::node* matrix = table_.get("world_from_camera");
    const toml::node* rvec = table_.get("rvec");
    const toml::node* tvec = table_.get("tvec");
    if (matrix != nullptr && (rvec != nullptr || tvec != nullptr)) {
      return fault((rvec != nullptr ? rvec : tvec)->source(),
                   "give world_from_camera, or rvec and tvec, not both");
    }
    if (matrix != nullptr) return pose_of(*matrix, "world_from_camera", file_);
    if (rvec == nullptr && tvec == nullptr) {
      return fault(table_.source(), "camera without 'world_from_camera' (or rvec and tvec)");
    }
    if (rvec == nullptr) return fault(tvec->source(), "tvec without rvec");
    if (tvec == nullptr) return fault(rvec->source(), "rvec without tvec");
    SL_ASSIGN(const Eigen::Vector3d rotation, vector3(*rvec, "rvec"));
    SL_ASSIGN(const Eigen::Vector3d translation, vector3(*tvec, "tvec"));
    Vector6 tangent = Vector6::Zero();
    tangent.head<3>() = rotation;
    return Rigid3(Rigid3::exp(tangent).rotation, translation).inverse();
  }

  Result<Eigen::Vector3d> vector3(const toml::node& node, const char* key) const {
    SL_ASSIGN(const std::vector<double> v, numbers(node, key));
    if (v.size() != 3)
      return fault(node.source(), "'{}' takes 3 numbers, it has {}", key, v.size());
    const Eigen::Vector3d out(v[0], v[1], v[2]);
    if (!(out.norm() < 1e6)) return fault(node.source(), "'{}' is absurdly large", key);
    return out;
  }

  Result<std::optional<CameraAxes>> read_axes(const LensName& lens) const {
    const toml::node* node = table_.get("axes");
    if (node == nullptr) return std::optional<CameraAxes>();
    const toml::table* axes = node->as_table();
    if (axes == nullptr) {
      return fault(node->source(), "'axes' must be a table, it is {}", kind_of(*node));
    }
    SL_ASSIGN(CameraAxes out, read_camera_axes(*axes, lens.coefficients, file_));
    return std::optional(std::move(out));
  }

  Status refuse_pose_beside_axes() const {
    for (const char* key : {"world_from_camera", "rvec", "tvec"}) {
      const toml::node* node = table_.get(key);
      if (node == nullptr) continue;
      return fault(node->source(), "'{}' of a camera that turns: its axes say where it stands",
                   key);
    }
    return {};
  }

  Result<double> read_rms() const {
    const toml::node* node = table_.get("rms_px");
    if (node == nullptr) return 0.5;
    SL_ASSIGN(const double value, number(*node, "rms_px"));
    if (value < 0 || value > kLargestRms) {
      return fault(node->source(), "'rms_px' is {}, it must be 0 to {}", value, kLargestRms);
    }
    return value;
  }

  // Either way; none: 0.
  Result<double> read_seconds(const char* key, double largest) const {
    const toml::node* node = table_.get(key);
    if (node == nullptr) return 0.0;
    SL_ASSIGN(const double value, number(*node, key));
    if (!(std::abs(value) <= largest)) {
      return fault(node->source(), "'{}' is {}, it must be -{} to {}", key, value, largest,
                   largest);
    }
    return value;
  }

  Status check_date() const {
    const toml::node* node = table_.get("date");
    if (node == nullptr || node->is_string() || node->is_date() || node->is_date_time()) return {};
    return fault(node->source(), "'date' must be a date or text, it is {}", kind_of(*node));
  }

  Status check_sigmas(size_t coefficients) const {
    const toml::node* node = table_.get("sigmas");
    if (node == nullptr) return {};
    const toml::table* sigmas = node->as_table();
    if (sigmas == nullptr) {
      return fault(node->source(), "'sigmas' must be a table, it is {}", kind_of(*node));
    }
    for (const auto& [key, value] : *sigmas) {
      const auto known = std::find_if(kSigmas.begin(), kSigmas.end(),
                                      [k = key.str()](const auto& s) { return k == s.first; });
      if (known == kSigmas.end()) {
        return fault(key.source(), "unknown key '{}' of sigmas", key.str());
      }
      const size_t count = known->second == 0 ? coefficients : known->second;
      SL_RETURN_IF_ERROR(check_sigma(value, known->first, count, known->second == 1));
    }
    return {};
  }

  Status check_sigma(const toml::node& node, const char* key, size_t count, bool scalar) const {
    std::vector<double> values;
    if (scalar) {
      SL_ASSIGN(const double value, number(node, key));
      values.push_back(value);
    } else {
      SL_ASSIGN(values, numbers(node, key));
    }
    if (values.size() != count) {
      return fault(node.source(), "sigma of '{}' takes {} numbers, it has {}", key, count,
                   values.size());
    }
    if (std::any_of(values.begin(), values.end(), [](double v) { return v < 0; })) {
      return fault(node.source(), "sigma of '{}' is negative", key);
    }
    return {};
  }

  const toml::table& table_;
  const std::string& file_;
};

}  // namespace

Result<CalibratedCamera> read_camera(const toml::table& table, const std::string& file) {
  return CameraReader(table, file).read();
}

}  // namespace sightline::calibrate
