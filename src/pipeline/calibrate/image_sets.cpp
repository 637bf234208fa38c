// SPDX-License-Identifier: Apache-2.0
#include "pipeline/calibrate/image_sets.hpp"

#include <glob.h>

#include <Eigen/QR>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>
#include <span>

namespace sightline {

using namespace pipeline;

namespace {

const TargetCorner* find_corner(const TimedCorners& image, int id) {
  const auto found = std::lower_bound(image.corners.begin(), image.corners.end(), id,
                                      [](const TargetCorner& c, int key) { return c.id < key; });
  return found != image.corners.end() && found->id == id ? &*found : nullptr;
}

constexpr int kDegree = 4;
constexpr size_t kFewest = 2;  // images before and after, where there are as many
// Before and after an image [s]: of what a hand does in that time a
// polynomial of the fourth degree leaves nothing, and of more images noise is less.
constexpr double kAround = 0.13;

/// A corner in one image.
struct CornerAt {
  double time_s;
  Eigen::Vector2d pixel;
};

/// Speed and its change at one of some places: the derivatives of the polynomial of the fourth
/// degree that fits them best (of the second through three), as many before as after. A hand that
/// turns back is not followed by the places before and after alone. On one side only: the speed to
/// the next one.
void set_motion(std::span<const CornerAt> path, size_t now, TargetCorner& corner) {
  corner.px_per_s = corner.px_per_s2 = Eigen::Vector2d::Zero();
  if (path.size() < 2) return;
  const size_t before = now, after = path.size() - 1 - now;
  const size_t each = std::min(before, after);
  if (each == 0) {
    const CornerAt &from = path[before > 0 ? now - 1 : now], &to = path[before > 0 ? now : now + 1];
    if (to.time_s > from.time_s) {
      corner.px_per_s = (to.pixel - from.pixel) / (to.time_s - from.time_s);
    }
    return;
  }
  const auto places = static_cast<Eigen::Index>(2 * each + 1);
  const Eigen::Index powers = std::min<Eigen::Index>(kDegree + 1, places);
  const double span = path[now + each].time_s - path[now - each].time_s;
  Eigen::MatrixXd times(places, powers), offsets(places, 2);  // times in spans
  for (Eigen::Index row = 0; row < places; ++row) {
    const CornerAt& place = path[now - each + static_cast<size_t>(row)];
    const double at = (place.time_s - path[now].time_s) / span;
    for (Eigen::Index power = 0; power < powers; ++power) {
      times(row, power) = std::pow(at, static_cast<double>(power));
    }
    offsets.row(row) = (place.pixel - path[now].pixel).transpose();
  }
  const Eigen::MatrixXd solved = times.colPivHouseholderQr().solve(offsets);
  if (!solved.allFinite()) return;  // times that are the same
  corner.px_per_s = solved.row(1).transpose() / span;
  corner.px_per_s2 = 2 * solved.row(2).transpose() / (span * span);
}

/// The last run of digits in a file's stem; empty if there is none.
std::string number_of(const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  size_t end = stem.size();
  while (end > 0 && std::isdigit(static_cast<unsigned char>(stem[end - 1])) == 0) --end;
  size_t begin = end;
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1])) != 0) --begin;
  while (end - begin > 1 && stem[begin] == '0') ++begin;
  return stem.substr(begin, end - begin);
}

bool is_image(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr const char* kKnown[] = {".png",  ".jpg", ".jpeg", ".bmp", ".tif",
                                    ".tiff", ".pgm", ".ppm",  ".pnm", ".webp"};
  return std::any_of(std::begin(kKnown), std::end(kKnown),
                     [&](const char* known) { return extension == known; });
}

std::vector<std::filesystem::path> matching(const std::string& pattern) {
  glob_t found{};
  std::vector<std::filesystem::path> files;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) files.emplace_back(found.gl_pathv[i]);
  }
  globfree(&found);
  return files;
}

}  // namespace

namespace pipeline {

void add_motion(std::vector<TimedCorners>& found, double reach_s) {
  std::map<size_t, std::vector<size_t>> by_camera;
  for (size_t i = 0; i < found.size(); ++i) by_camera[found[i].camera].push_back(i);
  for (const auto& entry : by_camera) {
    const std::vector<size_t>& images = entry.second;
    for (size_t k = 0; k < images.size(); ++k) {
      const auto at = [&](size_t other) -> const TimedCorners& { return found[images[other]]; };
      const auto near = [&](size_t other, size_t next) {
        const bool close = std::abs(at(other).time_s - at(next).time_s) <= reach_s;
        const bool around = std::abs(at(next).time_s - at(k).time_s) <= kAround;
        return close && (around || std::max(next, k) - std::min(next, k) <= kFewest);
      };
      size_t first = k, last = k;
      while (first > 0 && near(first, first - 1)) --first;
      while (last + 1 < images.size() && near(last, last + 1)) ++last;
      for (TargetCorner& corner : found[images[k]].corners) {
        std::vector<CornerAt> path;
        size_t now = 0;
        for (size_t i = first; i <= last; ++i) {
          const TargetCorner* const seen = find_corner(at(i), corner.id);
          if (i == k) now = path.size();
          if (seen != nullptr) path.push_back({at(i).time_s, seen->pixel});
        }
        set_motion(path, now, corner);
      }
    }
  }
}

void group_into_sets(const std::vector<TimedCorners>& found, double span_s,
                     CalibrationViews& views) {
  for (size_t first = 0; first < found.size();) {
    size_t last = first;
    std::set<size_t> cameras;
    double sum = 0;
    while (last < found.size() && found[last].time_s - found[first].time_s <= span_s &&
           cameras.insert(found[last].camera).second) {
      sum += found[last++].time_s;
    }
    const double time_s = sum / static_cast<double>(last - first);
    bool any = false;
    for (; first < last; ++first) {
      if (found[first].corners.empty()) continue;
      any = true;
      views.views.push_back({found[first].camera, views.sets, found[first].time_s - time_s,
                             found[first].corners,
                             fmt::format("at {:.3f} s", found[first].time_s)});
    }
    views.sets += any;
  }
}

std::vector<std::vector<size_t>> sets_of_stills(const std::vector<CameraStills>& stills,
                                                size_t& sets) {
  bool numbered = true;
  for (const CameraStills& camera : stills) {
    std::set<std::string> numbers;
    for (const auto& file : camera.files) {
      const std::string number = number_of(file);
      numbered = numbered && !number.empty() && numbers.insert(number).second;
    }
  }
  std::map<std::string, size_t> by_number;
  std::vector<std::vector<size_t>> out;
  sets = 0;
  for (const CameraStills& camera : stills) {
    out.emplace_back();
    for (size_t i = 0; i < camera.files.size(); ++i) {
      if (numbered) {
        out.back().push_back(
            by_number.emplace(number_of(camera.files[i]), by_number.size()).first->second);
      } else {
        out.back().push_back(i);
        sets = std::max(sets, i + 1);
      }
    }
  }
  if (numbered) sets = by_number.size();
  return out;
}

}  // namespace pipeline

Result<CameraStills> parse_stills(const std::string& argument) {
  const size_t mark = argument.find('=');
  const std::string place = mark == std::string::npos ? argument : argument.substr(mark + 1);
  CameraStills out;
  std::error_code error;
  if (std::filesystem::is_directory(place, error)) {
    for (const auto& entry : std::filesystem::directory_iterator(place, error)) {
      if (is_image(entry.path())) out.files.push_back(entry.path());
    }
    const std::filesystem::path folder = std::filesystem::path(place).lexically_normal();
    out.name = (folder.has_filename() ? folder : folder.parent_path()).filename().string();
  } else {
    out.files = matching(place);
    if (mark == std::string::npos) {
      return make_error(
          ErrorCode::kInvalidInput, argument,
          "is no folder; write NAME=FOLDER or NAME=PATTERN for the images of a camera");
    }
  }
  if (mark != std::string::npos) out.name = argument.substr(0, mark);
  std::sort(out.files.begin(), out.files.end());
  if (!out.files.empty() && !out.name.empty()) return out;
  return make_error(ErrorCode::kInvalidInput, argument,
                    "names no images (PNG, JPEG, BMP, TIFF, PNM, WebP)");
}

}  // namespace sightline
