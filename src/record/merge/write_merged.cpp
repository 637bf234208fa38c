// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <queue>
#include <set>

#include "record/manifest.hpp"
#include "record/object_copy.hpp"
#include "record/out_file.hpp"
#include "record/recording_folder.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/record/axes_csv.hpp"
#include "sightline/record/merge.hpp"
#include "sightline/record/pose_log.hpp"

namespace sightline {

using namespace record;

namespace {

namespace fs = std::filesystem;

constexpr size_t kBuffer = size_t{1} << 16;  // [bytes] before a file is written to

class Merger {
 public:
  Merger(const std::vector<MergePart>& parts, const fs::path& folder,
         const std::function<void(const std::string&)>& progress)
      : parts_(parts), folder_(folder), progress_(progress) {}

  Status write(const std::string& calibration_toml) {
    SL_RETURN_IF_ERROR(refuse_twins());
    SL_RETURN_IF_ERROR(make_recording_folder(folder_));
    for (size_t i = 0; i < parts_.size(); ++i) SL_RETURN_IF_ERROR(copy_videos(i));
    SL_RETURN_IF_ERROR(write_rows());
    SL_RETURN_IF_ERROR(write_axes());
    SL_RETURN_IF_ERROR(write_poses());
    if (!calibration_toml.empty()) {
      SL_RETURN_IF_ERROR(write_all("calibration.toml", calibration_toml));
    }
    return write_manifest();  // last: what has none is no recording
  }

 private:
  // What is added to a part's times.
  Duration shift(size_t part) const {
    return Duration(parts_[part].utc_minus_monotonic_ns - parts_[0].utc_minus_monotonic_ns);
  }

  Status refuse_twins() const {
    std::map<std::string, const MergePart*> owners;
    for (const MergePart& part : parts_) {
      for (const auto& camera : part.manifest.cameras) {
        const auto [owner, fresh] = owners.emplace(camera.name, &part);
        if (fresh) continue;
        return make_error(ErrorCode::kInvalidInput, part.recording.path.string(),
                          "camera {} is in {} too", camera.name,
                          owner->second->recording.path.string());
      }
    }
    return {};
  }

  Status copy_videos(size_t index) {
    const MergePart& part = parts_[index];
    for (const auto& camera : part.manifest.cameras) {
      const fs::path from = part.recording.path / camera.file;
      auto& entry = manifest_.cameras.emplace_back(camera);
      entry.file = camera.name + fs::path(camera.file).extension().string();
      std::error_code fault;
      if (!fs::exists(from, fault)) continue;  // it never delivered
      const Waiting wait("the disk");
      fs::copy_file(from, folder_ / entry.file, fault);
      if (fault) {
        return make_error(ErrorCode::kIo, from.string(), "cannot copy it to {}: {}",
                          folder_.string(), fault.message());
      }
      progress_(entry.file);
    }
    return {};
  }

  Status write_all(const char* name, std::string_view content) {
    SL_ASSIGN(OutFile file, OutFile::create(folder_ / name, OutFile::Existing::kRefuse));
    SL_RETURN_IF_ERROR(file.write(content));
    SL_RETURN_IF_ERROR(file.sync());
    progress_(name);
    return file.close();
  }

  // All rows by capture time, those of one time in the order of the cameras.
  Status write_rows() {
    struct Next {
      Time capture;
      size_t stream;
      bool operator>(const Next& other) const {
        return std::pair(capture, stream) > std::pair(other.capture, other.stream);
      }
    };
    struct Stream {
      const RecordedCamera* camera;
      Duration shift;
      RecordedRows::Iterator at, end;
    };
    std::vector<Stream> streams;
    std::priority_queue<Next, std::vector<Next>, std::greater<>> next;
    for (size_t i = 0; i < parts_.size(); ++i) {
      for (const RecordedCamera& camera : parts_[i].recording.cameras) {
        streams.push_back({&camera, shift(i), camera.rows.begin(), camera.rows.end()});
        if (camera.rows.empty()) continue;
        next.push({camera.rows.front().capture + shift(i), streams.size() - 1});
      }
    }
    SL_ASSIGN(OutFile file, OutFile::create(folder_ / "frames.csv", OutFile::Existing::kRefuse));
    std::string text = "camera,sequence,capture_ns,arrival_ns,dropped_before\n";
    while (!next.empty()) {
      Stream& stream = streams[next.top().stream];
      const RecordedRow row = *stream.at;
      text += fmt::format("{},{},{},{},{}\n", stream.camera->name, row.sequence,
                          to_ns(row.capture + stream.shift), to_ns(row.arrival + stream.shift),
                          row.dropped_before);
      const size_t index = next.top().stream;
      next.pop();
      ++stream.at;
      if (!(stream.at == stream.end)) next.push({(*stream.at).capture + stream.shift, index});
      if (text.size() < kBuffer) continue;
      SL_RETURN_IF_ERROR(file.write(text));
      text.clear();
    }
    SL_RETURN_IF_ERROR(file.write(text));
    SL_RETURN_IF_ERROR(file.sync());
    progress_("frames.csv");
    return file.close();
  }

  Status write_axes() {
    std::vector<std::pair<Time, std::string>> rows;
    for (size_t i = 0; i < parts_.size(); ++i) {
      for (const RecordedCamera& camera : parts_[i].recording.cameras) {
        for (AxisReading reading : camera.axes) {
          reading.stamp += shift(i);
          rows.emplace_back(reading.stamp, format_axes_row(camera.name, reading));
        }
      }
    }
    return rows.empty() ? Status() : write_sorted("axes.csv", kAxesHeader, rows);
  }

  Status write_poses() {
    std::vector<std::pair<Time, std::string>> rows;
    for (size_t i = 0; i < parts_.size(); ++i) {
      if (!parts_[i].recording.poses) continue;
      SL_ASSIGN(auto log, read_pose_log(*parts_[i].recording.poses));
      for (PoseLogRow& row : log) {
        row.time += shift(i);
        rows.emplace_back(row.time, format_pose_row(row));
      }
    }
    return rows.empty() ? Status() : write_sorted("poses.csv", kPoseLogHeader, rows);
  }

  Status write_sorted(const char* name, std::string_view header,
                      std::vector<std::pair<Time, std::string>>& rows) {
    std::ranges::stable_sort(rows, {}, &std::pair<Time, std::string>::first);
    std::string text = fmt::format("{}\n", header);
    for (const auto& [time, row] : rows) text += fmt::format("{}\n", row);
    return write_all(name, text);
  }

  Status write_manifest() {
    const MergePart& first = parts_[0];
    manifest_.name = fs::absolute(folder_).lexically_normal().filename().string();
    manifest_.start_utc = first.manifest.start_utc;
    manifest_.start_monotonic_ns = first.manifest.start_monotonic_ns;
    SL_ASSIGN(manifest_.objects,
              copy_objects(first.recording.objects, folder_, manifest_.left_out));
    if (first.recording.scene) {
      SL_RETURN_IF_ERROR(
          copy_with_parts(*first.recording.scene, folder_ / "scene", manifest_.left_out));
      manifest_.scene = (fs::path("scene") / first.recording.scene->filename()).string();
    }
    return write_all("recording.toml", format_recording_toml(manifest_));
  }

  const std::vector<MergePart>& parts_;
  const fs::path& folder_;
  const std::function<void(const std::string&)>& progress_;
  RecordingManifest manifest_;
};

}  // namespace

Status write_merged_recording(const std::vector<MergePart>& parts,
                              const std::string& calibration_toml, const fs::path& folder,
                              const std::function<void(const std::string&)>& progress) {
  return Merger(parts, folder, progress).write(calibration_toml);
}

}  // namespace sightline
