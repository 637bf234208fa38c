// SPDX-License-Identifier: Apache-2.0
// How well one search of the images finds an object by its trained features (sightline train):
// every set of frames of a recording with truth is searched by itself, as if nothing were known.
//   detect_recording RECORDING FEATURES [--from S] [--to S] [--cameras A,B] [--every N] [-v]
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "figures.hpp"
#include "sightline/observe/detect/detection_policy.hpp"
#include "sightline/observe/detect/object_detector.hpp"
#include "sightline/observe/features/feature_detector.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/rig.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using bench::quantile;

struct Arguments {
  std::filesystem::path recording, features;
  double from = 0, to = 1e9;
  std::string cameras;
  size_t every = 1;
  bool verbose = false;
};

struct Score {
  size_t sets = 0, found = 0, several = 0, without_truth_pose = 0, wrong = 0;
  size_t both = 0, right_first = 0;  // sets in which right and wrong poses were proposed
  size_t most_wrong = 0;             // matches of a wrong one
  std::vector<double> mm, deg, squared, cpu;
};

// What the observations say together of the pose of the last of them.
double error_over_covariance(const Detection& detection, const Rigid3& truth) {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  for (const Observation& observation : detection.observations) {
    for (const PoseTermPtr& term : observation.terms) {
      const LinearizedTerm at = term->linearize(truth);
      information += at.information;
      gradient += at.gradient;
    }
  }
  return gradient.dot(information.ldlt().solve(gradient));
}

std::vector<DetectorCamera> chosen_cameras(const Installation& installation,
                                           const std::string& names) {
  std::vector<DetectorCamera> cameras;
  for (size_t i = 0; i < installation.cameras.size(); ++i) {
    const std::string& name = installation.cameras[i].name;
    const bool chosen =
        names.empty() || ("," + names + ",").find("," + name + ",") != std::string::npos;
    if (!chosen) continue;
    cameras.push_back({CameraId(static_cast<uint32_t>(i)), installation.cameras[i].calibration});
  }
  return cameras;
}

Result<std::map<Time, Rigid3>> truth_of(const Recording& recording, const std::string& object) {
  if (!recording.truth) {
    return make_error(ErrorCode::kInvalidInput, recording.path.string(), "has no truth.csv");
  }
  SL_ASSIGN(const auto rows, read_truth(*recording.truth));
  std::map<Time, Rigid3> truth;
  for (const TruthRow& row : rows) {
    if (row.object == object) truth[row.time] = row.world_from_object;
  }
  return truth;
}

bool is_right(const PoseError& error) { return error.mm < 20 && error.deg < 6; }

// Proposals are sorted, most evidence first.
void rank(const PoseProposals& proposals, const Rigid3& truth, Score& score) {
  bool right = false, wrong = false, first = false;
  for (const ProposedPose& pose : proposals.poses) {
    const PoseError error = pose_error(truth, pose.world_from_object);
    const bool turned = error.deg > 12;
    first |= is_right(error) && !wrong;
    right |= is_right(error);
    wrong |= turned;
    if (turned) score.most_wrong = std::max(score.most_wrong, pose.matches);
  }
  score.both += right && wrong;
  score.right_first += right && wrong && first;
}

double agreement(const ColorVerifier* colors, const ProposedPose& pose, Time time) {
  return colors == nullptr ? 0 : colors->correlation(pose.world_from_object, pose.twist, time);
}

// Counts what was found, and says it in words.
std::string judge(const Detection& found, const Rigid3& truth, Score& score) {
  const PoseError error = pose_error(truth, found.poses.front().world_from_object);
  const double squared = error_over_covariance(found, truth);
  if (found.poses.size() == 1) {
    ++score.found;
    score.mm.push_back(error.mm);
    score.deg.push_back(error.deg);
    score.squared.push_back(squared);
    score.wrong += !is_right(error);
  } else {
    ++score.several;
    const bool there =
        std::any_of(found.poses.begin(), found.poses.end(), [&](const DetectedPose& pose) {
          return is_right(pose_error(truth, pose.world_from_object));
        });
    score.without_truth_pose += !there;
  }
  return fmt::format(
      "{} pose(s), {} camera(s), evidence {:.2f} (runner-up {:.2f}), {:.2f} mm {:.2f} deg, "
      "chi-square {:.1f}",
      found.poses.size(), found.observations.size(), found.poses[0].evidence, found.runner_up,
      error.mm, error.deg, squared);
}

Result<Score> play(const Arguments& arguments) {
  SL_ASSIGN(Recording opened, open_recording(arguments.recording));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, recording_installation(arguments.recording));
  ObjectDescription& description = installation.objects.front().description;
  description.modalities = {false, true, true, true};
  description.features = arguments.features;
  SL_ASSIGN(const auto truth, truth_of(*recording, description.name));
  SL_ASSIGN(const Rig rig, load_rig(installation));
  const RigObject& object = rig.objects.front();
  const auto cameras = chosen_cameras(installation, arguments.cameras);
  SL_ASSIGN(auto finder, FeatureDetector::create(object.features, cameras));
  DetectorOptions options = installation.detect.detector;
  options.volume = installation.scene.volume;
  const DetectionPolicy policy(object.shape_symmetry, options.accept, object.printed);
  std::unique_ptr<ColorVerifier> colors;
  if (object.samples) {
    SL_ASSIGN(colors, ColorVerifier::create(*object.samples, cameras));
  }
  SL_ASSIGN(auto detector,
            ObjectDetector::create(ObjectId(0), object.views, cameras,
                                   DetectionPolicy::detector_options(options, colors != nullptr)));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording, {}, time_offsets(*recording, installation),
                                             axis_histories(*recording, installation)));
  Score score;
  std::optional<Time> start;
  for (size_t set = 0;; ++set) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    const Time time = frames->front()->info().capture;
    if (!start) start = time;
    const double seconds = to_seconds(time - *start);
    for (const FramePtr& frame : *frames) {
      finder->add_frame(frame->info().camera, *frame);
      detector->add_frame(frame->info().camera, *frame);
      if (colors) colors->add_frame(frame->info().camera, *frame);
    }
    if (seconds < arguments.from || seconds > arguments.to || set % arguments.every != 0) continue;
    const double before = process_cpu_ms();
    const PoseProposals proposals = finder->propose();
    const PoseProposals confirmed = policy.confirm(proposals, colors.get());
    const Detection found = policy.by_features(detector->judge(confirmed), colors.get());
    score.cpu.push_back(process_cpu_ms() - before);
    ++score.sets;
    std::string line = fmt::format("{:6.3f} s: ", seconds);
    if (found.poses.empty()) {
      line += fmt::format("not found ({} proposals, best {:.2f})", proposals.poses.size(),
                          proposals.poses.empty() ? 0 : proposals.poses[0].evidence);
    } else if (const auto at = truth.find(found.time); at != truth.end()) {
      line += judge(found, at->second, score);
    }
    const auto there = truth.find(proposals.time);
    if (there != truth.end()) rank(proposals, there->second, score);
    for (const ProposedPose& pose : confirmed.poses) {
      line += fmt::format("; {} matches, evidence {:.2f}, colors {:.2f}", pose.matches,
                          pose.evidence, agreement(colors.get(), pose, proposals.time));
      if (there == truth.end()) continue;
      const PoseError error = pose_error(there->second, pose.world_from_object);
      line += fmt::format(", {:.1f} mm {:.1f} deg", error.mm, error.deg);
    }
    for (const DetectedPose& pose : found.poses) line += fmt::format(" d{:.2f}", pose.evidence);
    if (arguments.verbose) fmt::print("{}\n", line);
  }
  return score;
}

int run(int argc, char** argv) {
  Arguments arguments;
  std::vector<std::string> named;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    if (argument == "-v") {
      arguments.verbose = true;
    } else if (argument == "--from") {
      arguments.from = std::atof(value), ++i;
    } else if (argument == "--to") {
      arguments.to = std::atof(value), ++i;
    } else if (argument == "--cameras") {
      arguments.cameras = value, ++i;
    } else if (argument == "--every") {
      arguments.every = static_cast<size_t>(std::max(1, std::atoi(value))), ++i;
    } else {
      named.push_back(argument);
    }
  }
  if (named.size() != 2) {
    fmt::print(stderr,
               "usage: detect_recording RECORDING FEATURES [--from S] [--to S] "
               "[--cameras A,B] [--every N] [-v]\n");
    return 2;
  }
  arguments.recording = named[0];
  arguments.features = named[1];
  const auto score = play(arguments);
  if (!score) {
    fmt::print(stderr, "detect_recording: {}\n", score.error().message());
    return exit_code(score.error());
  }
  fmt::print(
      "found in {} of {} searches, wrong (20 mm, 6 deg) {}; several poses in {}, without the right "
      "one "
      "{}\n{:.2f} mm {:.2f} deg (median), {:.2f} mm {:.2f} deg (95 %); chi-square median {:.1f} "
      "(5.3 expected), 90 % {:.1f} (10.6)\nthe right pose before one turned by 12 deg and more in "
      "{} of {} sets that "
      "propose both; {} matches of such a one at most\nCPU of a search: median {:.0f} ms\n",
      score->found, score->sets, score->wrong, score->several, score->without_truth_pose,
      quantile(score->mm, 0.5), quantile(score->deg, 0.5), quantile(score->mm, 0.95),
      quantile(score->deg, 0.95), quantile(score->squared, 0.5), quantile(score->squared, 0.9),
      score->right_first, score->both, score->most_wrong, quantile(score->cpu, 0.5));
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) { return sightline::run(argc, argv); }
