// SPDX-License-Identifier: Apache-2.0
// COLMAP's text model and mrcal's .cameramodel.
#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "calibrate/interchange/formats.hpp"
#include "calibrate/interchange/yaml_reader.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kColmapCenter = 0.5;  // of the top-left pixel

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos) break;
    line = line.substr(begin);
    const size_t end = line.find_first_of(" \t\r");
    words.push_back(line.substr(0, end));
    line = end == std::string_view::npos ? std::string_view() : line.substr(end);
  }
  return words;
}

/// Lines of a file with their numbers, comments left out.
struct Line {
  size_t number;
  std::vector<std::string_view> words;
};
std::vector<Line> lines_of(std::string_view text, bool keep_empty) {
  std::vector<Line> lines;
  for (size_t number = 1; !text.empty(); ++number) {
    const size_t end = text.find('\n');
    const auto words = words_of(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    const bool comment = !words.empty() && words.front().front() == '#';
    if (!comment && (keep_empty || !words.empty())) lines.push_back({number, words});
  }
  return lines;
}

Result<std::vector<double>> doubles(const Line& line, size_t first, size_t end,
                                    const std::string& where) {
  std::vector<double> out;
  for (size_t i = first; i < end; ++i) {
    const std::string_view word = line.words[i];
    double value = 0;
    const auto [last, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || last != word.data() + word.size() || !std::isfinite(value)) {
      return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}", where, line.number),
                        "'{}' is not a finite number", word);
    }
    out.push_back(value);
  }
  return out;
}

/// CAMERA_ID MODEL WIDTH HEIGHT PARAMS..
Result<CameraModel> colmap_lens(const Line& line, const std::string& file) {
  const std::string where = fmt::format("{}:{}", file, line.number);
  struct Model {
    const char* name;
    size_t parameters;
    LensModel lens;
    bool one_focal;
  };
  constexpr Model kModels[] = {{"SIMPLE_PINHOLE", 3, LensModel::kBrownConrady, true},
                               {"PINHOLE", 4, LensModel::kBrownConrady, false},
                               {"SIMPLE_RADIAL", 4, LensModel::kBrownConrady, true},
                               {"RADIAL", 5, LensModel::kBrownConrady, true},
                               {"OPENCV", 8, LensModel::kBrownConrady, false},
                               {"OPENCV_FISHEYE", 8, LensModel::kFisheye, false},
                               {"FULL_OPENCV", 12, LensModel::kRational, false}};
  for (const Model& model : kModels) {
    if (line.words.size() < 4 || line.words[1] != model.name) continue;
    if (line.words.size() != 4 + model.parameters) {
      return make_error(ErrorCode::kInvalidInput, where, "{} has {} parameters, not {}", model.name,
                        model.parameters, line.words.size() - 4);
    }
    SL_ASSIGN(const auto size, doubles(line, 2, 4, file));
    SL_ASSIGN(auto values, doubles(line, 4, line.words.size(), file));
    if (model.one_focal) values.insert(values.begin(), values.front());
    CameraModel::Parameters p;
    p.lens = model.lens;
    p.width = static_cast<int>(std::clamp(size[0], 0.0, 1e6));
    p.height = static_cast<int>(std::clamp(size[1], 0.0, 1e6));
    p.fx = values[0];
    p.fy = values[1];
    p.cx = values[2] - kColmapCenter;
    p.cy = values[3] - kColmapCenter;
    std::copy(values.begin() + 4, values.end(), p.distortion.begin());
    return CameraModel::create(p, where);
  }
  return make_error(ErrorCode::kInvalidInput, where,
                    "lens model '{}' is not ours: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, "
                    "OPENCV, FULL_OPENCV, OPENCV_FISHEYE",
                    line.words.size() > 1 ? line.words[1] : "");
}

const NamedText* find_file(const Files& files, std::string_view name) {
  for (const NamedText& file : files) {
    if (file.name == name) return &file;
  }
  return nullptr;
}

/// mrcal's file without the solver's inputs (b'..', base85), which are no YAML.
std::string without_inputs(const std::string& text) {
  const size_t begin = text.find("b'");
  if (begin == std::string::npos) return text;
  const size_t end = text.find('\'', begin + 2);
  if (end == std::string::npos) return text.substr(0, begin);
  return text.substr(0, begin) + "0" + text.substr(end + 1);
}

Result<CalibratedCamera> mrcal_camera(const NamedText& file) {
  SL_ASSIGN(const YAML::Node root, parse_yaml(without_inputs(file.text), file.name));
  const YamlTable table(root, file.name);
  SL_ASSIGN(const std::string model, table.text("lensmodel"));
  CameraModel::Parameters p;
  size_t count = 0;
  if (model == "LENSMODEL_OPENCV4") {
    count = 4;
  } else if (model == "LENSMODEL_OPENCV5") {
    count = 5;
  } else if (model == "LENSMODEL_OPENCV8") {
    count = 8;
    p.lens = LensModel::kRational;
  } else if (model != "LENSMODEL_PINHOLE") {
    return table.fault("{} is not ours: LENSMODEL_PINHOLE, _OPENCV4, _OPENCV5, _OPENCV8", model);
  }
  SL_ASSIGN(const auto values, table.numbers("intrinsics", 4 + count));
  SL_ASSIGN(const auto size, table.numbers("imagersize", 2));
  p.fx = values[0];
  p.fy = values[1];
  p.cx = values[2];
  p.cy = values[3];
  std::copy(values.begin() + 4, values.end(), p.distortion.begin());
  p.width = static_cast<int>(std::clamp(size[0], 0.0, 1e6));
  p.height = static_cast<int>(std::clamp(size[1], 0.0, 1e6));
  SL_ASSIGN(CameraModel lens, CameraModel::create(p, file.name));
  SL_ASSIGN(const auto rt, table.numbers("extrinsics", 6));
  Vector6 turn = Vector6::Zero();
  turn.head<3>() << rt[0], rt[1], rt[2];
  Rigid3 camera_from_world = Rigid3::exp(turn);
  camera_from_world.translation << rt[3], rt[4], rt[5];
  return CalibratedCamera{file.name.substr(0, file.name.rfind('.')), std::move(lens),
                          camera_from_world.inverse(), 0.5};
}

}  // namespace

Result<Files> export_colmap(const Cameras& cameras) {
  std::string lenses = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  std::string images =
      "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, "
      "POINT3D_ID)\n";
  for (size_t c = 0; c < cameras.size(); ++c) {
    const CameraModel::Parameters& p = cameras[c].model.parameters();
    const bool fisheye = p.lens == LensModel::kFisheye;
    const bool full = !fisheye && std::any_of(p.distortion.begin() + 4, p.distortion.end(),
                                              [](double d) { return d != 0; });
    lenses +=
        fmt::format("{} {} {} {} {} {} {} {}", c + 1,
                    fisheye ? "OPENCV_FISHEYE"
                    : full  ? "FULL_OPENCV"
                            : "OPENCV",
                    p.width, p.height, p.fx, p.fy, p.cx + kColmapCenter, p.cy + kColmapCenter);
    for (size_t i = 0; i < (full ? 8u : 4u); ++i) lenses += fmt::format(" {}", p.distortion[i]);
    lenses += "\n";
    const Rigid3 pose = cameras[c].world_from_camera.inverse();
    const Eigen::Quaterniond& q = pose.rotation;
    const Eigen::Vector3d& t = pose.translation;
    images += fmt::format("{} {} {} {} {} {} {} {} {} {}.png\n\n", c + 1, q.w(), q.x(), q.y(),
                          q.z(), t.x(), t.y(), t.z(), c + 1, cameras[c].name);
  }
  return Files{{"cameras.txt", lenses}, {"images.txt", images}};
}

Result<Cameras> import_colmap(const Files& files) {
  const NamedText* lenses = find_file(files, "cameras.txt");
  const NamedText* images = find_file(files, "images.txt");
  if (lenses == nullptr || images == nullptr) {
    return make_error(ErrorCode::kInvalidInput, "",
                      "COLMAP has two files: cameras.txt, images.txt");
  }
  std::map<std::string, CameraModel, std::less<>> models;
  for (const Line& line : lines_of(lenses->text, false)) {
    SL_ASSIGN(CameraModel model, colmap_lens(line, lenses->name));
    models.emplace(std::string(line.words[0]), std::move(model));
  }
  Cameras cameras;
  // Two lines to an image; the second one, of points, may be empty.
  const std::vector<Line> lines = lines_of(images->text, true);
  for (size_t i = 0; i < lines.size(); i += 2) {
    const Line& line = lines[i];
    if (line.words.empty()) continue;
    const std::string where = fmt::format("{}:{}", images->name, line.number);
    if (line.words.size() != 10) {
      return make_error(ErrorCode::kInvalidInput, where, "an image has 10 fields, not {}",
                        line.words.size());
    }
    SL_ASSIGN(const auto pose, doubles(line, 1, 8, images->name));
    const Eigen::Quaterniond q(pose[0], pose[1], pose[2], pose[3]);
    if (std::abs(q.norm() - 1) > 1e-3) {
      return make_error(ErrorCode::kInvalidInput, where, "its quaternion is no rotation");
    }
    const auto model = models.find(line.words[8]);
    if (model == models.end()) {
      return make_error(ErrorCode::kInvalidInput, where, "there is no camera {}", line.words[8]);
    }
    const std::string_view name = line.words[9].substr(0, line.words[9].rfind('.'));
    const Rigid3 camera_from_world(q, {pose[4], pose[5], pose[6]});
    cameras.push_back({std::string(name), model->second, camera_from_world.inverse(), 0.5});
  }
  return cameras;
}

Result<Files> export_mrcal(const Cameras& cameras) {
  Files files;
  for (const CalibratedCamera& camera : cameras) {
    const CameraModel::Parameters& p = camera.model.parameters();
    if (p.lens == LensModel::kFisheye) {
      return make_error(ErrorCode::kInvalidInput, "camera " + camera.name,
                        "mrcal has no equidistant fisheye with four coefficients");
    }
    const size_t count = p.lens == LensModel::kRational ? 8 : 5;
    SL_ASSIGN(const auto d, coefficients(camera, count, count, "mrcal"));
    std::vector<double> intrinsics = {p.fx, p.fy, p.cx, p.cy};
    intrinsics.insert(intrinsics.end(), d.begin(), d.end());
    const Rigid3 pose = camera.world_from_camera.inverse();
    const Eigen::Vector3d r = rotation_vector(pose);
    const Eigen::Vector3d& t = pose.translation;
    files.push_back(
        {camera.name + ".cameramodel",
         fmt::format(
             "{{\n    'lensmodel':  'LENSMODEL_OPENCV{}',\n\n    # camera from reference\n"
             "    'extrinsics': {},\n\n    'intrinsics': {},\n\n    'imagersize': [{}, {}],\n"
             "}}\n",
             count, numbers({r.x(), r.y(), r.z(), t.x(), t.y(), t.z()}), numbers(intrinsics),
             p.width, p.height)});
  }
  return files;
}

Result<Cameras> import_mrcal(const Files& files) try {
  Cameras cameras;
  for (const NamedText& file : files) {
    SL_ASSIGN(CalibratedCamera camera, mrcal_camera(file));
    cameras.push_back(std::move(camera));
  }
  return cameras;
} catch (const YAML::Exception& error) {
  return make_error(ErrorCode::kInvalidInput, ".cameramodel", "cannot be read: {}", error.msg);
}

}  // namespace sightline::calibrate
