// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/recording.hpp"

#include <algorithm>
#include <utility>

#include "record/csv.hpp"
#include "record/manifest.hpp"
#include "sightline/base/files.hpp"
#include "sightline/record/axes_csv.hpp"
#include "sightline/record/video_reader.hpp"

namespace sightline {

using namespace record;

namespace {

namespace fs = std::filesystem;

Status check_file(const fs::path& file, const std::string& named_by) {
  std::error_code ignored;
  if (fs::is_regular_file(file, ignored)) return {};
  return make_error(ErrorCode::kNotFound, named_by, "names {}, which does not exist",
                    file.string());
}

std::optional<fs::path> if_there(const fs::path& file) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return std::nullopt;
  return file;
}

/// Cuts rows and images to their common start, or refuses.
class TailFitter {
 public:
  TailFitter(const std::string& csv, RecordingMode mode, std::vector<std::string>& warnings)
      : csv_(csv), mode_(mode), warnings_(warnings) {}

  Status fit(RecordedCamera& camera, uint64_t images) {
    const uint64_t rows = camera.rows.size();
    if (images < rows) return drop_rows(camera, images);
    if (images == rows) return {};
    const uint64_t extra = images - rows;
    const double seconds = to_seconds(camera.frame_period()) * static_cast<double>(extra);
    const std::string what = fmt::format("has {} images, but {} has {} rows of camera {}", images,
                                         csv_, rows, camera.name);
    if (mode_ == RecordingMode::kStrict || rows == 0 || seconds > to_seconds(kToleratedTail)) {
      return make_error(ErrorCode::kInvalidInput, camera.file.string(), "{}", what);
    }
    warnings_.push_back(
        fmt::format("{}: {}; the last {} images are left out", camera.file.string(), what, extra));
    return {};
  }

 private:
  Status drop_rows(RecordedCamera& camera, uint64_t images) {
    const RecordedRow& last = camera.rows.back();
    const RecordedRow first_missing = camera.rows[images];
    const Duration missing = last.capture - first_missing.capture + camera.frame_period();
    const std::string what = fmt::format(
        "camera {} has {} rows, but {} ends after {} images ({:.3f} s earlier)", camera.name,
        camera.rows.size(), camera.file.string(), images, to_seconds(missing));
    const std::string where = line_of(csv_, first_missing.line);
    if (mode_ == RecordingMode::kStrict || missing > kToleratedTail) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "{}; the video is damaged or belongs to another recording", what);
    }
    warnings_.push_back(fmt::format("{}: {}; its rows from here on are left out", where, what));
    camera.rows.truncate(images);
    return {};
  }

  const std::string& csv_;
  RecordingMode mode_;
  std::vector<std::string>& warnings_;
};

Status fill_files(const RecordingManifest& manifest, const std::string& toml, Recording& out) {
  for (const auto& object : manifest.objects) {
    out.objects.push_back(out.path / object);
    SL_RETURN_IF_ERROR(check_file(out.objects.back(), toml));
  }
  if (manifest.scene) {
    out.scene = out.path / *manifest.scene;
    SL_RETURN_IF_ERROR(check_file(*out.scene, toml));
  }
  out.calibration = if_there(out.path / "calibration.toml");
  out.truth = if_there(out.path / "truth.csv");
  out.poses = if_there(out.path / "poses.csv");
  return {};
}

/// Images in a camera's video. A camera that never delivered has no rows, and its file need not
/// be there.
Result<uint64_t> count_images(const RecordedCamera& camera, const std::string& named_by,
                              RecordingMode mode, const std::stop_token& stop,
                              std::vector<std::string>& warnings) {
  auto count = [&]() -> Result<uint64_t> {
    SL_RETURN_IF_ERROR(check_file(camera.file, named_by));
    return count_video_frames(camera.file, camera.codec, camera.width, camera.height, stop);
  }();
  if (count || !camera.rows.empty() || mode == RecordingMode::kStrict) return count;
  warnings.push_back(
      fmt::format("camera {} recorded nothing ({})", camera.name, count.error().message()));
  return uint64_t{0};
}

Status fill_cameras(const RecordingManifest& manifest, const std::string& toml, RecordingMode mode,
                    const std::stop_token& stop, Recording& out) {
  std::vector<std::string> names;
  for (const auto& camera : manifest.cameras) names.push_back(camera.name);
  const std::string csv = (out.path / "frames.csv").string();
  SL_ASSIGN(auto rows, read_frames_csv(csv, names, &out.warnings));
  std::vector<std::vector<AxisReading>> axes(names.size());
  if (const auto file = if_there(out.path / "axes.csv")) {
    SL_ASSIGN(axes, read_axes_csv(*file, names, &out.warnings));
  }
  TailFitter fitter(csv, mode, out.warnings);
  for (size_t i = 0; i < names.size(); ++i) {
    const auto& from = manifest.cameras[i];
    RecordedCamera camera{from.name,          out.path / from.file, from.codec,
                          from.width,         from.height,          from.pixels,
                          std::move(rows[i]), std::move(axes[i])};
    SL_ASSIGN(const uint64_t images,
              count_images(camera, line_of(toml, static_cast<size_t>(from.line)), mode, stop,
                           out.warnings));
    SL_RETURN_IF_ERROR(fitter.fit(camera, images));
    out.cameras.push_back(std::move(camera));
  }
  return {};
}

template <typename Pick>
Time pick_capture(const std::vector<RecordedCamera>& cameras, Pick pick) {
  std::optional<Time> found;
  for (const auto& camera : cameras) {
    if (camera.rows.empty()) continue;
    const std::pair ends{camera.rows.front().capture, camera.rows.back().capture};
    found = found ? pick(std::pair{*found, *found}, ends) : pick(ends, ends);
  }
  return found.value_or(Time{});
}

}  // namespace

Duration RecordedCamera::frame_period() const {
  if (rows.size() < 2) return Duration{0};
  std::vector<Duration> steps;
  steps.reserve(rows.size());
  Time before = rows.front().capture;
  for (const RecordedRow& row : rows)
    steps.push_back(row.capture - std::exchange(before, row.capture));
  steps.erase(steps.begin());
  const auto middle = steps.begin() + static_cast<ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

Time Recording::first_capture() const {
  return pick_capture(cameras, [](auto a, auto b) { return std::min(a.first, b.first); });
}

Time Recording::last_capture() const {
  return pick_capture(cameras, [](auto a, auto b) { return std::max(a.second, b.second); });
}

size_t Recording::frame_count() const {
  size_t count = 0;
  for (const auto& camera : cameras) count += camera.rows.size();
  return count;
}

Result<Recording> open_recording(const fs::path& path, RecordingMode mode,
                                 const std::stop_token& stop) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) {
    return make_error(ErrorCode::kNotFound, path.string(), "is not a recording folder");
  }
  const std::string toml = (path / "recording.toml").string();
  SL_ASSIGN(const std::string text, read_file(toml, size_t{1} << 20));
  SL_ASSIGN(RecordingManifest manifest, parse_recording_toml(text, toml));
  Recording out;
  out.path = path;
  out.name = manifest.name;
  out.start_utc = manifest.start_utc;
  out.warnings = std::move(manifest.warnings);
  SL_RETURN_IF_ERROR(fill_files(manifest, toml, out));
  SL_RETURN_IF_ERROR(fill_cameras(manifest, toml, mode, stop, out));
  return out;
}

}  // namespace sightline
