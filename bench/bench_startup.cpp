// SPDX-License-Identifier: Apache-2.0
// Where the time of a start goes: a rig of six 1280x720 cameras around the object and the static
// scene of recordings/bench is assembled as the daemon does it, part by part. Prints JSON: seconds
// on the clock and of the processor for every phase.
//   bench_startup [--cold] [--serial] [--runs N] [--learn]
#include <fmt/format.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string_view>

#include "figures.hpp"
#include "sightline/pipeline/camera_observer.hpp"
#include "sightline/pipeline/object_points.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/rig_parts.hpp"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kWidth = 1280, kHeight = 720;
constexpr size_t kCameras = 6;

struct Arguments {
  bool cold = false;    // without a cache folder
  bool serial = false;  // one part after the other
  bool learn = false;   // [scene] learn
};

// The recording's cameras at twice their resolution, cropped to 16:9; the second three of them are
// the first three turned about the world's vertical axis.
Result<CalibratedCamera> enlarged(const CalibratedCamera& camera, const std::string& name,
                                  double turn) {
  CameraModel::Parameters lens = camera.model.parameters();
  lens.fx *= 2, lens.fy *= 2;
  lens.cx = 2 * lens.cx + 0.5;
  lens.cy = 2 * lens.cy + 0.5 - (2 * lens.height - kHeight) / 2.0;
  lens.width = kWidth, lens.height = kHeight;
  SL_ASSIGN(const CameraModel model, CameraModel::create(lens, name));
  const Rigid3 turned{Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ())),
                      {0, 0, 0}};
  return CalibratedCamera{name, model, turned * camera.world_from_camera, camera.rms_px};
}

Result<Installation> make_installation(bool learn) {
  SL_ASSIGN(
      Installation installation,
      recording_installation(std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings/bench"));
  const std::vector<CameraConfig> recorded = std::move(installation.cameras);
  installation.cameras.clear();
  for (size_t i = 0; i < kCameras; ++i) {
    CameraConfig camera = recorded[i % recorded.size()];
    camera.name = fmt::format("camera{}", i);
    const double turn = i < recorded.size() ? 0 : std::numbers::pi / 6;
    SL_ASSIGN(camera.calibration, enlarged(camera.calibration, camera.name, turn));
    installation.cameras.push_back(std::move(camera));
  }
  // Not only by its markers, so that everything has to be made.
  installation.objects.front().description.modalities = {false, true, true, true};
  installation.scene.learn = learn;
  return installation;
}

class Stopwatch {
 public:
  explicit Stopwatch(Json& out) : out_(out) {}
  void lap(const char* phase) {
    const auto now = std::chrono::steady_clock::now();
    const double cpu = process_cpu_ms();
    out_[phase] = {{"s", std::chrono::duration<double>(now - wall_).count()},
                   {"cpu_s", 1e-3 * (cpu - cpu_)}};
    wall_ = std::chrono::steady_clock::now();
    cpu_ = process_cpu_ms();
  }

 private:
  Json& out_;
  std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
  double cpu_ = process_cpu_ms();
};

struct Camera {
  std::unique_ptr<CameraObserver> observer;
  std::unique_ptr<CameraRenderer> renderer;
  std::unique_ptr<OcclusionLearner> learner;
};

Result<Camera> make_camera(const Installation& installation, const Rig& rig, CameraId id) {
  Camera camera;
  SL_ASSIGN(camera.observer, CameraObserver::create(installation, rig, id));
  SL_ASSIGN(camera.renderer, make_renderer(installation, rig, id));
  SL_ASSIGN(camera.learner, make_learner(installation, rig, id));
  return camera;
}

Result<Json> start_once(const Installation& installation, const Arguments& arguments) {
  const Executor executor = arguments.serial ? run_serially : run_in_parallel;
  RigOptions options;
  options.executor = executor;
  if (arguments.cold) options.cache.clear();
  Json out;
  Stopwatch whole(out), watch(out);
  SL_ASSIGN(const Rig rig, load_rig(installation, options));
  watch.lap("rig");
  std::vector<Camera> cameras(kCameras);
  SL_RETURN_IF_ERROR(for_each_index(executor, kCameras, [&](size_t i) -> Status {
    SL_ASSIGN(cameras[i], make_camera(installation, rig, CameraId(static_cast<uint32_t>(i))));
    return {};
  }));
  watch.lap("cameras");
  SL_ASSIGN(const auto search, ObjectSearch::create(installation, rig));
  watch.lap("search");
  const ObjectPoints points(installation, rig);
  watch.lap("points");
  whole.lap("all");
  return out;
}

int run(int argc, char** argv) {
  int runs = 3;
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--cold") {
      arguments.cold = true;
    } else if (word == "--serial") {
      arguments.serial = true;
    } else if (word == "--learn") {
      arguments.learn = true;
    } else if (word == "--runs" && i + 1 < argc) {
      runs = std::atoi(argv[++i]);
    } else {
      fmt::print(stderr, "usage: bench_startup [--cold] [--serial] [--runs N] [--learn]\n");
      return 2;
    }
  }
  const auto installation = make_installation(arguments.learn);
  if (!installation) {
    fmt::print(stderr, "bench_startup: {}\n", installation.error().message());
    return 1;
  }
  Json all = Json::array();
  for (int i = 0; i < runs; ++i) {
    auto once = start_once(*installation, arguments);
    if (!once) {
      fmt::print(stderr, "bench_startup: {}\n", once.error().message());
      return 1;
    }
    all.push_back(*std::move(once));
  }
  fmt::print("{}\n", Json{{"cameras", kCameras}, {"runs", all}}.dump(1));
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) { return sightline::run(argc, argv); }
