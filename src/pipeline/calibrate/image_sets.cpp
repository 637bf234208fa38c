// SPDX-License-Identifier: Apache-2.0
#include "pipeline/calibrate/image_sets.hpp"

#include <glob.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

namespace sightline {

using namespace pipeline;

namespace {

const TargetCorner* find_corner(const TimedCorners& image, int id) {
  const auto found = std::lower_bound(image.corners.begin(), image.corners.end(), id,
                                      [](const TargetCorner& c, int key) { return c.id < key; });
  return found != image.corners.end() && found->id == id ? &*found : nullptr;
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
  for (const auto& [camera, images] : by_camera) {
    for (size_t k = 0; k < images.size(); ++k) {
      TimedCorners& now = found[images[k]];
      const auto near = [&](size_t other) {
        return std::abs(found[images[other]].time_s - now.time_s) <= reach_s;
      };
      const TimedCorners* before = k > 0 && near(k - 1) ? &found[images[k - 1]] : nullptr;
      const TimedCorners* after =
          k + 1 < images.size() && near(k + 1) ? &found[images[k + 1]] : nullptr;
      for (TargetCorner& corner : now.corners) {
        const TargetCorner* a = before != nullptr ? find_corner(*before, corner.id) : nullptr;
        const TargetCorner* b = after != nullptr ? find_corner(*after, corner.id) : nullptr;
        if (a == nullptr && b == nullptr) continue;
        const double from = a != nullptr ? before->time_s : now.time_s;
        const double to = b != nullptr ? after->time_s : now.time_s;
        const Eigen::Vector2d start = a != nullptr ? a->pixel : corner.pixel;
        const Eigen::Vector2d end = b != nullptr ? b->pixel : corner.pixel;
        if (to > from) corner.px_per_s = (end - start) / (to - from);
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
