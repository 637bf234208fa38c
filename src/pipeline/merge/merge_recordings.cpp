// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/merge_recordings.hpp"

#include <algorithm>
#include <map>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/config/installation.hpp"
#include "sightline/record/merge.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;

template <typename... Args>
Error refuse(const fs::path& folder, fmt::format_string<Args...> format, Args&&... args) {
  return make_error(ErrorCode::kInvalidInput, folder.string(), format, std::forward<Args>(args)...);
}

// The first one's text if all say the same; else every camera that any of them knows.
Result<std::string> join_calibrations(const std::vector<fs::path>& folders) {
  std::map<std::string, std::pair<size_t, CalibratedCamera>> known;
  std::vector<CalibratedCamera> cameras;
  std::string text;
  bool same = true;
  for (size_t i = 0; i < folders.size(); ++i) {
    const fs::path file = folders[i] / "calibration.toml";
    SL_ASSIGN(const std::string one, read_file(file));
    if (i == 0) text = one;
    same &= one == text;
    SL_ASSIGN(const auto list, parse_calibration(one, file.string()));
    for (const CalibratedCamera& camera : list) {
      const auto [entry, fresh] = known.try_emplace(camera.name, i, camera);
      if (fresh) {
        cameras.push_back(camera);
      } else if (!(entry->second.second == camera)) {
        return refuse(folders[i], "camera {} has another calibration in {}", camera.name,
                      folders[entry->second.first].string());
      }
    }
  }
  return same ? text : format_calibration(cameras);
}

Status compare_objects(const Installation& first, const Installation& other) {
  const auto missing = [](const Installation& in, const Installation& of) -> Status {
    for (const ObjectConfig& object : of.objects) {
      const std::string& name = object.description.name;
      const auto found = std::ranges::find_if(
          in.objects, [&](const ObjectConfig& o) { return o.description.name == name; });
      if (found == in.objects.end()) {
        return refuse(in.file, "lacks object {}, which {} has", name, of.file.string());
      }
      if (found->content != object.content) {
        return refuse(in.file, "object {} is another one in {}", name, of.file.string());
      }
    }
    return {};
  };
  SL_RETURN_IF_ERROR(missing(other, first));
  SL_RETURN_IF_ERROR(missing(first, other));
  if (first.scene.meshes.empty() == other.scene.meshes.empty() &&
      first.scene.content == other.scene.content) {
    return {};
  }
  return refuse(other.file, "the scene is another one in {}", first.file.string());
}

// Recordings of different days would make one with a hole in it.
void warn_of_gaps(const std::vector<MergePart>& parts, std::vector<std::string>& warnings) {
  const auto utc = [](const MergePart& part, Time time) {
    return to_ns(time) + part.utc_minus_monotonic_ns;
  };
  for (size_t i = 1; i < parts.size(); ++i) {
    const MergePart &a = parts[0], &b = parts[i];
    if (a.recording.frame_count() == 0 || b.recording.frame_count() == 0) continue;
    const bool apart = utc(a, a.recording.last_capture()) < utc(b, b.recording.first_capture()) ||
                       utc(b, b.recording.last_capture()) < utc(a, a.recording.first_capture());
    if (!apart) continue;
    warnings.push_back(fmt::format("{} and {} have no time in common", a.recording.path.string(),
                                   b.recording.path.string()));
  }
}

}  // namespace

Result<MergedRecordings> merge_recordings(const std::vector<fs::path>& folders, const fs::path& out,
                                          const std::function<void(const std::string&)>& progress) {
  std::vector<MergePart> parts;
  std::vector<Installation> installations;
  MergedRecordings merged;
  for (const fs::path& folder : folders) {
    SL_ASSIGN(MergePart part, open_merge_part(folder));
    SL_ASSIGN(Installation installation, recording_installation(folder));
    if (!installations.empty()) {
      SL_RETURN_IF_ERROR(compare_objects(installations.front(), installation));
    }
    merged.cameras += part.recording.cameras.size();
    merged.frames += part.recording.frame_count();
    std::ranges::copy(part.recording.warnings, std::back_inserter(merged.warnings));
    parts.push_back(std::move(part));
    installations.push_back(std::move(installation));
  }
  SL_ASSIGN(const std::string calibration, join_calibrations(folders));
  warn_of_gaps(parts, merged.warnings);
  SL_RETURN_IF_ERROR(write_merged_recording(parts, calibration, out, progress));
  return merged;
}

}  // namespace sightline
