// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/opencv_camera.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <exception>
#include <initializer_list>
#include <opencv2/core.hpp>
#include <vector>

#include "sightline/base/files.hpp"

namespace sightline {
namespace {

constexpr size_t kMaxBytes = 4u << 20;  // a camera file is a page of numbers

constexpr int kMaxNumbers = 64;
constexpr double kLargestRms = 10'000;  // [px]

using Names = std::initializer_list<const char*>;

/// Numbers of one entry, row-major. A matrix and a plain list look alike.
struct Numbers {
  std::string name;
  int rows = 0, columns = 0;  // of a list: its length and 1
  std::vector<double> values;
};

class CameraFile {
 public:
  CameraFile(const cv::FileNode& root, std::string where) : root_(root), where_(std::move(where)) {}

  const std::string& where() const { return where_; }

  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, where_, format, std::forward<Args>(args)...);
  }

  std::optional<Error> missing(Names names, const char* what) const {
    std::string listed;
    for (const char* name : names) listed += fmt::format("{}{}", listed.empty() ? "" : ", ", name);
    return fault("has no {}; looked for {}", what, listed);
  }

  cv::FileNode find(Names names, std::string* found = nullptr) const {
    for (const char* name : names) {
      const cv::FileNode node = root_[name];
      if (node.empty()) continue;
      if (found != nullptr) *found = name;
      return node;
    }
    return {};
  }

  /// Empty: no such entry.
  Result<std::optional<Numbers>> numbers(Names names) const {
    Numbers out;
    const cv::FileNode node = find(names, &out.name);
    if (node.empty()) return std::optional<Numbers>();
    if (node.isMap() && !node["data"].empty()) {
      // Before OpenCV believes a wrong size and allocates it.
      const int rows = node["rows"].isInt() ? static_cast<int>(node["rows"]) : 0;
      const int columns = node["cols"].isInt() ? static_cast<int>(node["cols"]) : 0;
      if (rows < 1 || columns < 1 || rows > kMaxNumbers || columns > kMaxNumbers ||
          node["data"].size() != static_cast<size_t>(rows * columns)) {
        return fault("{} does not hold the rows and cols that it says", out.name);
      }
      cv::Mat matrix;
      node >> matrix;
      if (matrix.empty() || matrix.channels() != 1) return fault("{} is not a matrix", out.name);
      cv::Mat doubles;
      matrix.convertTo(doubles, CV_64F);
      out.rows = doubles.rows;
      out.columns = doubles.cols;
      out.values.assign(doubles.begin<double>(), doubles.end<double>());
    } else if (node.isSeq()) {
      SL_RETURN_IF_ERROR(flatten(node, out));
    } else {
      return fault("{} is neither a matrix nor a list of numbers", out.name);
    }
    for (const double value : out.values) {
      if (!std::isfinite(value)) return fault("{} holds a number that is not finite", out.name);
    }
    return std::optional(std::move(out));
  }

 private:
  // [1, 2, 3] or [[1, 2], [3, 4]].
  Status flatten(const cv::FileNode& node, Numbers& out) const {
    for (const cv::FileNode& entry : node) {
      if (entry.isSeq()) {
        const int columns = static_cast<int>(entry.size());
        if (out.columns != 0 && out.columns != columns) {
          return fault("{} has rows of different lengths", out.name);
        }
        out.columns = columns;
        for (const cv::FileNode& number : entry) SL_RETURN_IF_ERROR(append(number, out));
      } else {
        SL_RETURN_IF_ERROR(append(entry, out));
      }
      ++out.rows;
    }
    if (out.columns == 0) out.columns = 1;
    if (static_cast<size_t>(out.rows) * static_cast<size_t>(out.columns) == out.values.size()) {
      return {};
    }
    return fault("{} mixes numbers and rows", out.name);
  }

  Status append(const cv::FileNode& node, Numbers& out) const {
    if (!node.isInt() && !node.isReal()) {
      return fault("{} holds something that is no number", out.name);
    }
    out.values.push_back(static_cast<double>(node));
    return {};
  }

  cv::FileNode root_;
  std::string where_;
};

constexpr Names kMatrixNames = {"camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M"};
constexpr Names kLensNames = {"distortion_coefficients", "Distortion_Coefficients", "distCoeffs",
                              "dist_coeffs", "D"};
constexpr Names kSizeNames = {"image_size", "imageSize"};
constexpr Names kRotationNames = {"rvec", "rotation_vector", "R", "rotation_matrix"};
constexpr Names kTranslationNames = {"tvec", "translation_vector", "T", "t"};

Status read_size(const CameraFile& file, const CameraFileDefaults& defaults,
                 CameraModel::Parameters& out) {
  const cv::FileNode width = file.find({"image_width", "image_Width", "width"});
  const cv::FileNode height = file.find({"image_height", "image_Height", "height"});
  if (width.isInt() && height.isInt()) {
    out.width = static_cast<int>(width);
    out.height = static_cast<int>(height);
    return {};
  }
  SL_ASSIGN(const auto size, file.numbers(kSizeNames));
  if (size && size->values.size() == 2) {
    out.width = static_cast<int>(std::clamp(size->values[0], 0.0, 1e6));
    out.height = static_cast<int>(std::clamp(size->values[1], 0.0, 1e6));
    return {};
  }
  if (defaults.width == 0) {
    return file.fault("does not say how large its images are: image_width and image_height");
  }
  out.width = defaults.width;
  out.height = defaults.height;
  return {};
}

Status read_matrix(const CameraFile& file, CameraModel::Parameters& out) {
  SL_ASSIGN(const auto matrix, file.numbers(kMatrixNames));
  if (!matrix) return *file.missing(kMatrixNames, "camera matrix");
  const auto& k = matrix->values;
  if (k.size() != 9) return file.fault("{} has {} numbers, not 9", matrix->name, k.size());
  const bool pinhole = k[3] == 0 && k[6] == 0 && k[7] == 0 && std::abs(k[8] - 1) < 1e-9;
  if (!pinhole) {
    return file.fault("{} is not of the form fx 0 cx, 0 fy cy, 0 0 1", matrix->name);
  }
  if (std::abs(k[1]) > 1e-6 * std::abs(k[0])) {
    return file.fault("{} has a skew of {} px, which our lens models do not have", matrix->name,
                      k[1]);
  }
  out.fx = k[0];
  out.cx = k[2];
  out.fy = k[4];
  out.cy = k[5];
  return {};
}

Result<LensModel> lens_model(const CameraFile& file, size_t coefficients) {
  const cv::FileNode node = file.find({"distortion_model", "camera_model"});
  const std::string name = node.isString() ? static_cast<std::string>(node) : "";
  const cv::FileNode flag = file.find({"fisheye_model"});
  if (flag.isInt() && static_cast<int>(flag) != 0) return LensModel::kFisheye;
  if (name == "fisheye" || name == "equidistant") return LensModel::kFisheye;
  if (name.empty() || name == "plumb_bob" || name == "pinhole" || name == "radtan" ||
      name == "rational_polynomial") {
    return coefficients > 5 ? LensModel::kRational : LensModel::kBrownConrady;
  }
  return file.fault("distortion_model '{}' is not known; plumb_bob, rational_polynomial, fisheye",
                    name);
}

Status read_lens(const CameraFile& file, CameraModel::Parameters& out) {
  SL_ASSIGN(auto lens, file.numbers(kLensNames));
  std::vector<double> none;
  std::vector<double>& values = lens ? lens->values : none;
  while (!values.empty() && values.back() == 0) values.pop_back();  // OpenCV pads to 5, 8, 12, 14
  SL_ASSIGN(out.lens, lens_model(file, values.size()));
  const size_t max = out.lens == LensModel::kFisheye ? 4 : 8;
  if (values.size() > max) {
    return file.fault(
        "{} has {} coefficients; our lens models go to {} (thin prism and tilt are "
        "not among them): calibrate without",
        lens->name, values.size(), max);
  }
  std::copy(values.begin(), values.end(), out.distortion.begin());
  return {};
}

Result<Rigid3> matrix_pose(const CameraFile& file, const Numbers& numbers, double meters_per_unit) {
  if (numbers.values.size() != 16) {
    return file.fault("{} has {} numbers, not 16", numbers.name, numbers.values.size());
  }
  Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.values.data());
  matrix.topRightCorner<3, 1>() *= meters_per_unit;
  return Rigid3::from_matrix(matrix, file.where() + ": " + numbers.name);
}

Result<Rigid3> rotation_of(const CameraFile& file, const Numbers& numbers) {
  if (numbers.values.size() == 3) {
    Vector6 tangent = Vector6::Zero();
    for (int i = 0; i < 3; ++i) tangent[i] = numbers.values[static_cast<size_t>(i)];
    return Rigid3::exp(tangent);
  }
  if (numbers.values.size() != 9) {
    return file.fault("{} has {} numbers; a rotation is a vector of 3 or a matrix of 9",
                      numbers.name, numbers.values.size());
  }
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.values.data());
  return Rigid3::from_matrix(matrix, file.where() + ": " + numbers.name);
}

Result<Rigid3> read_world_from_camera(const CameraFile& file, double meters_per_unit) {
  SL_ASSIGN(const auto forward, file.numbers({"world_from_camera"}));
  if (forward) return matrix_pose(file, *forward, meters_per_unit);
  SL_ASSIGN(const auto backward, file.numbers({"camera_from_world"}));
  if (backward) {
    SL_ASSIGN(const Rigid3 pose, matrix_pose(file, *backward, meters_per_unit));
    return pose.inverse();
  }
  SL_ASSIGN(const auto rotation, file.numbers(kRotationNames));
  SL_ASSIGN(const auto translation, file.numbers(kTranslationNames));
  if (!rotation) return *file.missing(kRotationNames, "rotation of the camera");
  if (!translation) return *file.missing(kTranslationNames, "translation of the camera");
  if (translation->values.size() != 3) {
    return file.fault("{} has {} numbers, not 3", translation->name, translation->values.size());
  }
  SL_ASSIGN(Rigid3 camera_from_world, rotation_of(file, *rotation));
  camera_from_world.translation =
      Eigen::Map<const Eigen::Vector3d>(translation->values.data()) * meters_per_unit;
  return camera_from_world.inverse();
}

Result<CalibratedCamera> read_camera(const CameraFile& file, const CameraFileDefaults& defaults) {
  CameraModel::Parameters parameters;
  SL_RETURN_IF_ERROR(read_size(file, defaults, parameters));
  SL_RETURN_IF_ERROR(read_matrix(file, parameters));
  SL_RETURN_IF_ERROR(read_lens(file, parameters));
  SL_ASSIGN(const CameraModel model, CameraModel::create(parameters, file.where()));
  SL_ASSIGN(const Rigid3 world_from_camera, read_world_from_camera(file, defaults.meters_per_unit));
  CalibratedCamera camera{"", model, world_from_camera};
  const cv::FileNode name = file.find({"camera_name", "name"});
  if (name.isString()) camera.name = static_cast<std::string>(name);
  const cv::FileNode error = file.find({"avg_reprojection_error", "rms", "rms_px"});
  if (!error.isReal()) return camera;
  const auto rms = static_cast<double>(error);
  if (!(std::abs(rms) <= kLargestRms))
    return file.fault("has an error of {} px, which is absurd", rms);
  if (rms > 0) camera.rms_px = rms;
  return camera;
}

}  // namespace

Result<CalibratedCamera> parse_opencv_camera(const std::string& text, const std::string& where,
                                             const CameraFileDefaults& defaults) {
  try {
    const cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (!storage.isOpened() || storage.root().empty()) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "is not a camera file of OpenCV (YAML, XML or JSON of FileStorage)");
    }
    return read_camera(CameraFile(storage.root(), where), defaults);
  } catch (const cv::Exception& error) {
    return make_error(ErrorCode::kInvalidInput, where, "OpenCV cannot read it: {}", error.err);
  } catch (const std::exception& error) {  // its parser has some of these in store, too
    return make_error(ErrorCode::kInvalidInput, where, "OpenCV cannot read it: {}", error.what());
  }
}

Result<CalibratedCamera> read_opencv_camera(const std::filesystem::path& path,
                                            const CameraFileDefaults& defaults) {
  SL_ASSIGN(const std::string text, read_file(path, kMaxBytes));
  SL_ASSIGN(CalibratedCamera camera, parse_opencv_camera(text, path.string(), defaults));
  if (camera.name.empty()) camera.name = path.stem().string();
  return camera;
}

}  // namespace sightline
