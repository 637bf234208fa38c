// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.hpp"
#include "mesh_depth_renderer.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "rig.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/observe/feature_teacher.hpp"
#include "sightline/record/pose_log.hpp"
#include "sightline/record/replay.hpp"
#include "sightline/record/still_picture.hpp"

namespace sightline::cli {
namespace {

constexpr Duration kLargestGap = std::chrono::milliseconds(100);

struct Taught {
  size_t pictures = 0;
  FeatureModel model;
};

// Where one object was, by time.
class Poses {
 public:
  void add(Time time, const Rigid3& pose) { poses_[time] = pose; }
  bool empty() const { return poses_.empty(); }
  // On the way between its neighbours; empty outside and in gaps.
  std::optional<Rigid3> at(Time time) const {
    const auto next = poses_.lower_bound(time);
    if (next == poses_.end()) return std::nullopt;
    if (next->first == time) return next->second;
    if (next == poses_.begin()) return std::nullopt;
    const auto before = std::prev(next);
    if (next->first - before->first > kLargestGap) return std::nullopt;
    const double share = to_seconds(time - before->first) / to_seconds(next->first - before->first);
    return before->second * Rigid3::exp(share * difference(before->second, next->second));
  }

 private:
  std::map<Time, Rigid3> poses_;
};

Result<Poses> read_poses(const std::filesystem::path& file, const std::string& object) {
  Poses poses;
  if (file.filename() == "truth.csv") {
    SL_ASSIGN(const auto rows, read_truth(file));
    for (const TruthRow& row : rows) {
      if (row.object == object) poses.add(row.time, row.world_from_object);
    }
  } else {
    SL_ASSIGN(const auto rows, read_pose_log(file));
    for (const PoseLogRow& row : rows) {
      const bool sure = row.state == TrackState::kTracking && row.world_from_object;
      if (row.object == object && sure) poses.add(row.time, *row.world_from_object);
    }
  }
  if (!poses.empty()) return poses;
  return make_error(ErrorCode::kInvalidInput, file.string(), "has no pose of {}", object);
}

Result<std::filesystem::path> pose_file(const TeachCommandOptions& options,
                                        const Recording& recording) {
  if (!options.poses.empty()) return options.poses;
  if (recording.truth) return *recording.truth;
  if (recording.poses) return *recording.poses;
  return make_error(ErrorCode::kInvalidInput, options.input.string(),
                    "has neither truth.csv nor poses.csv: make a pose log with `sightline replay "
                    "--poses FILE` (of an object that carries markers) and name it with --poses");
}

Result<const RigObject*> object_of(const Rig& rig, const TeachCommandOptions& options) {
  std::string names;
  for (const RigObject& object : rig.objects) {
    if (options.object.empty() && rig.objects.size() == 1) return &object;
    if (object.named.name == options.object) return &object;
    names += (names.empty() ? "" : ", ") + object.named.name;
  }
  return make_error(ErrorCode::kInvalidInput, options.input.string(),
                    "say which object with --object: it has {}", names);
}

Status check_cameras(const TeachCommandOptions& options, const Installation& installation) {
  for (const std::string& name : options.cameras) {
    const bool known = std::any_of(installation.cameras.begin(), installation.cameras.end(),
                                   [&](const CameraConfig& camera) { return camera.name == name; });
    if (known) continue;
    return make_error(ErrorCode::kInvalidInput, options.input.string(), "has no camera {}", name);
  }
  return {};
}

// The cameras of a recording, each with what it needs for teaching.
struct TeachingCamera {
  CalibratedCamera calibration;
  bool wanted = true;
  std::unique_ptr<DepthRenderer> depth;
  SceneDepth scene;
  size_t seen = 0;
};

Result<Taught> teach_from_recording(const TeachCommandOptions& options) {
  SL_ASSIGN(Recording opened, open_recording(options.input));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, recording_installation(options.input));
  for (ObjectConfig& object : installation.objects) {
    object.description.features.clear();  // may be what is to be made anew
    object.description.cues = {true, false, false, false};
  }
  SL_RETURN_IF_ERROR(check_cameras(options, installation));
  SL_ASSIGN(const Rig rig, load_rig(installation));
  SL_ASSIGN(const RigObject* object, object_of(rig, options));
  SL_ASSIGN(const std::filesystem::path file, pose_file(options, *recording));
  SL_ASSIGN(const Poses poses, read_poses(file, object->named.name));
  const DepthRendererFactory factory = mesh_depth_renderer_factory(object->mesh);
  std::vector<TeachingCamera> cameras;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    const CameraConfig& config = installation.cameras[i];
    const bool wanted = options.cameras.empty() ||
                        std::count(options.cameras.begin(), options.cameras.end(), config.name) > 0;
    cameras.push_back({config.calibration, wanted, factory(config.calibration.model),
                       make_scene_depth(installation, rig, CameraId(static_cast<uint32_t>(i))), 0});
  }
  FeatureTeacher teacher(mesh_content(*object->triangles));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording));
  ProgressBar bar("teach", recording->frame_count());
  Taught taught;
  std::optional<Time> start;
  for (size_t done = 0;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    for (const FramePtr& frame : *frames) {
      bar.set(++done);
      const Time time = frame->info().capture;
      if (!start) start = time;
      const double seconds = to_seconds(time - *start);
      TeachingCamera& camera = cameras[frame->info().camera.index()];
      if (!camera.wanted || seconds < options.from_s || seconds > options.to_s ||
          camera.seen++ % static_cast<size_t>(options.every) != 0)
        continue;
      const auto pose = poses.at(time);
      if (!pose) continue;
      teacher.teach(*frame, camera.calibration, *pose, *camera.depth, camera.scene.tile);
      ++taught.pictures;
    }
  }
  taught.model = teacher.model();
  return taught;
}

Status check_list_options(const TeachCommandOptions& options) {
  const auto refuse = [&](const char* text) {
    return make_error(ErrorCode::kInvalidInput, options.input.string(), "{}", text);
  };
  if (options.calibration.empty()) {
    return refuse("a list of pictures needs --calibration FILE, which has their cameras");
  }
  if (options.object.empty()) {
    return refuse("a list of pictures needs --object FILE, the file of the object in them");
  }
  if (!options.poses.empty() || !options.cameras.empty()) {
    return refuse("a list of pictures names poses and cameras itself: leave --poses and --camera");
  }
  return {};
}

Result<Taught> teach_from_pictures(const TeachCommandOptions& options) {
  SL_RETURN_IF_ERROR(check_list_options(options));
  SL_ASSIGN(const auto rows, read_picture_list(options.input));
  SL_ASSIGN(const auto calibration, read_calibration(options.calibration));
  SL_ASSIGN(const ObjectDescription object, read_object_file(options.object));
  MeshOptions unit;
  unit.meters_per_unit = object.meters_per_unit;
  SL_ASSIGN(const TriangleMesh mesh, read_mesh(object.mesh, unit));
  const DepthRendererFactory factory =
      mesh_depth_renderer_factory(std::make_shared<const RenderMesh>(make_render_mesh(mesh)));
  FeatureTeacher teacher(mesh_content(mesh));
  ProgressBar bar("teach", rows.size());
  Taught taught;
  for (const PictureRow& row : rows) {
    const std::string where = fmt::format("{}:{}", options.input.string(), row.line);
    const auto camera =
        std::find_if(calibration.begin(), calibration.end(),
                     [&](const CalibratedCamera& each) { return each.name == row.camera; });
    if (camera == calibration.end()) {
      return make_error(ErrorCode::kInvalidInput, where, "{} has no camera {}",
                        options.calibration.string(), row.camera);
    }
    SL_ASSIGN(const auto picture, read_picture(row.picture));
    if (picture->width() != camera->model.width() || picture->height() != camera->model.height()) {
      return make_error(ErrorCode::kInvalidInput, where, "{} is {} x {} pixels, camera {} {} x {}",
                        row.picture.string(), picture->width(), picture->height(), row.camera,
                        camera->model.width(), camera->model.height());
    }
    FrameInfo info;
    info.width = picture->width();
    info.height = picture->height();
    const auto depth = factory(camera->model);
    teacher.teach(*Frame::decoded(info, picture), *camera, row.world_from_object, *depth);
    bar.set(++taught.pictures);
  }
  taught.model = teacher.model();
  return taught;
}

Result<Taught> run(const TeachCommandOptions& options) {
  std::error_code ignored;
  const bool list = std::filesystem::is_regular_file(options.input, ignored);
  SL_ASSIGN(Taught taught, list ? teach_from_pictures(options) : teach_from_recording(options));
  if (taught.model.features.empty()) {
    return make_error(ErrorCode::kInvalidInput, options.input.string(),
                      "{} pictures show no feature of the object: it may be without print, hidden, "
                      "out of the picture, or its poses wrong",
                      taught.pictures);
  }
  SL_RETURN_IF_ERROR(write_feature_model(options.out, taught.model));
  return taught;
}

}  // namespace

int teach(const TeachCommandOptions& options) {
  const auto taught = run(options);
  if (!taught) return report(taught.error());
  if (options.json) {
    const nlohmann::ordered_json json = {{"pictures", taught->pictures},
                                         {"features", taught->model.features.size()}};
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{} features from {} pictures\n", taught->model.features.size(), taught->pictures);
  }
  return 0;
}

}  // namespace sightline::cli
