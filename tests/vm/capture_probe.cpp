// SPDX-License-Identifier: Apache-2.0
//
// A small client of the V4L2, libcamera and Aravis sources, for tests in a guest with real drivers.
// Prints what happens, one event a line, and counts at the end.
//
//     capture_probe list
//     capture_probe formats DEVICE WxH     grabs in every format and compares 75 % color bars
//     capture_probe stream DEVICE FORMAT WxH SECONDS
//                                          streams, opens again after errors
//     capture_probe libcamera list
//     capture_probe libcamera stream ID FORMAT WxH SECONDS [CONTROL=VALUE...]
//     capture_probe pattern CAMERA DEVICE WxH SECONDS
//                                          compares every byte with what the emulated CAMERA sends
//                                          (uvc, u3v, gv, sim)
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <set>
#include <span>
#include <string>
#include <thread>

#include "pattern.hpp"
#include "sightline/base/time.hpp"
#include "sightline/capture/aravis/aravis_source.hpp"
#include "sightline/capture/common/device_info.hpp"
#include "sightline/capture/libcamera/libcamera_source.hpp"
#include "sightline/capture/v4l2/v4l2_source.hpp"

namespace {

using namespace sightline;
using namespace std::chrono_literals;

constexpr int kStripes = 8;
constexpr int kTolerance = 8;

using Color = std::array<double, 3>;
using Stripes = std::array<Color, kStripes>;

// 75 % bars: white, yellow, cyan, green, magenta, red, blue, black; limited range.
Stripes bars(const Color& weights) {
  constexpr std::array<std::array<double, 3>, kStripes> kRgb = {
      {{1, 1, 1}, {1, 1, 0}, {0, 1, 1}, {0, 1, 0}, {1, 0, 1}, {1, 0, 0}, {0, 0, 1}, {0, 0, 0}}};
  Stripes stripes{};
  for (size_t i = 0; i < kStripes; ++i) {
    const double r = 0.75 * kRgb[i][0], g = 0.75 * kRgb[i][1], b = 0.75 * kRgb[i][2];
    const double y = weights[0] * r + weights[1] * g + weights[2] * b;
    stripes[i] = {16 + 219 * y, 128 + 224 * 0.5 / 0.886 * (b - y),
                  128 + 224 * 0.5 / 0.701 * (r - y)};
  }
  return stripes;
}

double mean(const PlaneView& plane, int stripe) {
  const int middle = (2 * stripe + 1) * plane.width / (2 * kStripes), half = plane.width / 64;
  double sum = 0;
  int count = 0;
  // The driver writes text into the upper half.
  for (int y = plane.height * 3 / 4; y < plane.height - 4; ++y) {
    for (int x = middle - half; x <= middle + half; ++x, ++count) sum += plane.row(y)[x];
  }
  return sum / count;
}

double worst_difference(const I420View& image, bool color) {
  // vivid's gray is the luminance of BT.709.
  const Stripes expected = color ? bars({0.299, 0.587, 0.114}) : bars({0.2126, 0.7152, 0.0722});
  double worst = 0;
  for (int i = 0; i < kStripes; ++i) {
    const auto& [y, u, v] = expected[static_cast<size_t>(i)];
    worst = std::max(worst, std::abs(mean(image.y, i) - y));
    if (!color) continue;
    worst = std::max(worst, std::abs(mean(image.u, i) - u));
    worst = std::max(worst, std::abs(mean(image.v, i) - v));
  }
  return worst;
}

long open_files() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"),
                       std::filesystem::directory_iterator());
}

int list(const Result<std::vector<DeviceInfo>>& devices) {
  if (!devices) return std::puts(devices.error().message().c_str()), 1;
  for (const DeviceInfo& device : *devices) {
    std::printf("%s | %s | %s | %s | %zu modes %s\n", device.id.c_str(), device.model.c_str(),
                device.serial.c_str(), device.where.c_str(), device.formats.size(),
                device.note.c_str());
  }
  return 0;
}

bool check_format(V4l2Options options, const std::string& format) {
  options.format = format;
  auto source = open_v4l2_source(options, CameraId(0), "probe");
  if (!source) return std::printf("FAIL %s\n", source.error().message().c_str()), false;
  FramePtr frame;
  for (int i = 0; i < 5; ++i) {
    const auto step = (*source)->next({}, 5s);
    if (!step) return std::printf("FAIL %s\n", step.error().message().c_str()), false;
    if (step->frame) frame = step->frame;
  }
  if (!frame) return std::printf("FAIL %s: no frame\n", format.c_str()), false;
  const bool gray = format == "GREY" || format.starts_with("Y1");
  const double worst = worst_difference(frame->i420(), !gray);
  std::printf("%s %s differs by %.1f, dmabuf %s\n", worst <= kTolerance ? "ok" : "FAIL",
              format.c_str(), worst, frame->payload().dmabuf_fd >= 0 ? "yes" : "no");
  return worst <= kTolerance;
}

template <typename Options>
void set_size(Options& options, const char* size) {
  if (std::sscanf(size, "%dx%d", &options.width, &options.height) != 2) std::exit(2);
}

int formats(const char* device, const char* size) {
  V4l2Options options;
  options.device = device;
  set_size(options, size);
  static const std::set<std::string> kKnown = {
      "YUYV",    "UYVY",    "NV12",    "YUV420",  "GREY",    "Y10",     "Y12",     "Y16",
      "RGB24",   "BGR24",   "SRGGB8",  "SGRBG8",  "SGBRG8",  "SBGGR8",  "SRGGB10", "SGRBG10",
      "SGBRG10", "SBGGR10", "SRGGB12", "SGRBG12", "SGBRG12", "SBGGR12", "SRGGB16"};
  const auto devices = list_v4l2();
  std::set<std::string> offered;
  for (const DeviceInfo& info : devices ? *devices : std::vector<DeviceInfo>()) {
    if (!info.where.starts_with(device)) continue;
    for (const FormatInfo& format : info.formats) offered.insert(format.pixel_format);
  }
  int good = 0, bad = 0;
  for (const std::string& format : offered) {
    if (kKnown.contains(format)) ++(check_format(options, format) ? good : bad);
  }
  std::printf("formats good=%d bad=%d\n", good, bad);
  return good == 0 || bad > 0;
}

template <typename Options, typename Open>
int stream(Options options, Open open, double seconds) {
  options.counters = std::make_shared<CaptureCounters>();
  const Time end = MonotonicClock::now() + from_seconds(seconds);
  std::string last_error;
  const auto report = [&](const Error& error) {
    if (error.message() != last_error) std::printf("error: %s\n", error.message().c_str());
    last_error = error.message();
    std::this_thread::sleep_for(250ms);
  };
  Duration worst_error{0}, worst_age{0};
  while (MonotonicClock::now() < end) {
    auto source = open(options, CameraId(0), "probe", std::stop_token());
    if (!source) {
      report(source.error());
      continue;
    }
    ++options.epoch;
    bool first = true;
    while (MonotonicClock::now() < end) {
      auto step = (*source)->next({}, 200ms);
      if (!step) {
        source->reset();  // before the wait: a device that is held keeps its number
        report(step.error());
        break;
      }
      if (!step->frame) continue;
      if (first) std::printf("streaming: epoch %u\n", options.epoch);
      first = false;
      last_error.clear();
      const FrameInfo& info = step->frame->info();
      worst_error = std::max(worst_error, info.capture_error);
      worst_age = std::max(worst_age, info.arrival - info.capture);
    }
  }
  const CaptureCounters& c = *options.counters;
  std::printf("files=%ld\n", open_files());
  std::printf(
      "end: good=%lu damaged=%lu lost=%lu copied=%lu rejected=%lu openings=%u bound_ms=%.1f "
      "age_ms=%.1f\n",
      c.good.value(), c.damaged.value(), c.lost.value(), c.copied.value(), c.stamp_rejected.value(),
      options.epoch, to_seconds(worst_error) * 1e3, to_seconds(worst_age) * 1e3);
  return c.good.value() == 0;
}

template <typename Options>
Options options_for(const char* format, const char* size) {
  Options options;
  options.format = format;
  set_size(options, size);
  return options;
}

int stream_v4l2(char** argv) {
  auto options = options_for<V4l2Options>(argv[3], argv[4]);
  options.device = argv[2];
  return stream(options, open_v4l2_source, std::atof(argv[5]));
}

int stream_libcamera(char** argv) {
  auto options = options_for<LibcameraOptions>(argv[4], argv[5]);
  options.id = argv[3];
  for (char** control = argv + 7; *control != nullptr; ++control) {
    const std::string text = *control;
    const size_t equals = std::min(text.find('='), text.size() - 1);
    char* end = nullptr;
    const double number = std::strtod(text.c_str() + equals + 1, &end);
    const bool is_number = *end == '\0';
    options.controls[text.substr(0, equals)] =
        is_number ? LibcameraControlValue(number) : text.substr(equals + 1);
  }
  return stream(options, open_libcamera_source, std::atof(argv[6]));
}

using Bytes = std::span<const uint8_t>;

size_t differences(Bytes bytes, int width, int height, auto pixel) {
  size_t wrong = 0, at = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) wrong += bytes[at++] != static_cast<uint8_t>(pixel(x, y));
  }
  return wrong;
}

// The webcam numbers its images in the first four bytes.
size_t wrong_in_webcam(Bytes bytes, int width, int height) {
  size_t wrong = 0;
  for (size_t at = 4; at < bytes.size(); at += 2) {
    const size_t x = at / 2 % static_cast<size_t>(width);
    wrong += bytes[at] != static_cast<uint8_t>(bytes[0] + x) || bytes[at + 1] != 0x80;
  }
  return wrong + (bytes.size() != static_cast<size_t>(width * height) * 2);
}

size_t wrong_in_usb3(Bytes bytes, int width, int height) {
  return differences(bytes, width, height, [&](int x, int) { return bytes[0] + x; });
}

size_t wrong_in_aravis_fake(Bytes bytes, int width, int height) {
  return differences(bytes, width, height, [&](int x, int y) { return (bytes[0] + x + y) % 255; });
}

// Our simulator's images repeat after a period: some number must fit all of it.
size_t wrong_in_simulator(Bytes bytes, int width, int height) {
  static uint64_t number = 0;
  for (uint64_t tries = 0; tries < gige::kPatternPeriod; ++tries, ++number) {
    bool fits = true;
    for (int x = 0; x < 16 && fits; ++x) {
      fits = bytes[static_cast<size_t>(x)] ==
             static_cast<uint8_t>(gige::pattern_value(8, x, 0, number));
    }
    if (fits) break;
  }
  return differences(bytes, width, height,
                     [](int x, int y) { return gige::pattern_value(8, x, y, number); });
}

struct Camera {
  std::string name;
  const char* format;
  int bytes_per_pixel;
  size_t (*wrong)(Bytes bytes, int width, int height);  // that are not what the camera sent
};

const std::array<Camera, 4> kCameras = {{{"uvc", "YUYV", 2, wrong_in_webcam},
                                         {"u3v", "Mono8", 1, wrong_in_usb3},
                                         {"gv", "Mono8", 1, wrong_in_aravis_fake},
                                         {"sim", "Mono8", 1, wrong_in_simulator}}};

bool as_sent(const Camera& camera, const Frame& frame) {
  const Bytes bytes = frame.payload().bytes;
  const int width = frame.info().width, height = frame.info().height;
  return bytes.size() == static_cast<size_t>(width * height * camera.bytes_per_pixel) &&
         camera.wrong(bytes, width, height) == 0;
}

struct OpenCamera {
  std::unique_ptr<FrameSource> source;
  AravisSource* aravis = nullptr;  // source, if it is one
};

Result<OpenCamera> open_camera(const Camera& camera, const V4l2Options& v4l2) {
  OpenCamera open;
  if (camera.name == "uvc") {
    SL_ASSIGN(open.source, open_v4l2_source(v4l2, CameraId(0), "probe"));
    return open;
  }
  AravisOptions options;
  options.id = v4l2.device;
  options.pixel_format = camera.format;
  options.width = v4l2.width;
  options.height = v4l2.height;
  options.rate_hz = 15;
  SL_ASSIGN(auto source, open_aravis_source(options, CameraId(0), "probe"));
  open.aravis = source.get();
  open.source = std::move(source);
  return open;
}

void print_aravis(const AravisStatus& s) {
  std::printf("aravis: lost=%lu incomplete=%lu unusable=%lu resent=%lu missing=%lu\n", s.lost,
              s.incomplete, s.unusable, s.resent_packets, s.missing_packets);
}

int pattern(const char* name, const char* device, const char* size, double seconds) {
  const auto camera = std::find_if(kCameras.begin(), kCameras.end(),
                                   [&](const Camera& c) { return c.name == name; });
  if (camera == kCameras.end()) return 2;
  V4l2Options options;
  options.device = device;
  options.format = camera->format;
  set_size(options, size);
  const Time end = MonotonicClock::now() + from_seconds(seconds);
  unsigned long good = 0, torn = 0, errors = 0;
  while (MonotonicClock::now() < end) {
    auto open = open_camera(*camera, options);
    if (!open) {
      std::printf("error: %s\n", open.error().message().c_str());
      ++errors;
      std::this_thread::sleep_for(250ms);
      continue;
    }
    while (MonotonicClock::now() < end) {
      const auto step = open->source->next({}, 200ms);
      if (!step) {
        std::printf("error: %s\n", step.error().message().c_str());
        ++errors;
        break;
      }
      if (step->frame) ++(as_sent(*camera, *step->frame) ? good : torn);
    }
    if (open->aravis) print_aravis(open->aravis->status());
  }
  std::printf("end: good=%lu torn=%lu errors=%lu\n", good, torn, errors);
  return good == 0 || torn > 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "list") return list(list_v4l2());
  if (what == "formats" && argc == 4) return formats(argv[2], argv[3]);
  if (what == "stream" && argc == 6) {
    return stream_v4l2(argv);
  }
  const std::string which = what == "libcamera" && argc > 2 ? argv[2] : "";
  if (which == "list") return list(list_libcamera());
  if (which == "stream" && argc >= 7) return stream_libcamera(argv);
  if (what == "pattern" && argc == 6) {
    return pattern(argv[2], argv[3], argv[4], std::atof(argv[5]));
  }
  std::fputs("usage: see the head of capture_probe.cpp\n", stderr);
  return 2;
}
