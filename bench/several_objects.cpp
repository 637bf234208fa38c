// SPDX-License-Identifier: Apache-2.0
// What several objects at once cost and how well each is followed: a recording with truth is
// replayed with its first 1, 2, 4 ... objects known. Each is started next to the truth, once;
// what is lost stays lost. Prints a Markdown table: CPU of observing and fusing one camera's frame
// with all of them, the sum of what each costs alone, and of each object the shares within 5 cm + 5
// deg and `tracking`, errors, and wrong claims.
//   several_objects RECORDING [COUNT ...]
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>
#include <vector>

#include "claims/truth_recording.hpp"
#include "figures.hpp"
#include "sightline/pipeline/tracking_chain.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using bench::quantile;

constexpr double kWrongMeters = 0.02, kWrongRadians = 0.175;  // of a claim, DESIGN section 7
constexpr double kWithinMeters = 0.05, kWithinRadians = 0.0873;

struct ObjectFigures {
  std::vector<double> mm, deg;
  int judged = 0, within = 0, tracking = 0, wrong = 0;
};

class Run {
 public:
  /// Of so many objects, from the `first`, to the end of the recording.
  static Result<std::unique_ptr<Run>> play(const std::filesystem::path& path, size_t count,
                                           size_t first = 0) {
    std::unique_ptr<Run> run(new Run());
    SL_ASSIGN(run->in_, bench::open_truth_recording(path, count, first));
    run->figures_.resize(count);
    SL_RETURN_IF_ERROR(run->play());
    return run;
  }

  double median_cpu_ms() const { return quantile(cpu_, 0.5); }

  /// `alone`: the same objects, each by itself, the sum [ms].
  void print(double alone) {
    fmt::print("| {} | {:.2f} | {:.2f} | {:.2f} |", figures_.size(), median_cpu_ms(),
               quantile(cpu_, 0.95), alone);
    for (size_t i = 0; i < figures_.size(); ++i) {
      ObjectFigures& f = figures_[i];
      const double n = std::max(1, f.judged);
      fmt::print("{} {}: {:.0f} %, {:.0f} % tracking, {:.2f} mm {:.2f} deg, {} wrong",
                 i > 0 ? ";" : "", in_.rig.objects[i].named.name, 100 * f.within / n,
                 100 * f.tracking / n, f.mm.empty() ? -1.0 : quantile(f.mm, 0.5),
                 f.deg.empty() ? -1.0 : quantile(f.deg, 0.5), f.wrong);
    }
    fmt::print(" |\n");
  }

 private:
  Run() = default;

  Status play() {
    std::vector<CameraId> cameras;
    for (uint32_t i = 0; i < in_.installation.cameras.size(); ++i) cameras.emplace_back(i);
    SL_ASSIGN(chain_, TrackingChain::create(in_.installation, in_.rig, cameras, nullptr));
    SL_ASSIGN(auto replay,
              VirtualReplay::open(in_.recording, {}, time_offsets(*in_.recording, in_.installation),
                                  axis_histories(*in_.recording, in_.installation)));
    for (;;) {
      SL_ASSIGN(const auto frames, replay->next());
      if (!frames) return {};
      const double start = process_cpu_ms();
      double decoded = 0;
      chain_->begin(frames->front()->info().capture);
      for (const FramePtr& frame : *frames) {
        const double before = process_cpu_ms();
        frame->i420();
        decoded += process_cpu_ms() - before;
        chain_->observe({frame->info().camera, frame});
        if (!started_) start_from_truth(*frame);
      }
      chain_->fuse();
      started_ = true;
      cpu_.push_back((process_cpu_ms() - start - decoded) / static_cast<double>(frames->size()));
      judge(frames->front()->info().capture);
    }
  }

  void start_from_truth(const Frame& frame) {
    Vector6 off;
    off << 0.02, -0.02, 0.01, 0.003, -0.003, 0.003;
    Matrix6 covariance = Matrix6::Identity() * 0.02 * 0.02;
    covariance.diagonal().tail<3>().setConstant(0.004 * 0.004);
    for (Observation& observation : chain_->set()) {
      if (observation.camera != frame.info().camera) continue;
      const auto truth =
          truth_at(in_.truth.at(observation.object.index()), frame.info().capture, Duration::max());
      if (!truth) continue;
      observation = chain_->observer(observation.camera)
                        ->tracker()
                        .propose(frame, observation.object, *truth * Rigid3::exp(off), covariance);
    }
  }

  void judge(Time now) {
    for (size_t i = 0; i < figures_.size(); ++i) {
      ObjectFigures& f = figures_[i];
      const auto truth = truth_at(in_.truth[i], now, Duration::max());
      if (!truth) continue;
      ++f.judged;
      const PoseEstimate& newest = chain_->tracks()[i]->newest();
      if (!has_pose(newest.state)) continue;
      const double off = translation_distance(newest.world_from_object, *truth);
      const double turned = angle(i, newest.world_from_object, *truth);
      f.mm.push_back(1e3 * off);
      f.deg.push_back(57.2958 * turned);
      f.within += off < kWithinMeters && turned < kWithinRadians ? 1 : 0;
      if (newest.state != TrackState::kTracking) continue;
      ++f.tracking;
      f.wrong += off > kWrongMeters || turned > kWrongRadians ? 1 : 0;
    }
  }

  // Turns about a declared axis mean nothing.
  double angle(size_t object, const Rigid3& a, const Rigid3& b) const {
    const auto& axis = in_.rig.objects[object].shape_symmetry.axis;
    if (!axis || !axis->declared) return rotation_angle(a, b);
    const Eigen::Vector3d u = a.rotation * axis->direction, v = b.rotation * axis->direction;
    return std::atan2(u.cross(v).norm(), u.dot(v));
  }

  bench::TruthRecording in_;
  std::unique_ptr<TrackingChain> chain_;
  std::vector<ObjectFigures> figures_;  // by ObjectId
  std::vector<double> cpu_;
  bool started_ = false;
};

Status compare(const std::filesystem::path& recording, const std::vector<size_t>& counts) {
  fmt::print(
      "| objects | CPU ms per camera frame, median | 95 % | each alone, sum | within, tracking, "
      "median error |\n| --- | --- | --- | --- | --- |\n");
  std::vector<double> alone;
  for (const size_t count : counts) {
    SL_ASSIGN(const auto together, Run::play(recording, count));
    while (alone.size() < count) {
      SL_ASSIGN(const auto one, Run::play(recording, 1, alone.size()));
      alone.push_back(one->median_cpu_ms());
    }
    together->print(
        std::accumulate(alone.begin(), alone.begin() + static_cast<ptrdiff_t>(count), 0.0));
  }
  return {};
}

int run(int argc, char** argv) {
  std::vector<size_t> counts;
  for (int i = 2; i < argc; ++i) {
    const std::string_view word = argv[i];
    size_t count = 0;
    if (std::from_chars(word.begin(), word.end(), count).ec != std::errc() || count < 1) argc = 0;
    counts.push_back(count);
  }
  if (argc < 2) {
    fmt::print(stderr, "usage: several_objects RECORDING [COUNT ...]\n");
    return 2;
  }
  if (counts.empty()) counts = {1, 2, 4, 8};
  const Status done = compare(argv[1], counts);
  if (done) return 0;
  fmt::print(stderr, "{}\n", done.error().message());
  return exit_code(done.error());
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) { return sightline::run(argc, argv); }
