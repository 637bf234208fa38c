// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "publish/cell/cell_wire_parts.hpp"
#include "publish/cell/wire_names.hpp"
#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline {
namespace {

namespace wire = cell::v1;
using publish::is_camera_name;
using publish::is_object_name;
using publish::is_utc;
using publish::is_utf8;
using publish::parse;
using publish::pose_of;
using publish::put;
using publish::refuse;
using Numbers = google::protobuf::RepeatedField<double>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

constexpr int kMostCounts = 32;  // verdicts, those of newer hosts included
constexpr int kMostLinearizations = 16, kMostHypotheses = 64, kMostCameras = 64;
constexpr size_t kLongestText = 256;
constexpr double kRounding = 1e-7;                 // of the largest eigenvalue
constexpr int64_t kMostError_ns = 10'000'000'000;  // of a capture time
constexpr uint32_t kMostResiduals = 1'000'000;

template <int kSize>
void put(const Eigen::Matrix<double, kSize, kSize>& matrix, Numbers& out) {
  for (int row = 0; row < kSize; ++row) {
    for (int column = row; column < kSize; ++column) out.Add(matrix(row, column));
  }
}

void put(const Vector6& vector, Numbers& out) {
  for (int i = 0; i < 6; ++i) out.Add(vector[i]);
}

bool read(const Numbers& in, Vector6& out) {
  if (in.size() != 6) return false;
  for (int i = 0; i < 6; ++i) out[i] = in.Get(i);
  return out.allFinite();
}

/// A symmetric matrix without a negative eigenvalue, but for rounding.
template <int kSize>
bool read(const Numbers& in, Eigen::Matrix<double, kSize, kSize>& out) {
  if (in.size() != kSize * (kSize + 1) / 2) return false;
  int next = 0;
  for (int row = 0; row < kSize; ++row) {
    for (int column = row; column < kSize; ++column) {
      out(row, column) = out(column, row) = in.Get(next++);
    }
  }
  if (!out.allFinite() || out.cwiseAbs().maxCoeff() > 1e30) return false;
  // Units differ: seen next to each other, rotation and translation are of one size.
  const auto diagonal = out.diagonal();
  if (diagonal.minCoeff() < 0) return false;
  const Eigen::Matrix<double, kSize, 1> scale = diagonal.cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
  const Eigen::Matrix<double, kSize, kSize> even = scale.asDiagonal() * out * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kSize, kSize>> solver(
      even, Eigen::EigenvaluesOnly);
  return solver.info() == Eigen::Success && solver.eigenvalues().minCoeff() >= -kRounding * kSize;
}

Result<FrozenPart> part_of(const wire::Quadratic& in) {
  if (in.kind() >= kFrozenKinds) return refuse("has no such kind of measurement");
  FrozenPart part{static_cast<FrozenKind>(in.kind()), {}};
  LinearizedTerm& term = part.term;
  const bool good = read<6>(in.information(), term.information) &&
                    read(in.gradient(), term.gradient) && std::isfinite(in.cost()) &&
                    in.cost() >= 0 && in.residuals() > 0 && in.residuals() <= kMostResiduals &&
                    in.quality() >= 0 && in.quality() <= 1;
  if (!good) return refuse("has a measurement that is none");
  term.cost = in.cost();
  term.residuals = static_cast<int>(in.residuals());
  term.quality = in.quality();
  return part;
}

Result<FrozenAt> linearization_of(const wire::Linearization& in) {
  FrozenAt at;
  SL_ASSIGN(at.reference, pose_of(in.reference()));
  if (in.parts_size() > static_cast<int>(kFrozenKinds)) return refuse("has too many measurements");
  for (const wire::Quadratic& quadratic : in.parts()) {
    SL_ASSIGN(FrozenPart part, part_of(quadratic));
    const auto same = [&part](const FrozenPart& other) { return other.kind == part.kind; };
    if (std::ranges::any_of(at.parts, same)) return refuse("has a kind of measurement twice");
    at.parts.push_back(std::move(part));
  }
  return at;
}

template <typename List>
Status read_hypotheses(const List& in, std::vector<PoseHypothesis>& out) {
  if (in.size() > kMostHypotheses) return refuse("has too many hypotheses");
  for (const wire::Hypothesis& hypothesis : in) {
    SL_ASSIGN(const Rigid3 pose, pose_of(hypothesis.pose()));
    if (!std::isfinite(hypothesis.cost())) return refuse("has a cost that is none");
    out.push_back({pose, hypothesis.cost()});
  }
  return {};
}

void put(const PoseHypothesis& hypothesis, wire::Hypothesis& out) {
  put(hypothesis.world_from_object, *out.mutable_pose());
  out.set_cost(hypothesis.cost);
}

Status read_measurement(const wire::Observation& in, CellObservation& out) {
  if (in.at_size() > kMostLinearizations) return refuse("has too many linearizations");
  for (const wire::Linearization& linearization : in.at()) {
    SL_ASSIGN(FrozenAt at, linearization_of(linearization));
    out.at.push_back(std::move(at));
  }
  SL_RETURN_IF_ERROR(read_hypotheses(in.hypotheses(), out.hypotheses));
  SL_RETURN_IF_ERROR(read_hypotheses(in.symmetric(), out.symmetric_hypotheses));
  if (in.has_picture()) {
    const auto share = [](float value) { return value >= 0 && value <= 1e6F; };
    out.picture = PictureAgreement{in.picture().unexplained(), in.picture().missing()};
    if (!share(out.picture->unexplained) || !share(out.picture->missing)) {
      return refuse("has a picture's share that is none");
    }
  }
  if (in.print() > static_cast<uint32_t>(PrintSeen::kSolid)) return refuse("has no such print");
  out.print = static_cast<PrintSeen>(in.print());
  if (in.calibration_covariance_size() != 0) {
    Matrix6& covariance = out.calibration_covariance.emplace();
    if (!read<6>(in.calibration_covariance(), covariance)) {
      return refuse("has a covariance that is none");
    }
  }
  return {};
}

// A difference of two covariances may leave rounding of either sign where there is nothing.
bool is_something(const Matrix6& alternatives, const Matrix6& covariance) {
  return (alternatives.diagonal().array() > kRounding * covariance.diagonal().array()).any();
}

}  // namespace

bool cell_available() { return mqtt_available(); }

std::string encode(const CellObservation& observation) {
  wire::Observation out;
  out.set_version(kCellVersion);
  out.set_object(observation.object);
  out.set_camera(observation.camera);
  out.set_host(observation.host);
  out.set_boot(observation.boot);
  out.set_calibration(observation.calibration);
  out.set_sequence(observation.sequence);
  out.set_capture_utc_ns(observation.capture_utc_ns);
  out.set_capture_error_ns(observation.capture_error.count());
  out.set_stream_epoch(observation.stream_epoch);
  out.set_frame(observation.frame);
  for (const FrozenAt& at : observation.at) {
    wire::Linearization& linearization = *out.add_at();
    put(at.reference, *linearization.mutable_reference());
    for (const FrozenPart& part : at.parts) {
      wire::Quadratic& quadratic = *linearization.add_parts();
      quadratic.set_kind(static_cast<uint32_t>(part.kind));
      put<6>(part.term.information, *quadratic.mutable_information());
      put(part.term.gradient, *quadratic.mutable_gradient());
      quadratic.set_cost(part.term.cost);
      quadratic.set_residuals(static_cast<uint32_t>(part.term.residuals));
      quadratic.set_quality(part.term.quality);
    }
  }
  for (const auto& hypothesis : observation.hypotheses) put(hypothesis, *out.add_hypotheses());
  for (const auto& symmetric : observation.symmetric_hypotheses) {
    put(symmetric, *out.add_symmetric());
  }
  if (observation.picture) {
    out.mutable_picture()->set_unexplained(observation.picture->unexplained);
    out.mutable_picture()->set_missing(observation.picture->missing);
  }
  out.set_print(static_cast<uint32_t>(observation.print));
  out.set_refutes(observation.refutes);
  out.set_doubted(observation.doubted);
  if (observation.calibration_covariance) {
    put<6>(*observation.calibration_covariance, *out.mutable_calibration_covariance());
  }
  return out.SerializeAsString();
}

Result<CellObservation> decode_observation(std::string_view bytes) {
  SL_ASSIGN(const wire::Observation in, parse<wire::Observation>(bytes));
  CellObservation out;
  out.object = in.object();
  out.camera = in.camera();
  out.host = in.host();
  if (!is_object_name(out.object) || !is_camera_name(out.camera) || !is_camera_name(out.host)) {
    return refuse("lacks a name");
  }
  out.boot = in.boot();
  out.calibration = in.calibration();
  out.sequence = in.sequence();
  out.capture_utc_ns = in.capture_utc_ns();
  const bool in_time = is_utc(in.capture_utc_ns()) && in.capture_error_ns() >= 0 &&
                       in.capture_error_ns() <= kMostError_ns;
  if (!in_time) return refuse("has a capture time that is none");
  out.capture_error = Duration(in.capture_error_ns());
  out.stream_epoch = in.stream_epoch();
  out.frame = in.frame();
  SL_RETURN_IF_ERROR(read_measurement(in, out));
  out.refutes = in.refutes();
  out.doubted = in.doubted();
  return out;
}

std::string encode(const CellTrack& track) {
  wire::Track out;
  publish::put_sender(track, out);
  out.set_object(track.object);
  out.set_last_measured_utc_ns(track.last_measured_utc_ns);
  const PoseEstimate& estimate = track.estimate;
  out.set_state(static_cast<uint32_t>(estimate.state));
  out.set_reasons(estimate.degraded_reasons);
  if (has_pose(estimate.state)) {
    put(estimate.world_from_object, *out.mutable_pose());
    put(estimate.twist, *out.mutable_twist());
    put<12>(estimate.covariance, *out.mutable_covariance());
    if (is_something(estimate.alternatives, estimate.own_covariance())) {
      put<6>(estimate.alternatives, *out.mutable_alternatives());
    }
  }
  for (const std::string& camera : track.cameras) out.add_cameras(camera);
  out.set_term(track.term);
  return out.SerializeAsString();
}

Result<CellTrack> decode_track(std::string_view bytes) {
  SL_ASSIGN(const wire::Track in, parse<wire::Track>(bytes));
  CellTrack out;
  SL_RETURN_IF_ERROR(publish::read_sender(in, out));
  out.object = in.object();
  if (!is_object_name(out.object)) return refuse("lacks a name");
  out.last_measured_utc_ns = in.last_measured_utc_ns();
  if (in.state() > static_cast<uint32_t>(TrackState::kLost)) return refuse("has no such state");
  if (in.reasons() > 0xFFFF) return refuse("has no such reasons");
  PoseEstimate& estimate = out.estimate;
  estimate.state = static_cast<TrackState>(in.state());
  estimate.degraded_reasons = static_cast<DegradedReasons>(in.reasons());
  if (has_pose(estimate.state)) {
    if (!is_utc(out.last_measured_utc_ns)) return refuse("has a time that is none");
    SL_ASSIGN(estimate.world_from_object, pose_of(in.pose()));
    bool good = read(in.twist(), estimate.twist) && read<12>(in.covariance(), estimate.covariance);
    if (in.alternatives_size() != 0)
      good = good && read<6>(in.alternatives(), estimate.alternatives);
    if (!good) return refuse("has an estimate that is none");
  }
  if (in.cameras_size() > kMostCameras) return refuse("has too many cameras");
  for (const std::string& camera : in.cameras()) {
    if (!is_camera_name(camera)) return refuse("lacks a name");
    out.cameras.push_back(camera);
  }
  out.term = in.term();
  return out;
}

std::string encode(const CellHostState& state) {
  wire::HostState out;
  out.set_version(kCellVersion);
  out.set_host(state.host);
  out.set_boot(state.boot);
  out.set_online(state.online);
  out.set_role(static_cast<uint32_t>(state.role));
  out.set_since_utc_ns(state.since_utc_ns);
  for (const CellHostState::Camera& camera : state.cameras) {
    wire::HostCamera& entry = *out.add_cameras();
    entry.set_name(camera.name);
    entry.set_calibration(camera.calibration);
    entry.set_away(camera.away);
  }
  out.set_clock_bound_ns(state.clock_bound.count());
  out.set_clock_fit(state.clock_fit);
  out.set_beat(state.beat);
  for (const uint64_t count : state.observations) out.add_observations(count);
  out.set_clock(publish::printable(state.clock.substr(0, kLongestText)));
  out.set_page(state.page);
  return out.SerializeAsString();
}

Result<CellHostState> decode_host_state(std::string_view bytes) {
  SL_ASSIGN(const wire::HostState in, parse<wire::HostState>(bytes));
  CellHostState out;
  out.host = in.host();
  if (!is_camera_name(out.host)) return refuse("lacks a name");
  out.boot = in.boot();
  out.online = in.online();
  if (in.role() > static_cast<uint32_t>(CellRole::kFusion)) return refuse("has no such role");
  out.role = static_cast<CellRole>(in.role());
  out.since_utc_ns = in.since_utc_ns();
  if (!is_utc(out.since_utc_ns)) return refuse("has a time that is none");
  if (in.cameras_size() > kMostCameras) return refuse("has too many cameras");
  for (const wire::HostCamera& camera : in.cameras()) {
    if (!is_camera_name(camera.name())) return refuse("lacks a name");
    out.cameras.push_back({camera.name(), camera.calibration(), camera.away()});
  }
  if (in.clock_bound_ns() < 0 || in.clock().size() > kLongestText || !is_utf8(in.clock())) {
    return refuse("has a clock that is none");
  }
  out.clock_bound = Duration(in.clock_bound_ns());
  out.clock_fit = in.clock_fit();
  out.beat = in.beat();
  if (in.observations_size() > kMostCounts) return refuse("has too many counts");
  out.observations.assign(in.observations().begin(), in.observations().end());
  out.clock = in.clock();
  if (!in.page().empty() && !is_page_address(in.page())) return refuse("has a page that is none");
  out.page = in.page();
  return out;
}

}  // namespace sightline
