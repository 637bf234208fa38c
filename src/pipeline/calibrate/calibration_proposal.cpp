// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/calibration_proposal.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"

namespace sightline {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr size_t kMaxBytes = size_t{16} << 20;
constexpr double kSamePlace = 1e-9;  // [m, rad]

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(
      0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues().maxCoeff()));
}

std::string utc_stamp() {
  const std::time_t now = static_cast<std::time_t>(utc_now_ns() / 1'000'000'000);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%dT%H%M%SZ", &parts);
  return text;
}

bool differs(const Rigid3& a, const Rigid3& b) {
  return rotation_angle(a, b) > 1e-7 || translation_distance(a, b) > kSamePlace;
}

Status check_cameras(const std::vector<CalibratedCamera>& now,
                     const std::vector<CalibratedCamera>& proposed, const std::string& where) {
  for (const CalibratedCamera& camera : proposed) {
    const CalibratedCamera* known = find_camera(now, camera.name);
    if (known == nullptr || !(known->model.parameters() == camera.model.parameters())) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "is no proposal for this calibration: camera \"{}\" {}", camera.name,
                        known == nullptr ? "is not in it" : "has another lens in it");
    }
  }
  return {};
}

// Beside the file, under a name that nothing has.
Result<std::filesystem::path> keep(const std::filesystem::path& file, const std::string& text) {
  const std::string stamp = utc_stamp();
  for (int i = 0; i < 100; ++i) {
    std::filesystem::path kept = file;
    kept += i == 0 ? "." + stamp : fmt::format(".{}-{}", stamp, i);
    std::error_code error;
    if (std::filesystem::exists(kept, error)) continue;
    SL_RETURN_IF_ERROR(write_file_atomically(kept, text));
    return kept;
  }
  return make_error(ErrorCode::kIo, file.string(), "there is no free name to keep it under");
}

}  // namespace

std::vector<std::optional<Rigid3>> watched_places(const Installation& installation) {
  std::vector<std::optional<Rigid3>> places;
  for (const CameraConfig& camera : installation.cameras) {
    places.emplace_back();
    // One that turns stands where its angles say.
    if (observes(camera.role) && !camera.calibration.axes)
      places.back() = camera.calibration.world_from_camera;
  }
  return places;
}

std::unique_ptr<CalibrationWatch> make_calibration_watch(const Installation& installation,
                                                         const Rig& rig) {
  auto places = watched_places(installation);
  const auto watched = std::ranges::count_if(places, [](const auto& p) { return p.has_value(); });
  const auto fewest = installation.watch.background ? 1 : 2;
  if (!installation.watch.enabled || watched < fewest) return nullptr;
  std::vector<ShapeSymmetry> symmetry = rig.shape_symmetry();
  symmetry.resize(rig.objects.size());
  return std::make_unique<CalibrationWatch>(std::move(places), std::move(symmetry));
}

std::string unfit_words(std::span<const std::string> names, std::span<const CameraWatch> watches,
                        size_t camera) {
  const std::string words = "its picture does not fit its calibration";
  const CameraWatch& watch = watches[camera];
  if (watch.looks_like.empty()) {
    return watch.zoom != 1
               ? fmt::format("{}: everything is {:.3f} times as large: another lens or zoom?",
                             words, watch.zoom)
               : words + ": another camera, another lens, or turned far away";
  }
  for (size_t i = 0; i < std::min(watches.size(), names.size()); ++i) {
    if (names[i] != watch.looks_like || watches[i].looks_like != names[camera]) continue;
    return fmt::format("{}: {} and {} look exchanged", words, names[camera], watch.looks_like);
  }
  return fmt::format("{}: it is what camera {} has seen", words, watch.looks_like);
}

std::string correction_words(const CameraWatch& watch) {
  return fmt::format("turned {:.3f} deg +- {:.3f}, shifted {:.2f} mm +- {:.2f}",
                     watch.correction.head<3>().norm() * kDegrees,
                     largest_sigma(watch.covariance.topLeftCorner<3, 3>()) * kDegrees,
                     watch.correction.tail<3>().norm() * 1e3,
                     largest_sigma(watch.covariance.bottomRightCorner<3, 3>()) * 1e3);
}

std::filesystem::path proposal_file(const std::filesystem::path& calibration,
                                    const std::filesystem::path& state) {
  if (state.empty()) return state;
  const auto text = read_file(calibration, kMaxBytes);
  if (!text) return {};
  return state / fmt::format("proposed_calibration_{:016x}.toml", content_hash(*text));
}

Status write_proposal(const std::filesystem::path& file, const Installation& installation,
                      std::span<const CameraWatch> watches) {
  SL_ASSIGN(auto cameras, read_calibration(installation.calibration));
  for (size_t i = 0; i < installation.cameras.size() && i < watches.size(); ++i) {
    if (!is_wrong(watches[i].state)) continue;
    const std::string& name = installation.cameras[i].calibration.name;
    const auto camera = std::ranges::find(cameras, name, &CalibratedCamera::name);
    if (camera == cameras.end()) continue;
    camera->world_from_camera = camera->world_from_camera * Rigid3::exp(watches[i].correction);
  }
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);
  if (error) {
    return make_error(ErrorCode::kIo, file.parent_path().string(), "cannot make the folder: {}",
                      error.message());
  }
  return write_calibration(file, cameras);
}

Result<Acceptance> accept_proposal(const std::filesystem::path& calibration,
                                   const std::filesystem::path& proposal,
                                   std::span<const std::string> names) {
  SL_ASSIGN(const std::string text, read_file(calibration, kMaxBytes));
  SL_ASSIGN(auto cameras, parse_calibration(text, calibration.string()));
  SL_ASSIGN(const auto proposed, read_calibration(proposal));
  SL_RETURN_IF_ERROR(check_cameras(cameras, proposed, proposal.string()));
  Acceptance acceptance;
  for (CalibratedCamera& camera : cameras) {
    const CalibratedCamera* next = find_camera(proposed, camera.name);
    if (next == nullptr || !differs(camera.world_from_camera, next->world_from_camera)) continue;
    if (!names.empty() && std::ranges::find(names, camera.name) == names.end()) continue;
    const Rigid3 moved = camera.world_from_camera.inverse() * next->world_from_camera;
    acceptance.cameras.push_back(
        {camera.name, rotation_angle(moved, Rigid3()) * kDegrees, moved.translation.norm() * 1e3});
    camera.world_from_camera = next->world_from_camera;
  }
  for (const std::string& name : names) {
    if (std::ranges::find(acceptance.cameras, name, &AcceptedCamera::name) ==
        acceptance.cameras.end()) {
      return make_error(ErrorCode::kInvalidInput, proposal.string(),
                        "proposes no other place for camera \"{}\"", name);
    }
  }
  if (acceptance.cameras.empty()) {
    return make_error(ErrorCode::kInvalidInput, proposal.string(),
                      "proposes nothing that {} does not say already", calibration.string());
  }
  SL_ASSIGN(acceptance.kept, keep(calibration, text));
  SL_RETURN_IF_ERROR(write_calibration(calibration, cameras));
  return acceptance;
}

}  // namespace sightline
