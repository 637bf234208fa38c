// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "sightline/calibrate/target_file.hpp"
#include "sightline/calibrate/views.hpp"

namespace sightline {
namespace {

constexpr std::string_view kHeader = "set,camera,delay_s,corner,u,v,du,dv,ddu,ddv";
constexpr std::string_view kShortHeader = "set,camera,delay_s,corner,u,v,du,dv";
constexpr std::string_view kCameraMark = "#camera ";
constexpr std::string_view kTargetMark = "#target ";
constexpr std::string_view kOtherMark = "#other ";  // of the targets beside it, each from its name
constexpr size_t kMaxSets = 1'000'000;
constexpr int kMaxSide = 32768;

/// Reads fields between commas (or blanks) of one line.
class Fields {
 public:
  Fields(std::string_view line, char separator) : rest_(line), separator_(separator) {}

  std::string_view text() {
    const size_t end = rest_.find(separator_);
    const std::string_view field = rest_.substr(0, end);
    rest_ = end == std::string_view::npos ? std::string_view() : rest_.substr(end + 1);
    if (field.empty()) good_ = false;
    return field;
  }
  template <typename Number>
  Number number() {
    const std::string_view field = text();
    Number value{};
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    good_ = good_ && error == std::errc() && end == field.data() + field.size();
    return value;
  }
  bool good() const { return good_ && rest_.empty(); }

 private:
  std::string_view rest_;
  char separator_;
  bool good_ = true;
};

class ViewsReader {
 public:
  ViewsReader(std::string_view text, const std::string& where) : text_(text), where_(where) {}

  Result<CalibrationViews> read() {
    std::string target;
    std::vector<std::string> others;
    bool header = false;
    while (!text_.empty()) {
      const size_t end = text_.find('\n');
      const std::string_view line = text_.substr(0, end);
      text_ = end == std::string_view::npos ? std::string_view() : text_.substr(end + 1);
      ++line_;
      if (line.starts_with(kTargetMark)) {
        target += std::string(line.substr(kTargetMark.size())) + "\n";
      } else if (line.starts_with(kOtherMark)) {
        const std::string_view rest = line.substr(kOtherMark.size());
        if (rest.starts_with("name = ") || others.empty()) others.emplace_back();
        others.back() += std::string(rest) + "\n";
      } else if (line.starts_with(kCameraMark)) {
        SL_RETURN_IF_ERROR(camera(line.substr(kCameraMark.size())));
      } else if (line == kHeader || line == kShortHeader) {
        header = true;
        accelerated_ = line == kHeader;
      } else if (!line.empty() && line[0] != '#') {
        if (!header) return fault("not a file of corners: its header is '{}'", kHeader);
        SL_RETURN_IF_ERROR(row(line));
      }
    }
    SL_ASSIGN(views_.target, parse_target(target, where_ + " (target)"));
    for (const std::string& other : others) {
      SL_ASSIGN(views_.target.others.emplace_back(), parse_target(other, where_ + " (target)"));
    }
    SL_RETURN_IF_ERROR(check_views(views_));
    return std::move(views_);
  }

 private:
  template <typename... Args>
  Error fault(fmt::format_string<Args...> format, Args&&... args) const {
    return make_error(ErrorCode::kInvalidInput, fmt::format("{}:{}", where_, line_), format,
                      std::forward<Args>(args)...);
  }

  Status camera(std::string_view line) {
    Fields fields(line, ' ');
    ViewedCamera camera;
    camera.name = fields.text();
    camera.width = fields.number<int>();
    camera.height = fields.number<int>();
    camera.images = fields.number<size_t>();
    // A camera that has not given an image yet has no size.
    const bool unseen = camera.width == 0 && camera.height == 0 && camera.images == 0;
    const bool sized = camera.width > 0 && camera.height > 0 && camera.width <= kMaxSide &&
                       camera.height <= kMaxSide;
    if (!fields.good() || !(unseen || sized)) {
      return fault("a camera is written '#camera NAME WIDTH HEIGHT IMAGES'");
    }
    views_.cameras.push_back(camera);
    return {};
  }

  Status row(std::string_view line) {
    Fields fields(line, ',');
    const auto set = fields.number<size_t>();
    const std::string_view name = fields.text();
    const auto delay = fields.number<double>();
    TargetCorner corner;
    corner.id = fields.number<int>();
    for (double* value :
         {&corner.pixel.x(), &corner.pixel.y(), &corner.px_per_s.x(), &corner.px_per_s.y()}) {
      *value = fields.number<double>();
    }
    if (accelerated_) {
      corner.px_per_s2.x() = fields.number<double>();
      corner.px_per_s2.y() = fields.number<double>();
    }
    if (!fields.good()) return fault("is not '{}'", accelerated_ ? kHeader : kShortHeader);
    if (set >= kMaxSets) return fault("set {} is beyond {}", set, kMaxSets);
    size_t camera = 0;
    while (camera < views_.cameras.size() && views_.cameras[camera].name != name) ++camera;
    if (camera == views_.cameras.size()) return fault("no camera '{}' in the head", name);
    views_.sets = std::max(views_.sets, set + 1);
    const auto [at, fresh] = index_.try_emplace({set, camera}, views_.views.size());
    if (fresh) views_.views.push_back({camera, set, delay, {}, fmt::format("set {}", set)});
    views_.views[at->second].corners.push_back(corner);
    return {};
  }

  std::string_view text_;
  const std::string& where_;
  size_t line_ = 0;
  bool accelerated_ = false;  // rows have the last two columns
  CalibrationViews views_;
  std::map<std::pair<size_t, size_t>, size_t> index_;
};

/// Each line behind a mark.
std::string marked(std::string_view mark, const std::string& lines) {
  std::string text;
  for (std::string_view rest = lines; !rest.empty();) {
    const size_t end = rest.find('\n');
    text += fmt::format("{}{}\n", mark, rest.substr(0, end));
    rest = rest.substr(end + 1);
  }
  return text;
}

}  // namespace

std::string format_views(const CalibrationViews& views) {
  std::string text = "# corners of a calibration target; pixels, seconds\n";
  text += marked(kTargetMark, format_target(views.target));
  for (const CalibrationTarget& other : views.target.others) {
    const std::string formatted = format_target(other);
    text += marked(kOtherMark, formatted.substr(formatted.find('\n') + 1));
  }
  for (const ViewedCamera& c : views.cameras) {
    text += fmt::format("{}{} {} {} {}\n", kCameraMark, c.name, c.width, c.height, c.images);
  }
  text += fmt::format("{}\n", kHeader);
  for (const TargetView& view : views.views) {
    for (const TargetCorner& c : view.corners) {
      text +=
          fmt::format("{},{},{},{},{},{},{},{},{},{}\n", view.set, views.cameras[view.camera].name,
                      view.delay_s, c.id, c.pixel.x(), c.pixel.y(), c.px_per_s.x(), c.px_per_s.y(),
                      c.px_per_s2.x(), c.px_per_s2.y());
    }
  }
  return text;
}

Result<CalibrationViews> parse_views(std::string_view text, const std::string& where) {
  return ViewsReader(text, where).read();
}

}  // namespace sightline
