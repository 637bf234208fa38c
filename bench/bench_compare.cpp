// SPDX-License-Identifier: Apache-2.0
// The same object drawn into the same frames by Sightline and by what else there is: CPU
// milliseconds a frame of the whole process, best of several rounds. `bench_compare [--json]`.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "compare.hpp"
#include "sightline/base/time.hpp"
#include "sightline/render/mesh/level_of_detail.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/overlay/camera_renderer.hpp"
#include "sightline/render/raster/ray_table.hpp"

namespace sightline::compare {
namespace {

constexpr double kRadius = 0.1;
constexpr size_t kPoses = 32;

Scene make_scene(int height) {
  CameraModel::Parameters p;
  p.width = height * 16 / 9;
  p.height = height;
  p.fx = p.fy = 900;
  p.cx = 0.5 * p.width;
  p.cy = 0.5 * p.height;
  p.distortion = {-0.10, 0.05, 3e-4, -2e-4};
  Scene scene{CameraModel::create(p, "bench").value(),
              make_bumpy_torus(10'000, static_cast<float>(kRadius)),
              {},
              std::make_shared<Image>(p.width, p.height)};
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 3).normalized();
  for (size_t k = 0; k < kPoses; ++k) {
    const double step = static_cast<double>(k);
    scene.poses.emplace_back(Eigen::Quaterniond(Eigen::AngleAxisd(0.2 * step, axis)),
                             Eigen::Vector3d(0.01 * std::sin(step), 0, 900 * 2 * kRadius / 256));
  }
  return scene;
}

Contestant sightline_contestant(const Scene& scene, const char* name, const OverlayStyle& style,
                                RasterChoice backend) {
  RenderOptions options;
  options.backend = backend;
  const auto mesh = std::make_shared<const RenderMesh>(make_render_mesh(scene.mesh));
  auto created = CameraRenderer::create(
      {"bench", scene.camera, Rigid3(), 0.3}, CameraId(0),
      {{ObjectId(0), "torus", mesh, style, std::make_shared<const LevelOfDetail>(mesh)}},
      RayTable::build(scene.camera), nullptr, options);
  if (!created) return {name, {}, created.error().message()};
  struct State {
    std::unique_ptr<CameraRenderer> renderer;
    std::vector<PoseTrackPtr> tracks;
    std::vector<PoseAt> poses;
  };
  const auto state = std::make_shared<State>();
  state->renderer = *std::move(created);
  for (const Rigid3& pose : scene.poses) {
    PoseEstimate estimate;
    estimate.state = TrackState::kTracking;
    estimate.world_from_object = pose;
    estimate.covariance.diagonal().setConstant(1e-6);
    state->tracks.push_back(
        std::make_shared<PoseTrack>(ObjectId(0), std::vector{estimate}, MotionNoise{}));
  }
  return {
      name,
      [state, frame = scene.frame](size_t k) {
        state->renderer->draw(frame->mutable_view(), Time{}, {&state->tracks[k], 1}, state->poses);
      },
      ""};
}

double cost_ms(const Contestant& contestant) {
  constexpr int kRounds = 5;
  double best = 1e9;
  for (size_t k = 0; k < kPoses; ++k) contestant.frame(k);
  for (int round = 0; round < kRounds; ++round) {
    const double start = process_cpu_ms();
    for (size_t k = 0; k < kPoses; ++k) contestant.frame(k);
    best = std::min(best, (process_cpu_ms() - start) / static_cast<double>(kPoses));
  }
  return best;
}

OverlayStyle rich() {
  OverlayStyle style;
  style.box3d = true;
  return style;
}

OverlayStyle all() {
  OverlayStyle style = rich();
  for (const std::string_view name : style_names()) *style_flag(style, name) = true;
  return style;
}

void compare(int height, nlohmann::json& rows) {
  const Scene scene = make_scene(height);
  std::vector<Contestant> contestants;
  contestants.push_back(sightline_contestant(
      scene, "Sightline: fill, outline, circle, 3D box, label", rich(), RasterChoice::kCpu));
  contestants.push_back(
      sightline_contestant(scene, "Sightline: every style at once", all(), RasterChoice::kCpu));
  contestants.push_back(sightline_contestant(scene, "Sightline: as the first, backend \"egl\"",
                                             rich(), RasterChoice::kEgl));
  for (Contestant& each : opencv_contestants(scene)) contestants.push_back(std::move(each));
  contestants.push_back(gl_contestant(scene));
  const double reference = cost_ms(contestants.front());
  const auto row = [&](const std::string& name, std::optional<double> ms, const std::string& note) {
    nlohmann::json line{{"height", height}, {"what", name}};
    if (ms) {
      line["cpu_ms"] = *ms;
      line["ratio"] = *ms / reference;
    } else {
      line["note"] = note;
    }
    rows.push_back(line);
  };
  for (const Contestant& each : contestants)
    row(each.name, each.frame ? std::optional(cost_ms(each)) : std::nullopt, each.note);
  for (const ElementCost& each : gstreamer_costs(scene.camera.width(), height, 100))
    row(each.name, each.cpu_ms, "element not installed");
}

void print_table(const nlohmann::json& rows) {
  std::printf("| image | what | CPU ms a frame | times the first |\n| --- | --- | --- | --- |\n");
  for (const auto& row : rows) {
    const std::string what = row["what"];
    const int height = row["height"];
    if (row.contains("note")) {
      std::printf("| %dp | %s | %s | |\n", height, what.c_str(),
                  row["note"].get<std::string>().c_str());
    } else {
      std::printf("| %dp | %s | %.2f | %.1f |\n", height, what.c_str(), row["cpu_ms"].get<double>(),
                  row["ratio"].get<double>());
    }
  }
}

}  // namespace
}  // namespace sightline::compare

int main(int argc, char** argv) {
  nlohmann::json rows = nlohmann::json::array();
  for (const int height : {720, 1080}) sightline::compare::compare(height, rows);
  if (argc > 1 && std::strcmp(argv[1], "--json") == 0) {
    std::printf("%s\n", rows.dump(2).c_str());
  } else {
    sightline::compare::print_table(rows);
  }
  return 0;
}
