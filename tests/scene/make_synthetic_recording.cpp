// SPDX-License-Identifier: Apache-2.0
// Records a made-up installation, with truth, for `sightline replay` and `sightline evaluate`.
//   make_synthetic_recording OUT [--shape creature] [--printed] [--cameras 2] ... (see --help)
#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <numbers>

#include "support/scene_recording.hpp"
#include "support/scene_shapes.hpp"

namespace {

using namespace sightline;
using namespace sightline::test;

struct Choice {
  std::string out, shape = "creature", motion = "smooth";
  size_t faces = 5000;
  bool printed = false, free_running = false;
  int cameras = 2;
  double spread_deg = 60, step_mm = 7.8, turn_deg = 3.65, seconds = 4;
  double noise = 3, blur = 0.7, shutter_ms = 0, skew_ms = 0, similarity = 0;
  std::vector<double> hide;
  int hidden_camera = -1;
  double rate = 30;
  int objects = 1;
  double distance = 0.7;
  int knock_camera = -1;
  double knock_at = 0, knock_deg = 0, knock_mm = 0;
  uint64_t seed = 1;
};

Result<TriangleMesh> mesh_of(const Choice& choice) {
  if (choice.shape == "creature") return make_creature(choice.faces);
  if (choice.shape == "truck") return make_truck();
  if (choice.shape == "bottle") return make_bottle(choice.faces);
  if (choice.shape == "bracket") return make_bracket();
  if (choice.shape == "carton") return make_carton();
  return make_error(ErrorCode::kInvalidInput, "--shape", "there is no shape '{}'", choice.shape);
}

Result<SceneRigOptions> rig_of(const Choice& choice) {
  SceneRigOptions options;
  SL_ASSIGN(TriangleMesh mesh, mesh_of(choice));
  options.shape = std::make_shared<const RayMesh>(std::move(mesh));
  options.name = choice.shape;
  options.paint.kind = choice.printed            ? Paint::Kind::kPrinted
                       : choice.shape == "truck" ? Paint::Kind::kFaces
                                                 : Paint::Kind::kPlain;
  options.azimuths_deg.clear();
  for (int i = 0; i < choice.cameras; ++i) {
    options.azimuths_deg.push_back(choice.spread_deg * (i - 0.5 * (choice.cameras - 1)));
    if (choice.free_running) options.phases.push_back(static_cast<double>(i) / choice.cameras);
    options.skews.push_back(i == 1 ? from_seconds(1e-3 * choice.skew_ms) : Duration(0));
  }
  options.distance = choice.distance;
  options.duration = from_seconds(choice.seconds);
  options.seed = choice.seed;
  options.rate_hz = choice.rate;
  options.knock.camera = std::min(choice.knock_camera, choice.cameras - 1);
  options.knock.from = from_seconds(choice.knock_at);
  options.knock.by[1] = choice.knock_deg * std::numbers::pi / 180;
  options.knock.by[3] = 1e-3 * choice.knock_mm;
  options.blur_px = choice.blur;
  options.sensor.read_noise = choice.noise;
  options.sensor.shutter = 1e-3 * choice.shutter_ms;
  options.backdrop.seed = static_cast<uint32_t>(choice.seed);
  options.backdrop.similarity = static_cast<float>(choice.similarity);
  options.backdrop.like = options.paint.color;
  SceneSteps steps;
  steps.step = 1e-3 * choice.step_mm;
  steps.turn = choice.turn_deg * std::numbers::pi / 180;
  steps.seed = choice.seed;
  options.path = choice.motion == "erratic" ? erratic_path(steps, options.duration)
                                            : smooth_path(steps, options.duration);
  if (choice.hide.size() == 2) {
    options.cards.push_back(
        {choice.hidden_camera, from_seconds(choice.hide[0]), from_seconds(choice.hide[1])});
  }
  return options;
}

// Eight places on a table, the middle one free; the first two objects are alike.
struct Neighbor {
  const char* shape;
  double x, y;  // [m]
};
constexpr std::array<Neighbor, 8> kNeighbors = {{{"creature", -0.19, 0},
                                                 {"creature", 0.19, 0},
                                                 {"truck", 0, 0.2},
                                                 {"bracket", 0, -0.2},
                                                 {"bottle", -0.21, 0.21},
                                                 {"column", 0.21, -0.21},
                                                 {"truck", 0.22, 0.22},
                                                 {"bracket", -0.21, -0.21}}};

Result<RecordedBody> neighbor(const Choice& choice, size_t i) {
  const Neighbor& place = kNeighbors.at(i);
  Choice own = choice;
  own.shape = place.shape;
  RecordedBody out;
  if (own.shape == "column") {
    out.shape = std::make_shared<const RayMesh>(
        make_column_with_box({0.025f, 0, 0.01f}, {0.03f, 0.012f, 0.05f}));
  } else {
    SL_ASSIGN(TriangleMesh mesh, mesh_of(own));
    out.shape = std::make_shared<const RayMesh>(std::move(mesh));
  }
  out.name = "object" + std::to_string(i + 1);
  out.symmetry = own.shape == "bottle" ? Symmetry::kAxis : Symmetry::kNone;
  SceneSteps steps;
  steps.step = 1e-3 * choice.step_mm;
  steps.turn = choice.turn_deg * std::numbers::pi / 180;
  steps.half_room = {0.02, 0.02, 0.03};
  steps.middle = {place.x, place.y, 0};
  steps.seed = choice.seed + i;
  out.path = smooth_path(steps, from_seconds(choice.seconds));
  return out;
}

Paint paint_of(const std::string& shape, size_t i) {
  const std::array<Eigen::Vector3f, 3> colors = {
      Eigen::Vector3f{0.45f, 0.28f, 0.10f}, {0.10f, 0.25f, 0.45f}, {0.30f, 0.06f, 0.08f}};
  Paint out;
  out.kind = shape == "truck" ? Paint::Kind::kFaces : Paint::Kind::kPlain;
  out.color = colors[i < 2 ? 0 : i % colors.size()];
  return out;
}

// The object of the usual recording is the first of several.
Status record_several(const Choice& choice, SceneRigOptions options) {
  std::vector<RecordedBody> others;
  for (size_t i = 0; i < static_cast<size_t>(choice.objects); ++i) {
    SL_ASSIGN(RecordedBody body, neighbor(choice, i));
    const Paint paint = paint_of(kNeighbors.at(i).shape, i);
    if (i == 0) {
      options.shape = body.shape, options.path = body.path, options.name = body.name;
      options.paint = paint;
      continue;
    }
    options.others.push_back(
        {body.shape, paint, [path = body.path](Time time) { return std::optional(path(time)); }});
    others.push_back(std::move(body));
  }
  return write_scene_recording(SceneRig(options), choice.out, Symmetry::kNone, others);
}

Status record(const Choice& choice) {
  SL_ASSIGN(const SceneRigOptions options, rig_of(choice));
  if (choice.objects > 1) return record_several(choice, options);
  const Symmetry symmetry = choice.shape == "bottle" ? Symmetry::kAxis : Symmetry::kNone;
  return write_scene_recording(SceneRig(options), choice.out, symmetry);
}

}  // namespace

int main(int argc, char** argv) {
  Choice choice;
  CLI::App app{"Records a made-up installation with ground truth"};
  app.add_option("OUT", choice.out, "folder to make")->required();
  app.add_option("--shape", choice.shape, "creature, truck, bottle, bracket or carton");
  app.add_option("--faces", choice.faces, "of creature and bottle");
  app.add_flag("--printed", choice.printed, "with texture");
  app.add_option("--objects", choice.objects, "several beside each other, the first two alike")
      ->check(CLI::Range(1, 8));
  app.add_option("--distance", choice.distance, "of the cameras [m]")->check(CLI::Range(0.3, 5.0));
  app.add_option("--motion", choice.motion, "smooth or erratic")
      ->check(CLI::IsMember({"smooth", "erratic"}));
  app.add_option("--step-mm", choice.step_mm, "per frame");
  app.add_option("--turn-deg", choice.turn_deg, "per frame");
  app.add_option("--cameras", choice.cameras, "how many")->check(CLI::Range(1, 8));
  app.add_option("--spread-deg", choice.spread_deg, "between neighboring cameras");
  app.add_flag("--free-running", choice.free_running, "cameras evenly out of step");
  app.add_option("--skew-ms", choice.skew_ms, "unknown stamp error of the second camera");
  app.add_option("--seconds", choice.seconds, "length")->check(CLI::Range(0.05, 600.0));
  app.add_option("--noise", choice.noise, "levels of 255");
  app.add_option("--blur", choice.blur, "of the lens, one sigma [px]");
  app.add_option("--shutter-ms", choice.shutter_ms, "motion blur");
  app.add_option("--similarity", choice.similarity, "0..1: the room in the object's color");
  app.add_option("--hide", choice.hide, "FROM TO [s]: a card before the camera")->expected(2);
  app.add_option("--hidden-camera", choice.hidden_camera, "which (default: every camera)");
  app.add_option("--rate", choice.rate, "frames per second")->check(CLI::Range(1.0, 120.0));
  app.add_option("--knock-camera", choice.knock_camera, "that is moved: its number");
  app.add_option("--knock-at", choice.knock_at, "when [s]");
  app.add_option("--knock-deg", choice.knock_deg, "turned about its vertical axis");
  app.add_option("--knock-mm", choice.knock_mm, "shifted to its right");
  app.add_option("--seed", choice.seed, "of everything that is random");
  CLI11_PARSE(app, argc, argv);
  const Status done = record(choice);
  if (done) return 0;
  std::fprintf(stderr, "make_synthetic_recording: %s\n", done.error().message().c_str());
  return exit_code(done.error());
}
