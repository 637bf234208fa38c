// SPDX-License-Identifier: Apache-2.0
#include "calibration/capture_targets.hpp"

#include <fmt/ranges.h>

#include <algorithm>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/target_file.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostBytes = 64 << 10;  // of a file that may be a target
constexpr size_t kMostFiles = 256;       // beside the installation file that are looked at

std::vector<fs::path> files_beside(const fs::path& installation) {
  std::vector<fs::path> files;
  std::error_code error;
  const fs::path folder = fs::absolute(installation, error).parent_path();
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->path().extension() != ".toml" || !it->is_regular_file(ignored)) continue;
    files.push_back(it->path());
    if (files.size() >= kMostFiles) break;
  }
  std::ranges::sort(files);
  return files;
}

void add_target(const fs::path& file, std::vector<NamedTarget>& targets) {
  const auto text = read_file(file, kMostBytes);
  if (!text) return;
  const auto target = parse_target(*text, file.string());
  const std::string name = file.filename().string();
  const bool known = std::ranges::find(targets, name, &NamedTarget::name) != targets.end();
  if (target && !target->fixed && !known) targets.push_back({name, *target});
}

std::vector<std::string> names_of(const std::vector<NamedTarget>& targets) {
  std::vector<std::string> names;
  for (const NamedTarget& target : targets) names.push_back(target.name);
  return names;
}

}  // namespace

std::vector<NamedTarget> find_targets(const Installation& installation) {
  std::vector<NamedTarget> targets;
  for (const ObjectConfig& object : installation.objects) {
    add_target(object.description.file, targets);
  }
  for (const fs::path& file : files_beside(installation.file)) add_target(file, targets);
  return targets;
}

Result<CalibrationTarget> choose_target(const CaptureOrder& order,
                                        const Installation& installation) {
  if (!order.target_toml.empty()) {
    SL_ASSIGN(CalibrationTarget target, parse_target(order.target_toml, "target_toml"));
    if (!target.fixed) return target;
    return make_error(ErrorCode::kInvalidInput, "target_toml",
                      "stands in the room (fixed = true): it cannot be shown to the cameras");
  }
  const std::vector<NamedTarget> targets = find_targets(installation);
  if (targets.empty()) {
    return make_error(ErrorCode::kInvalidInput, "target",
                      "no target file lies beside the installation file, and no object is a board: "
                      "put board.toml there (sightline calibrate target writes one)");
  }
  if (order.target.empty() && targets.size() == 1) return targets.front().target;
  const auto found = std::ranges::find(targets, order.target, &NamedTarget::name);
  if (found != targets.end()) return found->target;
  return make_error(ErrorCode::kInvalidInput, "target", "{}; there are {}",
                    order.target.empty() ? std::string("say which is shown")
                                         : fmt::format("there is no '{}'", order.target),
                    fmt::join(names_of(targets), ", "));
}

Result<std::vector<size_t>> choose_cameras(const CaptureOrder& order,
                                           const Installation& installation) {
  std::vector<size_t> chosen;
  for (size_t i = 0; order.cameras.empty() && i < installation.cameras.size(); ++i) {
    chosen.push_back(i);
  }
  for (const std::string& name : order.cameras) {
    const auto found = std::ranges::find(installation.cameras, name, &CameraConfig::name);
    if (found == installation.cameras.end()) {
      return make_error(ErrorCode::kInvalidInput, name, "there is no such camera");
    }
    chosen.push_back(static_cast<size_t>(found - installation.cameras.begin()));
    if (std::ranges::count(order.cameras, name) > 1) {
      return make_error(ErrorCode::kInvalidInput, name, "comes twice");
    }
  }
  for (const size_t i : chosen) {
    const CameraConfig& camera = installation.cameras[i];
    if (!camera.calibration.axes) continue;
    return make_error(ErrorCode::kInvalidInput, camera.name,
                      "is on a head that turns, and this is for cameras that stand still: name the "
                      "others in \"cameras\"");
  }
  return chosen;
}

}  // namespace sightline
