// SPDX-License-Identifier: Apache-2.0
#include "init/camera_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <regex>
#include <set>
#include <tuple>

#include "cameras/device_listing.hpp"

namespace sightline::cli {
namespace {

// What one core tracks and annotates six of (docs/performance.md); detail beyond it costs time in
// every stage and helps little at a rig's distances.
constexpr int kWidth = 1280, kHeight = 720;
constexpr double kRate = 30, kEnough = 25;

enum class Kind { kColor, kMosaic, kCompressed, kGray, kDeep };

struct Known {
  std::string_view start;
  Kind kind;
};

// By how names begin, the longer ones first where one begins another.
constexpr auto kKnown = std::to_array<Known>({
    {"YUYV", Kind::kColor},
    {"UYVY", Kind::kColor},
    {"NV12", Kind::kColor},
    {"NV21", Kind::kColor},
    {"I420", Kind::kColor},
    {"YUV420", Kind::kColor},
    {"YUV422", Kind::kColor},
    {"RGB", Kind::kColor},
    {"BGR", Kind::kColor},
    {"MJPEG", Kind::kCompressed},
    {"JPEG", Kind::kCompressed},
    {"H264", Kind::kCompressed},
    {"GREY", Kind::kGray},
    {"Mono8", Kind::kGray},
});

Kind kind_of(const std::string& format) {
  for (const Known& known : kKnown) {
    if (format.starts_with(known.start)) return known.kind;
  }
  const bool mosaic = format.starts_with("Bayer") || format.starts_with("S");
  return mosaic && format.ends_with("8") ? Kind::kMosaic : Kind::kDeep;
}

// The rate that is asked for: 30 Hz, or the nearest that the camera has.
double rate_for(const FormatInfo& format) {
  if (format.rates_hz.empty()) return 0;
  const auto [low, high] = std::minmax_element(format.rates_hz.begin(), format.rates_hz.end());
  if (format.rates_hz.size() == 2) return std::clamp(kRate, *low, *high);  // ends of a range
  double best = *low;
  for (const double rate : format.rates_hz) {
    if (rate <= kRate * 1.01) best = std::max(best, rate);
  }
  return best;
}

bool fast(double rate) { return rate == 0 || rate >= kEnough; }

// More is better, from the left.
auto merit(const FormatInfo& format) {
  const double rate = rate_for(format);
  const bool fits = format.width <= kWidth && format.height <= kHeight;
  const int area = format.width * format.height;
  // Rigs track what is colored; of the rest, what needs no decoding.
  constexpr std::array kRank{5, 4, 3, 2, 1};
  return std::tuple(fast(rate), fits, fits ? area : -area, rate,
                    kRank[static_cast<size_t>(kind_of(format.pixel_format))]);
}

const char* reason_of(Kind kind) {
  switch (kind) {
    case Kind::kColor:
      return "in color without compression";
    case Kind::kMosaic:
      return "in color, as the sensor has it";
    case Kind::kCompressed:
      return "compressed, since it is not as fast without at this size";
    case Kind::kGray:
      return "gray, having no color at this size and rate";
    case Kind::kDeep:
      break;
  }
  return "in the only format there is at this size and rate";
}

std::string sizes_of(const DeviceInfo& camera) {
  std::set<std::pair<int, int>> sizes;
  for (const FormatInfo& format : camera.formats) sizes.insert({format.width, format.height});
  std::string text;
  for (const auto& [width, height] : sizes) {
    text += fmt::format("{}{}x{}", text.empty() ? "" : ", ", width, height);
  }
  return text;
}

std::string reason(const FormatInfo& best, std::optional<ImageSize> wanted) {
  const double rate = rate_for(best);
  std::string text = wanted ? "The size that was asked for"
                     : best.width > kWidth || best.height > kHeight
                         ? "The smallest images it offers"
                         : fmt::format("The largest images up to {}x{}", kWidth, kHeight);
  if (rate == 0) text += "; it does not say how fast";
  if (rate > 0) text += fmt::format("{} {:.4g} Hz", fast(rate) ? " at" : ", only at", rate);
  return text + fmt::format("; {}.", reason_of(kind_of(best.pixel_format)));
}

bool is_usb(const DeviceInfo& camera) {
  if (camera.scheme == "v4l2") return camera.where.find("usb:") != std::string::npos;
  // libcamera's names of USB cameras end with the port, the interface, and maker and product.
  static const std::regex usb("-[0-9.]+:[0-9]+\\.[0-9]+-[0-9a-f]{4}:[0-9a-f]{4}$");
  return std::regex_search(camera.id, usb);
}

}  // namespace

Result<CameraChoice> choose_format(const DeviceInfo& camera, std::optional<ImageSize> wanted) {
  const FormatInfo* best = nullptr;
  for (const FormatInfo& format : camera.formats) {
    if (wanted && (format.width != wanted->width || format.height != wanted->height)) continue;
    if (format.width % 2 != 0 || format.height % 2 != 0) continue;  // no stream of such
    if (best == nullptr || merit(format) > merit(*best)) best = &format;
  }
  if (best == nullptr) {
    return make_error(ErrorCode::kInvalidInput, source_of(camera), "it offers no {}; it has: {}",
                      wanted ? fmt::format("{}x{}", wanted->width, wanted->height)
                             : std::string("images of even width and height"),
                      sizes_of(camera));
  }
  return CameraChoice{best->pixel_format, best->width, best->height, rate_for(*best),
                      reason(*best, wanted)};
}

std::vector<DeviceInfo> usable_cameras(const std::vector<DeviceInfo>& devices,
                                       std::vector<std::string>& left_out) {
  const auto any = [&](const char* scheme, bool usb) {
    return std::any_of(devices.begin(), devices.end(), [&](const DeviceInfo& camera) {
      return camera.scheme == scheme && is_usb(camera) == usb && !camera.formats.empty();
    });
  };
  const bool usb_by_v4l2 = any("v4l2", true), board_by_libcamera = any("libcamera", false);
  std::vector<DeviceInfo> usable;
  for (const DeviceInfo& camera : devices) {
    const std::string source = source_of(camera);
    if (camera.scheme == "libcamera" && is_usb(camera) && usb_by_v4l2) {
      left_out.push_back(fmt::format("{}: the same as one of v4l2's", source));
    } else if (camera.scheme == "v4l2" && !is_usb(camera) && board_by_libcamera) {
      left_out.push_back(fmt::format("{}: a part of what libcamera has", source));
    } else if (camera.formats.empty()) {
      left_out.push_back(
          fmt::format("{}: {}", source, camera.note.empty() ? "it tells no formats" : camera.note));
    } else {
      usable.push_back(camera);
    }
  }
  return usable;
}

}  // namespace sightline::cli
