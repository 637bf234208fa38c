// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/observe/features/feature_trainer.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/rig_parts.hpp"
#include "sightline/record/pose_log.hpp"
#include "sightline/record/replay.hpp"
#include "sightline/record/still_image.hpp"

namespace sightline::cli {
namespace {

struct TrainCommandOptions {
  std::filesystem::path input;        ///< recording, or list of images
  std::filesystem::path out;          ///< the feature file
  std::filesystem::path poses;        ///< truth.csv or a pose log; empty: the recording's own
  std::filesystem::path calibration;  ///< of the list's cameras
  std::string object;  ///< of the recording (empty: its only one); for a list its file
  std::vector<std::string> cameras;  ///< empty: all
  int every = 5;                     ///< images of a camera
  double from_s = 0, to_s = 1e9;     ///< of the recording
  bool json = false;
};

constexpr Duration kLargestGap = std::chrono::milliseconds(100);

struct Trained {
  size_t images = 0;
  FeatureModel model;
};

// Where one object was, by time.
class Poses {
 public:
  void add(Time time, const Rigid3& pose) { poses_[time] = pose; }
  bool empty() const { return poses_.empty(); }
  // On the way between its neighbors; empty outside and in gaps.
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

Result<std::filesystem::path> pose_file(const TrainCommandOptions& options,
                                        const Recording& recording) {
  if (!options.poses.empty()) return options.poses;
  if (recording.truth) return *recording.truth;
  if (recording.poses) return *recording.poses;
  return make_error(ErrorCode::kInvalidInput, options.input.string(),
                    "has neither truth.csv nor poses.csv: make a pose log with `sightline replay "
                    "--poses FILE` (of an object that carries markers) and name it with --poses");
}

Result<const RigObject*> object_of(const Rig& rig, const TrainCommandOptions& options) {
  std::string names;
  for (const RigObject& object : rig.objects) {
    if (options.object.empty() && rig.objects.size() == 1) return &object;
    if (object.named.name == options.object) return &object;
    names += (names.empty() ? "" : ", ") + object.named.name;
  }
  return make_error(ErrorCode::kInvalidInput, options.input.string(),
                    "say which object with --object: it has {}", names);
}

Status check_cameras(const TrainCommandOptions& options, const Installation& installation) {
  for (const std::string& name : options.cameras) {
    const bool known = std::any_of(installation.cameras.begin(), installation.cameras.end(),
                                   [&](const CameraConfig& camera) { return camera.name == name; });
    if (known) continue;
    return make_error(ErrorCode::kInvalidInput, options.input.string(), "has no camera {}", name);
  }
  return {};
}

// The cameras of a recording, each with what it needs for training.
struct TrainingCamera {
  CalibratedCamera calibration;
  bool used = true;
  std::unique_ptr<DepthRenderer> depth;
  SceneDepth scene;
  size_t seen = 0;
};

Result<Trained> train_from_recording(const TrainCommandOptions& options) {
  SL_ASSIGN(Recording opened, open_recording(options.input));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, recording_installation(options.input));
  for (ObjectConfig& object : installation.objects) {
    object.description.features.clear();  // may be what is to be made anew
    object.description.modalities = {true, false, false, false};
  }
  SL_RETURN_IF_ERROR(check_cameras(options, installation));
  SL_ASSIGN(const Rig rig, load_rig(installation));
  SL_ASSIGN(const RigObject* object, object_of(rig, options));
  SL_ASSIGN(const std::filesystem::path file, pose_file(options, *recording));
  SL_ASSIGN(const Poses poses, read_poses(file, object->named.name));
  const DepthRendererFactory factory = mesh_depth_renderer_factory(object->mesh);
  std::vector<TrainingCamera> cameras;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    const CameraConfig& config = installation.cameras[i];
    const bool used = options.cameras.empty() ||
                      std::count(options.cameras.begin(), options.cameras.end(), config.name) > 0;
    cameras.push_back({config.calibration, used, factory(config.calibration.model),
                       make_scene_depth(rig, CameraId(static_cast<uint32_t>(i))), 0});
  }
  FeatureTrainer trainer(mesh_content(*object->triangles));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording, {}, time_offsets(*recording, installation),
                                             axis_histories(*recording, installation)));
  ProgressBar bar("train", recording->frame_count());
  Trained trained;
  std::optional<Time> start;
  for (size_t done = 0;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    for (const FramePtr& frame : *frames) {
      bar.set(++done);
      const Time time = frame->info().capture;
      if (!start) start = time;
      const double seconds = to_seconds(time - *start);
      TrainingCamera& camera = cameras[frame->info().camera.index()];
      if (!camera.used || seconds < options.from_s || seconds > options.to_s ||
          camera.seen++ % static_cast<size_t>(options.every) != 0)
        continue;
      const auto pose = poses.at(time);
      if (!pose) continue;
      trainer.train(*frame, camera.calibration, *pose, *camera.depth, camera.scene.tile);
      ++trained.images;
    }
  }
  trained.model = trainer.model();
  return trained;
}

Status check_list_options(const TrainCommandOptions& options) {
  const auto refuse = [&](const char* text) {
    return make_error(ErrorCode::kInvalidInput, options.input.string(), "{}", text);
  };
  if (options.calibration.empty()) {
    return refuse("a list of images needs --calibration FILE, which has their cameras");
  }
  if (options.object.empty()) {
    return refuse("a list of images needs --object FILE, the file of the object in them");
  }
  if (!options.poses.empty() || !options.cameras.empty()) {
    return refuse("a list of images names poses and cameras itself: leave --poses and --camera");
  }
  return {};
}

Result<Trained> train_from_images(const TrainCommandOptions& options) {
  SL_RETURN_IF_ERROR(check_list_options(options));
  SL_ASSIGN(const auto rows, read_image_list(options.input));
  SL_ASSIGN(const auto calibration, read_calibration(options.calibration));
  SL_ASSIGN(const ObjectDescription object, read_object_file(options.object));
  MeshOptions unit;
  unit.meters_per_unit = object.meters_per_unit;
  SL_ASSIGN(const TriangleMesh mesh, read_mesh(object.mesh, unit));
  const DepthRendererFactory factory =
      mesh_depth_renderer_factory(std::make_shared<const RenderMesh>(make_render_mesh(mesh)));
  FeatureTrainer trainer(mesh_content(mesh));
  ProgressBar bar("train", rows.size());
  Trained trained;
  for (const ImageRow& row : rows) {
    const std::string where = fmt::format("{}:{}", options.input.string(), row.line);
    const auto camera =
        std::find_if(calibration.begin(), calibration.end(),
                     [&](const CalibratedCamera& each) { return each.name == row.camera; });
    if (camera == calibration.end()) {
      return make_error(ErrorCode::kInvalidInput, where, "{} has no camera {}",
                        options.calibration.string(), row.camera);
    }
    SL_ASSIGN(const auto image, read_image(row.image));
    if (image->width() != camera->model.width() || image->height() != camera->model.height()) {
      return make_error(ErrorCode::kInvalidInput, where, "{} is {} x {} pixels, camera {} {} x {}",
                        row.image.string(), image->width(), image->height(), row.camera,
                        camera->model.width(), camera->model.height());
    }
    FrameInfo info;
    info.width = image->width();
    info.height = image->height();
    const auto depth = factory(camera->model);
    trainer.train(*Frame::decoded(info, image), *camera, row.world_from_object, *depth);
    bar.set(++trained.images);
  }
  trained.model = trainer.model();
  return trained;
}

Result<Trained> run(const TrainCommandOptions& options) {
  std::error_code ignored;
  const bool list = std::filesystem::is_regular_file(options.input, ignored);
  SL_ASSIGN(Trained trained, list ? train_from_images(options) : train_from_recording(options));
  if (trained.model.features.empty()) {
    return make_error(ErrorCode::kInvalidInput, options.input.string(),
                      "{} images show no feature of the object: it may be without texture, hidden, "
                      "out of the image, or its poses wrong",
                      trained.images);
  }
  SL_RETURN_IF_ERROR(write_feature_model(options.out, trained.model));
  return trained;
}

int train(const TrainCommandOptions& options) {
  const auto trained = run(options);
  if (!trained) return report(trained.error());
  if (options.json) {
    const nlohmann::ordered_json json = {{"images", trained->images},
                                         {"features", trained->model.features.size()}};
    fmt::print("{}\n", json.dump(2));
  } else {
    fmt::print("{} features from {} images\n", trained->model.features.size(), trained->images);
  }
  return 0;
}

}  // namespace

void add_train(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<TrainCommandOptions>();
  auto* command = app.add_subcommand("train", "learn an object's texture features, to find it by");
  command
      ->add_option("INPUT", options->input,
                   "recording with known poses, or list of images (CSV: image, camera, pose)")
      ->required();
  command->add_option("OUT", options->out, "feature file to write")->required();
  command->add_option("--poses", options->poses,
                      "truth or pose log (default: truth.csv, poses.csv of the recording)");
  command->add_option("--object", options->object,
                      "which of the recording, if there are several; for images the object file");
  command->add_option("--calibration", options->calibration, "of the cameras of the images");
  command->add_option("--camera", options->cameras, "only this one; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--every", options->every, "N: each Nth image of a camera (default 5)")
      ->check(CLI::Range(1, 100000));
  command->add_option("--from", options->from_s, "seconds since the recording's start")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--to", options->to_s, "seconds since the recording's start")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", options->json, "as JSON");
  command->callback([options, &chosen] { chosen = [options] { return train(*options); }; });
}

}  // namespace sightline::cli
