// SPDX-License-Identifier: Apache-2.0
// How well an object is tracked by its appearance, and whether the estimate knows: a recording
// with truth is replayed with fiducials off; while the object is lost it is started again next to
// the truth, which no program does.
//   track_recording RECORDING [--modalities region,edge,texture] [--off CAMERA,...] [--poses
//   OUT.csv] [--consistency]
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cstring>
#include <map>

#include "claims/consistency.hpp"
#include "figures.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/tracking_chain.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using bench::quantile;

struct Arguments {
  std::filesystem::path recording;
  std::string modalities = "region,edge,texture";
  std::string off;
  std::filesystem::path poses;
  bool verbose = false;
  bool consistency = false;  ///< nothing but the row of a table
};

// What one kind of term of one camera says of its own error, at the truth: with g, H there its
// minimum lies at -H^-1 g, and g^T H^-1 g is chi-square with six degrees of freedom if H is honest.
struct Honesty {
  std::vector<double> squared, mm, deg;
  /// Of line terms, at the truth [px]: how far outwards and in x and y all lines were measured
  /// together, and what is left then, of one line.
  std::vector<double> dilation, shift_x, shift_y, rest;
};

class Run {
 public:
  static Result<std::unique_ptr<Run>> create(const Arguments& arguments) {
    std::unique_ptr<Run> run(new Run());
    run->arguments_ = arguments;
    SL_ASSIGN(Recording opened, open_recording(arguments.recording));
    run->recording_ = std::make_shared<const Recording>(std::move(opened));
    if (!run->recording_->truth) {
      return make_error(ErrorCode::kInvalidInput, arguments.recording.string(), "has no truth.csv");
    }
    SL_ASSIGN(run->truth_, read_truth(*run->recording_->truth));
    SL_ASSIGN(run->installation_, recording_installation(arguments.recording));
    for (ObjectConfig& object : run->installation_.objects) {
      const auto has = [&](const char* modality) {
        return arguments.modalities.find(modality) != std::string::npos;
      };
      object.description.modalities = {has("fiducial"), has("region"), has("edge"), has("texture")};
    }
    SL_ASSIGN(run->rig_, load_rig(run->installation_));
    std::vector<CameraId> cameras;
    for (const CameraConfig& camera : run->installation_.cameras) {
      cameras.emplace_back(static_cast<uint32_t>(cameras.size()));
      run->names_.push_back(camera.name);
    }
    SL_ASSIGN(run->chain_, TrackingChain::create(run->installation_, run->rig_, cameras, nullptr));
    run->honesty_.resize(cameras.size());
    return run;
  }

  Status play() {
    SL_ASSIGN(auto replay,
              VirtualReplay::open(recording_, {}, time_offsets(*recording_, installation_),
                                  axis_histories(*recording_, installation_)));
    for (;;) {
      SL_ASSIGN(const auto frames, replay->next());
      if (!frames) break;
      chain_->begin(frames->front()->info().capture);
      std::vector<Observation>& set = chain_->set();
      const bool lost = !has_pose(estimator().state());
      for (const FramePtr& frame : *frames) {
        const size_t camera = frame->info().camera.index();
        if (arguments_.off.find(names_[camera]) != std::string::npos) continue;
        frame->i420();
        const double start = process_cpu_ms();
        chain_->observe({frame->info().camera, frame});
        cpu_.push_back(process_cpu_ms() - start);
        if (lost && set.back().terms.empty()) propose(*frame, set.back());
        note(*frame, set.back());
      }
      if (set.empty()) continue;
      const UpdateReport report = chain_->fuse().front();
      log_.push_back(make_pose_log_row(report.estimate, rig_.objects[0].named.name, names_));
      if (const auto truth = truth_at(report.estimate.time)) {
        note_estimate(*truth, report);
      }
    }
    return {};
  }

  Status print() {
    SL_ASSIGN(const Status written, write_log());
    (void)written;
    if (arguments_.consistency) {
      if (!consistency_.empty()) {
        fmt::print("| {} | {} | {} |\n", rig_.objects[0].named.name, installation_.cameras.size(),
                   consistency_.cells());
      }
      return {};
    }
    fmt::print("{}", to_text(evaluate(truth_, log_)));
    const EstimatorCounters& counters = estimator().counters();
    fmt::print("starts {}, resets {}, gated {}\n", counters.starts, counters.resets,
               counters.gated);
    fmt::print("tracking cpu ms per camera frame: median {:.2f}, 95 % {:.2f}\n",
               quantile(cpu_, 0.5), quantile(cpu_, 0.95));
    for (const auto& [state, nees] : nees_) {
      double sum = 0;
      for (const double value : nees) sum += value;
      fmt::print("NEES {:<9} mean {:7.1f} median {:6.1f} (6 expected), {} sets\n", to_string(state),
                 sum / static_cast<double>(nees.size()), quantile(nees, 0.5), nees.size());
    }
    for (size_t i = 0; i < honesty_.size(); ++i) {
      for (auto& [kind, h] : honesty_[i]) {
        fmt::print(
            "{:<8} {:<8} {:4} frames: own error {:6.2f} mm {:5.2f} deg (median); chi-square "
            "median "
            "{:6.1f} (5.3 expected) 90 % {:6.1f} (10.6)\n",
            names_[i], kind, h.squared.size(), quantile(h.mm, 0.5), quantile(h.deg, 0.5),
            quantile(h.squared, 0.5), quantile(h.squared, 0.9));
        if (h.rest.empty()) continue;
        const auto spread = [](const std::vector<double>& v) {
          double sum = 0, squares = 0;
          for (const double x : v) sum += x, squares += x * x;
          const double mean = sum / static_cast<double>(v.size());
          return fmt::format("{:5.2f} +- {:4.2f}", mean,
                             std::sqrt(squares / static_cast<double>(v.size()) - mean * mean));
        };
        fmt::print("         lines at the truth [px]: outwards {}, x {}, y {}, rest {}\n",
                   spread(h.dilation), spread(h.shift_x), spread(h.shift_y), spread(h.rest));
      }
    }
    return {};
  }

 private:
  Run() = default;
  const ObjectEstimator& estimator() const { return chain_->fusion().estimator(ObjectId(0)); }

  std::optional<Rigid3> truth_at(Time time) const {
    return sightline::truth_at(truth_, time, Duration::max());
  }

  void propose(const Frame& frame, Observation& observation) {
    const auto truth = truth_at(frame.info().capture);
    if (!truth) return;
    Vector6 off;
    off << 0.02, -0.02, 0.01, 0.003, -0.003, 0.003;
    Matrix6 covariance = Matrix6::Identity() * 0.02 * 0.02;
    covariance.diagonal().tail<3>().setConstant(0.004 * 0.004);
    const CameraId camera = observation.camera;
    observation = chain_->observer(camera)->tracker().propose(
        frame, ObjectId(0), *truth * Rigid3::exp(off), covariance);
  }

  void note(const Frame& frame, const Observation& observation) {
    const auto truth = truth_at(frame.info().capture);
    if (!truth) return;
    Matrix6 sum = Matrix6::Zero();
    Vector6 slope = Vector6::Zero();
    const size_t camera = observation.camera.index();
    const auto add = [&](const std::string& kind, const Matrix6& information, const Vector6& g) {
      const Vector6 own = -information.ldlt().solve(g);
      Honesty& h = honesty_[camera][kind];
      h.squared.push_back(-own.dot(g));
      h.deg.push_back(own.head<3>().norm() * 57.3);
      h.mm.push_back(own.tail<3>().norm() * 1e3);
    };
    const Rigid3 camera_from_object =
        installation_.cameras[camera].calibration.world_from_camera.inverse() * *truth;
    for (const PoseTermPtr& term : observation.terms) {
      const LinearizedTerm at = term->linearize(*truth);
      add(std::string(term->kind()), at.information, at.gradient);
      if (const auto* lines = dynamic_cast<const LineTerm*>(term.get())) {
        note_lines(*lines, camera_from_object, camera);
      }
      sum += at.information;
      slope += at.gradient;
    }
    if (observation.terms.size() > 1) add("sum", sum, slope);
    const auto& result = chain_->observer(observation.camera)->tracker().last_result(0);
    if (!arguments_.verbose) return;
    const PoseAt before = estimator().track()->at(frame.info().capture);
    const double mm = before.source == PoseSource::kNone
                          ? -1
                          : 1e3 * translation_distance(before.estimate.world_from_object, *truth);
    const double deg = before.source == PoseSource::kNone
                           ? -1
                           : 57.3 * rotation_angle(before.estimate.world_from_object, *truth);
    fmt::print(
        "{} {:<6} {:<9} pred off {:6.1f} mm {:5.1f} deg lines {}/{} ev {:.2f} noise {:.2f} "
        "edges {} {:.2f} points {} {}{} chi {:.1f}\n",
        frame.info().sequence, names_[camera], to_string(estimator().state()), mm, deg,
        result.lines_used, result.lines_total, result.evidence, result.noise_px, result.edges_used,
        result.edge_noise_px, result.points_used, result.seen ? "seen" : "not seen",
        result.learned ? " learned" : "",
        observation.terms.empty() ? 0.0 : slope.dot(sum.ldlt().solve(slope)));
  }

  void note_lines(const LineTerm& term, const Rigid3& camera_from_object, size_t camera) {
    Eigen::Matrix3d system = Eigen::Matrix3d::Identity() * 1e-9;
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    std::vector<std::pair<Eigen::Vector3d, double>> seen;
    for (const LineMatch& line : term.lines()) {
      const auto pixel = installation_.cameras[camera].calibration.model.project(
          camera_from_object * line.point_in_object);
      if (!pixel) continue;
      const double distance = line.normal.dot(*pixel - line.center);
      double measured = static_cast<double>(line.offset[0]) - distance;
      for (size_t k = 1; k < static_cast<size_t>(line.offsets); ++k) {
        const double other = static_cast<double>(line.offset[k]) - distance;
        if (std::abs(other) < std::abs(measured)) measured = other;
      }
      if (std::abs(measured) > 4) continue;
      const Eigen::Vector3d by(line.normal.x(), line.normal.y(), 1);
      system += by * by.transpose();
      right += by * measured;
      seen.emplace_back(by, measured);
    }
    if (seen.size() < 8) return;
    const Eigen::Vector3d shared = system.ldlt().solve(right);
    double squares = 0;
    for (const auto& [by, measured] : seen) squares += std::pow(measured - by.dot(shared), 2);
    Honesty& h = honesty_[camera][std::string(term.kind())];
    h.shift_x.push_back(shared.x());
    h.shift_y.push_back(shared.y());
    h.dilation.push_back(shared.z());
    h.rest.push_back(std::sqrt(squares / static_cast<double>(seen.size())));
  }

  void note_estimate(const Rigid3& truth, const UpdateReport& report) {
    if (!has_pose(report.estimate.state)) return;
    const Vector6 off = difference(report.estimate.world_from_object, truth);
    nees_[report.estimate.state].push_back(
        off.dot(report.estimate.pose_covariance().ldlt().solve(off)));
    if (report.estimate.state == TrackState::kTracking) {
      consistency_.add(off, report.estimate.pose_covariance());
    }
    if (arguments_.verbose) {
      fmt::print(
          "   -> {} err {:.1f} mm {:.1f} deg sigma {:.1f} mm {:.1f} deg accepted {:x} gated "
          "{:x} hyp {}\n",
          to_string(report.estimate.state), 1e3 * off.tail<3>().norm(), 57.3 * off.head<3>().norm(),
          1e3 * report.estimate.sigma_translation(), 57.3 * report.estimate.sigma_rotation(),
          report.accepted, report.gated, report.hypotheses);
    }
  }

  Result<Status> write_log() {
    if (arguments_.poses.empty()) return Status();
    SL_ASSIGN(auto writer, PoseLogWriter::create(arguments_.poses));
    for (const PoseLogRow& row : log_) SL_RETURN_IF_ERROR(writer->append(row));
    return writer->close();
  }

  Arguments arguments_;
  std::shared_ptr<const Recording> recording_;
  std::vector<TruthRow> truth_;
  Installation installation_;
  Rig rig_;
  std::unique_ptr<TrackingChain> chain_;
  std::vector<std::string> names_;
  std::vector<PoseLogRow> log_;
  std::vector<double> cpu_;
  std::map<TrackState, std::vector<double>> nees_;
  bench::Consistency consistency_;  // while tracking
  std::vector<std::map<std::string, Honesty>> honesty_;
};

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  sightline::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool more = i + 1 < argc;
    if (word == "--modalities" && more) {
      arguments.modalities = argv[++i];
    } else if (word == "--off" && more) {
      arguments.off = argv[++i];
    } else if (word == "--poses" && more) {
      arguments.poses = argv[++i];
    } else if (word == "--consistency") {
      arguments.consistency = true;
    } else if (word == "--verbose") {
      arguments.verbose = true;
    } else {
      arguments.recording = word;
    }
  }
  if (arguments.recording.empty()) {
    fmt::print(stderr,
               "usage: track_recording RECORDING [--modalities LIST] [--off CAMERA] [--poses CSV] "
               "[--consistency] [--verbose]\n");
    return 2;
  }
  auto run = sightline::Run::create(arguments);
  sightline::Status done = run ? (*run)->play()
                               : sightline::Status(sightline::make_error(
                                     run.error().code, run.error().where, "{}", run.error().text));
  if (done) done = (*run)->print();
  if (done) return 0;
  fmt::print(stderr, "{}\n", done.error().message());
  return 1;
}
