// SPDX-License-Identifier: Apache-2.0
// The basin of convergence of a look: from how far off it leads back to the object. In recordings
// with truth and by one camera alone: the tracker knows the object's colors from where it was in
// the frame before; then it is told a pose that is off by a step in a random direction, and the
// covariance of such steps. Prints a Markdown table by object and size of the step: looks whose fit
// is within 15 % of the diameter and 10 degrees of the truth (up to the symmetry of the shape), and
// in brackets those that fit something else.
//   basin [--every SETS] RECORDING ...
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <charconv>
#include <numbers>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

#include "claims/truth_recording.hpp"
#include "sightline/pipeline/tracking_chain.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kRightShare = 0.15, kRightTurn = 10 * kDegree;

struct Step {
  double share;  ///< of the object's diameter
  double turn;   ///< [rad]
};
// An object of 130 mm moves by 31 mm + 15 deg at the fourth.
constexpr std::array<Step, 6> kSteps{{{0.03, 2 * kDegree},
                                      {0.06, 4 * kDegree},
                                      {0.12, 7.5 * kDegree},
                                      {0.24, 15 * kDegree},
                                      {0.35, 22 * kDegree},
                                      {0.48, 29 * kDegree}}};

struct Tally {
  int right = 0, wrong = 0;
};

struct Figures {
  int looks = 0;
  std::array<Tally, kSteps.size()> steps;
};

PoseEstimate tracked(ObjectId object, Time time, CameraId camera, const Rigid3& pose,
                     const Matrix6& covariance) {
  PoseEstimate out;
  out.object = object;
  out.time = out.last_measured = time;
  out.state = TrackState::kTracking;
  out.world_from_object = pose;
  out.covariance.diagonal().setConstant(1e-4);
  out.covariance.topLeftCorner<6, 6>() = covariance;
  out.cameras = camera_bit(camera);
  return out;
}

// The most probable pose, given where it was looked for and what was measured.
Rigid3 fitted(const Observation& seen, const Rigid3& start, const Matrix6& covariance) {
  constexpr int kRounds = 8;
  Rigid3 pose = start;
  const Matrix6 prior = covariance.inverse();
  for (int round = 0; round < kRounds; ++round) {
    Matrix6 information = prior;
    Vector6 gradient = prior * difference(start, pose);
    for (const PoseTermPtr& term : seen.terms) {
      const LinearizedTerm at = term->linearize(pose);
      information += at.information;
      gradient += at.gradient;
    }
    pose = pose * Rigid3::exp(-information.ldlt().solve(gradient));
  }
  return pose;
}

class Basin {
 public:
  static Result<std::unique_ptr<Basin>> create(const std::filesystem::path& path, int every) {
    std::unique_ptr<Basin> run(new Basin());
    run->every_ = every;
    SL_ASSIGN(run->in_, bench::open_truth_recording(path));
    std::vector<CameraId> cameras;
    for (uint32_t i = 0; i < run->in_.installation.cameras.size(); ++i) cameras.emplace_back(i);
    SL_ASSIGN(run->chain_,
              TrackingChain::create(run->in_.installation, run->in_.rig, cameras, nullptr));
    run->before_.resize(cameras.size());
    run->figures_.resize(run->in_.rig.objects.size());
    return run;
  }

  Status play() {
    SL_ASSIGN(auto replay,
              VirtualReplay::open(in_.recording, {}, time_offsets(*in_.recording, in_.installation),
                                  axis_histories(*in_.recording, in_.installation)));
    for (int set = 0;; ++set) {
      SL_ASSIGN(const auto frames, replay->next());
      if (!frames) return {};
      for (const FramePtr& frame : *frames) {
        FramePtr& before = before_[frame->info().camera.index()];
        for (size_t i = 0; before && set % every_ == 0 && i < figures_.size(); ++i) {
          try_steps(i, before, frame);
        }
        before = frame;
      }
    }
  }

  void print(std::array<double, kSteps.size()>& sums, int& objects) const {
    for (size_t i = 0; i < figures_.size(); ++i) {
      const Figures& f = figures_[i];
      fmt::print("| {}: {} | {} |", in_.recording->name, in_.rig.objects[i].named.name, f.looks);
      for (size_t s = 0; s < kSteps.size(); ++s) {
        const double percent = 100.0 / std::max(1, f.looks);
        fmt::print(" {:.0f} ({:.0f}) |", percent * f.steps[s].right, percent * f.steps[s].wrong);
        sums[s] += percent * f.steps[s].right;
      }
      fmt::print("\n");
      ++objects;
    }
  }

 private:
  Basin() = default;

  // What the tracker makes of a frame with a track that ends with such estimates.
  Observation look(const Frame& frame, size_t object, std::vector<PoseEstimate> history) {
    ObjectTracker& tracker = chain_->observer(frame.info().camera)->tracker();
    const ObjectId id(static_cast<uint32_t>(object));
    const PoseTrackPtr track =
        std::make_shared<const PoseTrack>(id, std::move(history), MotionNoise());
    std::vector<Observation> out;
    tracker.step(frame, {&track, 1}, out);
    const auto mine =
        std::find_if(out.begin(), out.end(), [id](const Observation& o) { return o.object == id; });
    return mine != out.end() ? std::move(*mine) : Observation();
  }

  void try_steps(size_t object, const FramePtr& before, const FramePtr& frame) {
    Figures& figures = figures_[object];
    constexpr Duration kGap = std::chrono::milliseconds(50);
    const auto was = truth_at(in_.truth[object], before->info().capture, kGap);
    const auto is = truth_at(in_.truth[object], frame->info().capture, kGap);
    const CameraId camera = frame->info().camera;
    if (!was || !is || !inside(camera, *is * views(object).center())) return;
    const ObjectId id(static_cast<uint32_t>(object));
    const Rigid3 camera_from_world =
        in_.installation.cameras[camera.index()].calibration.world_from_camera.inverse();
    const PoseEstimate sure =
        tracked(id, before->info().capture, camera, *was, Matrix6::Identity() * 1e-6);
    for (size_t s = 0; s < kSteps.size(); ++s) {
      ObjectTracker& tracker = chain_->observer(camera)->tracker();
      tracker.note_found({id, before, camera_from_world * *was, true});
      const bool shown = !look(*before, object, {sure}).terms.empty();
      if (s == 0 && !shown) return;
      if (s == 0) ++figures.looks;
      const auto [start, covariance] = off_by(kSteps[s], *is, views(object));
      const Observation seen = look(
          *frame, object, {sure, tracked(id, frame->info().capture, camera, start, covariance)});
      if (seen.terms.empty()) continue;
      const bool right = is_right(object, fitted(seen, start, covariance), *is);
      ++(right ? figures.steps[s].right : figures.steps[s].wrong);
    }
  }

  std::pair<Rigid3, Matrix6> off_by(const Step& step, const Rigid3& pose,
                                    const ViewpointModel& model) {
    std::normal_distribution<double> normal;
    const auto direction = [&] {
      return Eigen::Vector3d(normal(random_), normal(random_), normal(random_)).normalized();
    };
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(step.turn, direction()));
    const double shift = step.share * 2 * model.radius();
    Rigid3 start = pose * Rigid3(turn, model.center() - turn * model.center());
    start.translation += shift * direction();
    Matrix6 covariance = Matrix6::Zero();
    covariance.diagonal().head<3>().setConstant(step.turn * step.turn / 3);
    covariance.diagonal().tail<3>().setConstant(shift * shift / 3);
    return {start, covariance};
  }

  bool is_right(size_t object, const Rigid3& pose, const Rigid3& truth) const {
    const ViewpointModel& model = views(object);
    return (pose * model.center() - truth * model.center()).norm() <=
               kRightShare * 2 * model.radius() &&
           model.angle_up_to_symmetry(pose, truth) <= kRightTurn;
  }

  bool inside(CameraId camera, const Eigen::Vector3d& point) const {
    const CalibratedCamera& calibration = in_.installation.cameras[camera.index()].calibration;
    const auto pixel = calibration.model.project(calibration.world_from_camera.inverse() * point);
    const CameraModel::Parameters& p = calibration.model.parameters();
    return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < p.width &&
           pixel->y() < p.height;
  }

  const ViewpointModel& views(size_t object) const { return *in_.rig.objects[object].views; }

  int every_ = 1;
  bench::TruthRecording in_;
  std::unique_ptr<TrackingChain> chain_;
  std::vector<FramePtr> before_;  // by camera
  std::vector<Figures> figures_;  // by object
  std::mt19937 random_{1};
};

int usage(std::string_view problem) {
  fmt::print(stderr, "basin: {}\nusage: basin [--every SETS] RECORDING ...\n", problem);
  return 2;
}

int run(std::vector<std::string_view> arguments) {
  int every = 4;
  if (arguments.size() > 1 && arguments[0] == "--every") {
    const std::string_view text = arguments[1];
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), every);
    if (problem != std::errc() || end != text.data() + text.size() || every < 1) {
      return usage(fmt::format("'{}' is no number of sets", text));
    }
    arguments.erase(arguments.begin(), arguments.begin() + 2);
  }
  if (arguments.empty()) return usage("no recording");
  fmt::print("| recording: object | looks |");
  for (const Step& step : kSteps) {
    fmt::print(" {:.2f} + {:.3g} deg |", step.share, step.turn / kDegree);
  }
  fmt::print("\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  std::array<double, kSteps.size()> sums{};
  int objects = 0;
  for (const std::string_view path : arguments) {
    auto basin = Basin::create(path, every);
    const Status played = basin ? (*basin)->play() : Status(basin.error());
    if (!played) {
      fmt::print(stderr, "{}\n", played.error().message());
      return 2;
    }
    (*basin)->print(sums, objects);
  }
  fmt::print("| mean | |");
  for (const double sum : sums) fmt::print(" {:.1f} |", sum / std::max(1, objects));
  fmt::print("\n");
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  return sightline::run(std::vector<std::string_view>(argv + 1, argv + argc));
}
