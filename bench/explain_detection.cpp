// SPDX-License-Identifier: Apache-2.0
// Where a search of the images loses the truth: for frames with known pose the rank of the first
// right pose after every stage of the search by contours, and what the true pose itself scores.
//   explain_detection RECORDING [--name OBJECT] [--object FILE] [--cameras A,B] [--every N]
//                     [--limit N] [--near M] [--far M]
// --object: look for another object than the recording's (false alarms). Right: 30 mm and 15 deg,
// up to the symmetries of the shape.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "figures.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/observe/detect/color_verifier.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using bench::cpu_ms;
using bench::quantile;

constexpr double kRightDistance = 0.03, kRightAngle = 0.26;

struct Arguments {
  std::filesystem::path recording, object;
  std::string cameras, name;
  size_t every = 1, limit = 1000;
  double nearest = 0, farthest = 0;
};

// What is searched, and its truth.
struct Task {
  std::shared_ptr<const Recording> recording;
  std::unique_ptr<ObjectDetector> detector;
  std::unique_ptr<ColorVerifier> colors;  // null: the mesh has none
  EvaluatedShape shape;
  double radius = 0;
  size_t cameras = 0;
  std::map<Time, Rigid3> truth;

  bool right(const Rigid3& truth_pose, const Rigid3& pose) const {
    const double distance = (truth_pose * shape.center - pose * shape.center).norm();
    const auto near = [&](const Rigid3& other) {
      return rotation_angle(other, pose) < kRightAngle;
    };
    return distance < kRightDistance &&
           (near(truth_pose) ||
            std::any_of(shape.symmetries.begin(), shape.symmetries.end(),
                        [&](const Rigid3& rotation) { return near(truth_pose * rotation); }));
  }
};

struct StageTotals {
  int searches = 0;
  std::vector<int> ranks;  // of the searches that still had a right pose
};

struct Totals {
  std::vector<std::string> order;
  std::map<std::string, StageTotals> stages;
  std::vector<double> cpu, right, wrong;  // ms; scores of the best pose
};

Result<std::map<Time, Rigid3>> read_poses(const Arguments& arguments, const std::string& object) {
  const auto keyframes = arguments.recording / "keyframes.csv";
  const bool sparse = std::filesystem::exists(keyframes);
  SL_ASSIGN(const auto rows, read_truth(sparse ? keyframes : arguments.recording / "truth.csv"));
  std::map<Time, Rigid3> truth;
  for (const TruthRow& row : rows) {
    if (row.object == object) truth[row.time] = row.world_from_object;
  }
  return truth;
}

Result<Task> prepare(const Arguments& arguments) {
  Task task;
  SL_ASSIGN(Recording opened, open_recording(arguments.recording));
  task.recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, recording_installation(arguments.recording));
  if (!arguments.name.empty()) {
    std::erase_if(installation.objects, [&](const ObjectConfig& object) {
      return object.description.name != arguments.name;
    });
  }
  if (installation.objects.empty()) {
    return make_error(ErrorCode::kInvalidInput, arguments.recording.string(), "no such object");
  }
  ObjectDescription& description = installation.objects.front().description;
  SL_ASSIGN(task.truth, read_poses(arguments, description.name));
  if (!arguments.object.empty()) {
    SL_ASSIGN(description, read_object_file(arguments.object));
  }
  description.modalities = {false, true, true, true};
  SL_ASSIGN(const Rig rig, load_rig(installation));
  const RigObject& object = rig.objects.front();
  task.shape = {object.views->center(), object.views->symmetry_rotations()};
  task.radius = object.views->radius();
  std::vector<DetectorCamera> cameras;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    const CameraConfig& camera = installation.cameras[i];
    const std::string list = "," + arguments.cameras + ",";
    if (arguments.cameras.empty() || list.find("," + camera.name + ",") != std::string::npos) {
      cameras.push_back({CameraId(static_cast<uint32_t>(i)), camera.calibration});
    }
  }
  task.cameras = cameras.size();
  if (object.samples) {
    SL_ASSIGN(task.colors, ColorVerifier::create(*object.samples, cameras));
  }
  DetectorOptions options;
  options.nearest = arguments.nearest;
  options.farthest = arguments.farthest;
  SL_ASSIGN(task.detector, ObjectDetector::create(ObjectId(0), object.views, cameras, options));
  return task;
}

// Of the mesh's colors with the images; 0 without colors.
double agreement(const Task& task, const Rigid3& pose, Time time) {
  return task.colors ? task.colors->correlation(pose, Vector6::Zero(), time) : 0;
}

void print_verdict(const Task& task, const Rigid3& truth, const DetectionTrace& trace,
                   Totals& totals) {
  const auto& poses = trace.stages.back().candidates;
  if (poses.empty()) return;
  const Rigid3& best = poses.front().world_from_object;
  const auto rival = std::find_if(poses.begin(), poses.end(), [&](const auto& pose) {
    return (pose.world_from_object * task.shape.center - best * task.shape.center).norm() >
           task.radius;
  });
  const bool is_right = task.right(truth, best);
  (is_right ? totals.right : totals.wrong).push_back(poses.front().score);
  fmt::print(" => {} {:.2f}, rival elsewhere {:.2f} of it", is_right ? "right" : "WRONG",
             poses.front().score, rival == poses.end() ? 0.0 : rival->score / poses.front().score);
  if (task.colors) {
    fmt::print("; colors: truth {:.2f}, best {:.2f}, rival {:.2f}",
               agreement(task, truth, trace.time), agreement(task, best, trace.time),
               rival == poses.end() ? 0.0 : agreement(task, rival->world_from_object, trace.time));
  }
  fmt::print("\n");
}

void explain(Task& task, Totals& totals) {
  DetectionTrace trace;
  trace.clock = cpu_ms;
  const double start = cpu_ms();
  task.detector->explain(trace);
  const double cpu = cpu_ms() - start;
  const auto truth = task.truth.find(trace.time);
  if (truth == task.truth.end()) return;
  totals.cpu.push_back(cpu);
  const PoseAssessment at = task.detector->assess(truth->second);
  fmt::print(
      "{:.3f} s: truth: response {:.2f} spread {:.2f} sharp, edges {:.2f}, contrast {:.2f}, "
      "contour {:.2f}, evidence {:.2f};",
      to_seconds(trace.time - Time{}), at.spread_response, at.sharp_response, at.edge_share,
      at.contrast, at.contour, at.evidence);
  for (const auto& stage : trace.stages) {
    const auto& poses = stage.candidates;
    const auto first = std::find_if(poses.begin(), poses.end(), [&](const auto& pose) {
      return task.right(truth->second, pose.world_from_object);
    });
    const auto rank = static_cast<int>(first - poses.begin());
    if (!totals.stages.contains(stage.name)) totals.order.push_back(stage.name);
    StageTotals& sum = totals.stages[stage.name];
    ++sum.searches;
    if (first != poses.end()) sum.ranks.push_back(rank);
    fmt::print(" {} {} of {} ({:.0f} ms)", stage.name,
               first == poses.end() ? "-" : fmt::format("{}", rank), poses.size(),
               stage.at_ms - start);
  }
  print_verdict(task, truth->second, trace, totals);
  std::fflush(stdout);
}

Result<Totals> play(const Arguments& arguments) {
  SL_ASSIGN(Task task, prepare(arguments));
  SL_ASSIGN(auto replay, VirtualReplay::open(task.recording));
  Totals totals;
  size_t sets = 0, known = 0, done = 0;
  while (done < arguments.limit) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    for (const FramePtr& frame : *frames) {
      task.detector->add_frame(frame->info().camera, *frame);
      if (task.colors) task.colors->add_frame(frame->info().camera, *frame);
    }
    const bool has_truth = task.truth.contains(frames->back()->info().capture);
    if (++sets < task.cameras || !has_truth || known++ % arguments.every != 0) continue;
    explain(task, totals);
    ++done;
  }
  return totals;
}

void print(Totals totals) {
  for (const std::string& name : totals.order) {
    StageTotals& stage = totals.stages[name];
    std::sort(stage.ranks.begin(), stage.ranks.end());
    fmt::print("{:9} right pose among them in {} of {}; ranks:", name, stage.ranks.size(),
               stage.searches);
    for (const int rank : stage.ranks) fmt::print(" {}", rank);
    fmt::print("\n");
  }
  fmt::print(
      "best is right in {} (scores {:.2f} to {:.2f}), wrong in {} ({:.2f} to {:.2f}); CPU of a "
      "search: median {:.0f} ms\n",
      totals.right.size(), quantile(totals.right, 0), quantile(totals.right, 1),
      totals.wrong.size(), quantile(totals.wrong, 0), quantile(totals.wrong, 1),
      quantile(totals.cpu, 0.5));
}

int run(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    const auto number = static_cast<size_t>(std::max(1, std::atoi(value)));
    const bool takes_value = argument.starts_with("--");
    if (argument == "--every") arguments.every = number;
    if (argument == "--limit") arguments.limit = number;
    if (argument == "--near") arguments.nearest = std::atof(value);
    if (argument == "--far") arguments.farthest = std::atof(value);
    if (argument == "--cameras") arguments.cameras = value;
    if (argument == "--name") arguments.name = value;
    if (argument == "--object") arguments.object = value;
    if (!takes_value) arguments.recording = argument;
    if (takes_value) ++i;
  }
  if (arguments.recording.empty()) {
    fmt::print(stderr,
               "usage: explain_detection RECORDING [--name OBJECT] [--object FILE] [--cameras A,B] "
               "[--every N] [--limit N] [--near M] [--far M]\n");
    return 2;
  }
  auto totals = play(arguments);
  if (!totals) {
    fmt::print(stderr, "explain_detection: {}\n", totals.error().message());
    return exit_code(totals.error());
  }
  print(*std::move(totals));
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) { return sightline::run(argc, argv); }
