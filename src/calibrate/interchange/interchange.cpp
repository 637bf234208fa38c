// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/interchange.hpp"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <set>

#include "calibrate/interchange/formats.hpp"
#include "sightline/calibrate/opencv_camera.hpp"

namespace sightline {
namespace calibrate {

std::string numbers(const std::vector<double>& values) {
  std::string text = "[";
  for (size_t i = 0; i < values.size(); ++i) text += fmt::format("{}{}", i ? ", " : "", values[i]);
  return text + "]";
}

Eigen::Vector3d rotation_vector(const Rigid3& pose) { return pose.log().head<3>(); }

Result<std::vector<double>> coefficients(const CalibratedCamera& camera, size_t least, size_t most,
                                         const char* format) {
  const CameraModel::Parameters& p = camera.model.parameters();
  std::vector<double> values(p.distortion.begin(), p.distortion.end());
  while (values.size() > least && values.back() == 0) values.pop_back();
  if (values.size() <= most) return values;
  return make_error(ErrorCode::kInvalidInput, "camera " + camera.name,
                    "its lens has {} coefficients, {} has room for {}: solve with fewer, or use "
                    "another format",
                    values.size(), format, most);
}

Result<Files> export_opencv(const Cameras& cameras) try {
  Files files;
  for (const CalibratedCamera& camera : cameras) {
    const CameraModel::Parameters& p = camera.model.parameters();
    const bool fisheye = p.lens == LensModel::kFisheye;
    SL_ASSIGN(const auto d, coefficients(camera, fisheye ? 4 : 5, fisheye ? 4 : 8, "OpenCV"));
    cv::FileStorage out(".yml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    const Rigid3 camera_from_world = camera.world_from_camera.inverse();
    const Eigen::Vector3d r = rotation_vector(camera_from_world);
    const Eigen::Vector3d& t = camera_from_world.translation;
    out << "camera_name" << camera.name << "image_width" << p.width << "image_height" << p.height
        << "camera_matrix"
        << cv::Mat((cv::Mat_<double>(3, 3) << p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1))
        << "distortion_model"
        << (fisheye                          ? "fisheye"
            : p.lens == LensModel::kRational ? "rational_polynomial"
                                             : "plumb_bob")
        << "distortion_coefficients" << cv::Mat(d, true).reshape(1, 1) << "rvec"
        << cv::Mat((cv::Mat_<double>(3, 1) << r.x(), r.y(), r.z())) << "tvec"
        << cv::Mat((cv::Mat_<double>(3, 1) << t.x(), t.y(), t.z())) << "rms_px" << camera.rms_px;
    files.push_back({camera.name + ".yml", out.releaseAndGetString()});
  }
  return files;
} catch (const cv::Exception& error) {
  return make_error(ErrorCode::kInternal, "", "OpenCV cannot write it: {}", error.err);
}

Result<Cameras> import_opencv(const Files& files) {
  Cameras cameras;
  for (const NamedText& file : files) {
    SL_ASSIGN(CalibratedCamera camera, parse_opencv_camera(file.text, file.name));
    if (camera.name.empty()) camera.name = file.name.substr(0, file.name.find('.'));
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace calibrate

using namespace calibrate;

Result<InterchangeFormat> parse_interchange_format(const std::string& name) {
  if (name == "opencv") return InterchangeFormat::kOpencv;
  if (name == "kalibr") return InterchangeFormat::kKalibr;
  if (name == "ros") return InterchangeFormat::kRos;
  if (name == "colmap") return InterchangeFormat::kColmap;
  if (name == "mrcal") return InterchangeFormat::kMrcal;
  if (name == "anipose") return InterchangeFormat::kAnipose;
  if (name == "caliscope") return InterchangeFormat::kCaliscope;
  return make_error(ErrorCode::kInvalidInput, "--format",
                    "'{}' is not known: opencv, kalibr, ros, colmap, mrcal, anipose, caliscope",
                    name);
}

Result<std::vector<NamedText>> export_cameras(const std::vector<CalibratedCamera>& cameras,
                                              InterchangeFormat format) {
  switch (format) {
    case InterchangeFormat::kOpencv:
      return export_opencv(cameras);
    case InterchangeFormat::kKalibr:
      return export_kalibr(cameras);
    case InterchangeFormat::kRos:
      return export_ros(cameras);
    case InterchangeFormat::kColmap:
      return export_colmap(cameras);
    case InterchangeFormat::kMrcal:
      return export_mrcal(cameras);
    case InterchangeFormat::kAnipose:
      return export_anipose(cameras);
    case InterchangeFormat::kCaliscope:
      return export_caliscope(cameras);
  }
  return make_error(ErrorCode::kInternal, "", "no such format");
}

namespace {

Result<std::vector<CalibratedCamera>> import_any(const std::vector<NamedText>& files,
                                                 InterchangeFormat format) {
  switch (format) {
    case InterchangeFormat::kOpencv:
      return import_opencv(files);
    case InterchangeFormat::kKalibr:
      return import_kalibr(files);
    case InterchangeFormat::kRos:
      return import_ros(files);
    case InterchangeFormat::kColmap:
      return import_colmap(files);
    case InterchangeFormat::kMrcal:
      return import_mrcal(files);
    case InterchangeFormat::kAnipose:
    case InterchangeFormat::kCaliscope:
      return import_anipose(files);
  }
  return make_error(ErrorCode::kInternal, "", "no such format");
}

}  // namespace

Result<std::vector<CalibratedCamera>> import_cameras(const std::vector<NamedText>& files,
                                                     InterchangeFormat format) {
  SL_ASSIGN(auto cameras, import_any(files, format));
  std::set<std::string> names;
  for (const CalibratedCamera& camera : cameras) {
    if (names.insert(camera.name).second) continue;
    return make_error(ErrorCode::kInvalidInput, files.front().name, "two cameras are called '{}'",
                      camera.name);
  }
  if (!cameras.empty()) return cameras;
  return make_error(ErrorCode::kInvalidInput, files.empty() ? "" : files.front().name,
                    "holds no camera");
}

}  // namespace sightline
