// SPDX-License-Identifier: Apache-2.0
// Kalibr's camchain.yaml and the camera_info files of ROS.
#include <Eigen/Geometry>
#include <algorithm>
#include <exception>
#include <map>

#include "calibrate/interchange/formats.hpp"
#include "calibrate/interchange/yaml_reader.hpp"

namespace sightline::calibrate {
namespace {

constexpr const char* kTransforms = "static_transforms.yaml";

Result<CalibratedCamera> make_camera(CameraModel::Parameters p, const std::vector<double>& d,
                                     const YamlTable& table, const std::string& where,
                                     const std::string& name) {
  const size_t most = p.lens == LensModel::kRational ? 8 : p.lens == LensModel::kFisheye ? 4 : 5;
  for (size_t i = most; i < d.size(); ++i) {
    if (d[i] != 0) return table.fault("its lens has {} coefficients, not {}", d.size(), most);
  }
  std::copy_n(d.begin(), std::min(most, d.size()), p.distortion.begin());
  SL_ASSIGN(CameraModel model, CameraModel::create(p, where));
  return CalibratedCamera{name, std::move(model), Rigid3(), 0.5};
}

std::string rows_of(const Eigen::Matrix4d& m, const char* indent) {
  std::string text;
  for (int row = 0; row < 4; ++row) {
    text += fmt::format("{}- {}\n", indent, numbers({m(row, 0), m(row, 1), m(row, 2), m(row, 3)}));
  }
  return text;
}

/// "/left/image_raw" to "left".
std::string name_of_topic(std::string topic) {
  while (topic.starts_with('/')) topic.erase(0, 1);
  const size_t end = topic.rfind("/image");
  if (end != std::string::npos) topic.resize(end);
  std::replace(topic.begin(), topic.end(), '/', '_');
  return topic;
}

Result<CalibratedCamera> kalibr_camera(const YamlTable& table, const std::string& where,
                                       const std::string& key) {
  CameraModel::Parameters p;
  SL_ASSIGN(const std::string model, table.text("camera_model"));
  if (model != "pinhole") {
    return table.fault("camera_model '{}' is not ours: pinhole (omni, eucm and ds are not)", model);
  }
  SL_ASSIGN(const std::string distortion, table.text("distortion_model"));
  SL_ASSIGN(const auto f, table.numbers("intrinsics", 4));
  SL_ASSIGN(const auto size, table.numbers("resolution", 2));
  std::vector<double> d;
  if (distortion == "equidistant") {
    p.lens = LensModel::kFisheye;
  } else if (distortion != "radtan" && distortion != "none") {
    return table.fault("distortion_model '{}' is not ours: radtan, equidistant, none", distortion);
  }
  if (distortion != "none") {
    SL_ASSIGN(d, table.numbers("distortion_coeffs", 4));
  }
  p.fx = f[0];
  p.fy = f[1];
  p.cx = f[2];
  p.cy = f[3];
  p.width = static_cast<int>(std::clamp(size[0], 0.0, 1e6));
  p.height = static_cast<int>(std::clamp(size[1], 0.0, 1e6));
  std::string name = key;
  if (table.has("rostopic")) {
    SL_ASSIGN(const std::string topic, table.text("rostopic"));
    if (!name_of_topic(topic).empty()) name = name_of_topic(topic);
  }
  return make_camera(p, d, table, where, name);
}

Result<CalibratedCamera> ros_camera(const NamedText& file) {
  SL_ASSIGN(const YAML::Node root, parse_yaml(file.text, file.name));
  const YamlTable table(root, file.name);
  CameraModel::Parameters p;
  SL_ASSIGN(p.width, table.whole("image_width"));
  SL_ASSIGN(p.height, table.whole("image_height"));
  SL_ASSIGN(const std::string model, table.text("distortion_model"));
  SL_ASSIGN(const auto k, table.numbers("camera_matrix", 9));
  SL_ASSIGN(const auto d, table.numbers("distortion_coefficients", 0));
  if (model == "equidistant" || model == "fisheye") {
    p.lens = LensModel::kFisheye;
  } else if (model == "rational_polynomial") {
    p.lens = LensModel::kRational;
  } else if (model != "plumb_bob") {
    return table.fault(
        "distortion_model '{}' is not ours: plumb_bob, rational_polynomial, equidistant", model);
  }
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    return table.fault("camera_matrix is not of the form fx 0 cx, 0 fy cy, 0 0 1");
  }
  p.fx = k[0];
  p.cx = k[2];
  p.fy = k[4];
  p.cy = k[5];
  std::string name = file.name.substr(0, file.name.rfind('.'));
  if (table.has("camera_name")) {
    SL_ASSIGN(name, table.text("camera_name"));
  }
  return make_camera(p, d, table, file.name, name);
}

Status read_transforms(const NamedText& file, std::map<std::string, Rigid3>& out) {
  SL_ASSIGN(const YAML::Node root, parse_yaml(file.text, file.name));
  const YAML::Node list = root["transforms"];
  if (!list.IsDefined() || !list.IsSequence()) {
    return make_error(ErrorCode::kInvalidInput, file.name, "has no list 'transforms'");
  }
  for (const YAML::Node& node : list) {
    const YamlTable table(node, file.name);
    SL_ASSIGN(const std::string child, table.text("child_frame_id"));
    SL_ASSIGN(const auto t, table.numbers("translation", 3));
    SL_ASSIGN(const auto q, table.numbers("rotation_xyzw", 4));
    const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
    if (std::abs(rotation.norm() - 1) > 1e-3) return table.fault("rotation_xyzw is no rotation");
    out[child] = Rigid3(rotation, {t[0], t[1], t[2]});
  }
  return {};
}

}  // namespace

Result<Files> export_kalibr(const Cameras& cameras) {
  std::string text;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const CameraModel::Parameters& p = cameras[c].model.parameters();
    const bool fisheye = p.lens == LensModel::kFisheye;
    SL_ASSIGN(const auto d, coefficients(cameras[c], 4, 4, "Kalibr"));
    text += fmt::format(
        "cam{}:\n  camera_model: pinhole\n  distortion_model: {}\n  distortion_coeffs: {}\n"
        "  intrinsics: {}\n  resolution: [{}, {}]\n  rostopic: /{}/image_raw\n",
        c, fisheye ? "equidistant" : "radtan", numbers(d), numbers({p.fx, p.fy, p.cx, p.cy}),
        p.width, p.height, cameras[c].name);
    if (c == 0) continue;
    const Rigid3 chain = cameras[c].world_from_camera.inverse() * cameras[c - 1].world_from_camera;
    text += "  T_cn_cnm1:\n" + rows_of(chain.matrix(), "  ");
  }
  return Files{{"camchain.yaml", text}};
}

Result<Cameras> import_kalibr(const Files& files) try {
  Cameras cameras;
  if (files.size() != 1) {
    return make_error(ErrorCode::kInvalidInput, "", "Kalibr has one file, camchain.yaml");
  }
  const std::string& where = files.front().name;
  SL_ASSIGN(const YAML::Node root, parse_yaml(files.front().text, where));
  Rigid3 world_from_camera;
  for (size_t c = 0;; ++c) {
    const std::string key = fmt::format("cam{}", c);
    const YAML::Node node = root[key];
    if (!node.IsDefined()) break;
    const YamlTable table(node, where);
    SL_ASSIGN(CalibratedCamera camera, kalibr_camera(table, where + ": " + key, key));
    if (c > 0) {
      SL_ASSIGN(const Rigid3 chain, table.pose("T_cn_cnm1"));
      world_from_camera = world_from_camera * chain.inverse();
    }
    camera.world_from_camera = world_from_camera;
    cameras.push_back(std::move(camera));
  }
  return cameras;
} catch (const YAML::Exception& error) {
  return make_error(ErrorCode::kInvalidInput, "camchain.yaml", "cannot be read: {}", error.msg);
}

Result<Files> export_ros(const Cameras& cameras) {
  Files files;
  std::string transforms = "transforms:\n";
  for (const CalibratedCamera& camera : cameras) {
    const CameraModel::Parameters& p = camera.model.parameters();
    const bool fisheye = p.lens == LensModel::kFisheye;
    const bool rational = p.lens == LensModel::kRational;
    const size_t count = fisheye ? 4 : rational ? 8 : 5;
    SL_ASSIGN(const auto d, coefficients(camera, count, count, "ROS"));
    files.push_back(
        {camera.name + ".yaml",
         fmt::format(
             "image_width: {}\nimage_height: {}\ncamera_name: {}\ncamera_matrix:\n  rows: 3\n"
             "  cols: 3\n  data: {}\ndistortion_model: {}\ndistortion_coefficients:\n  rows: 1\n"
             "  cols: {}\n  data: {}\nrectification_matrix:\n  rows: 3\n  cols: 3\n"
             "  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nprojection_matrix:\n  rows: 3\n  cols: 4\n"
             "  data: {}\n",
             p.width, p.height, camera.name, numbers({p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1}),
             fisheye    ? "equidistant"
             : rational ? "rational_polynomial"
                        : "plumb_bob",
             count, numbers(d), numbers({p.fx, 0, p.cx, 0, 0, p.fy, p.cy, 0, 0, 0, 1, 0}))});
    const Rigid3& pose = camera.world_from_camera;
    const Eigen::Vector3d& t = pose.translation;
    const Eigen::Quaterniond& q = pose.rotation;
    transforms += fmt::format(
        "  - frame_id: world\n    child_frame_id: {}\n    translation: {}\n    rotation_xyzw: {}\n",
        camera.name, numbers({t.x(), t.y(), t.z()}), numbers({q.x(), q.y(), q.z(), q.w()}));
  }
  files.push_back({kTransforms, transforms});
  return files;
}

Result<Cameras> import_ros(const Files& files) try {
  Cameras cameras;
  std::map<std::string, Rigid3> places;
  for (const NamedText& file : files) {
    if (file.name == kTransforms) {
      SL_RETURN_IF_ERROR(read_transforms(file, places));
      continue;
    }
    SL_ASSIGN(CalibratedCamera camera, ros_camera(file));
    cameras.push_back(std::move(camera));
  }
  for (CalibratedCamera& camera : cameras) {
    const auto place = places.find(camera.name);
    if (place != places.end()) camera.world_from_camera = place->second;
  }
  return cameras;
} catch (const YAML::Exception& error) {
  return make_error(ErrorCode::kInvalidInput, "camera_info", "cannot be read: {}", error.msg);
}

}  // namespace sightline::calibrate
