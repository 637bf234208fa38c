// SPDX-License-Identifier: Apache-2.0
#include "capture/v4l2/v4l2_device.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <numeric>

#include "sightline/base/log.hpp"
#include "sightline/image/convert.hpp"

namespace sightline::capture {
namespace {

constexpr uint32_t kMaxEntries = 512;  // bounds the lists of a driver that never ends them
constexpr double kUsualRate = 30;

std::string text_of(const uint8_t* bytes, size_t size) {
  return {reinterpret_cast<const char*>(bytes),
          static_cast<size_t>(std::find(bytes, bytes + size, uint8_t{0}) - bytes)};
}

double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0
                                 : static_cast<double>(interval.denominator) / interval.numerator;
}

std::vector<double> rates_of(const V4l2Device& device, uint32_t fourcc, uint32_t width,
                             uint32_t height) {
  std::vector<double> rates;
  for (uint32_t i = 0; i < kMaxEntries; ++i) {
    v4l2_frmivalenum entry{};
    entry.index = i;
    entry.pixel_format = fourcc;
    entry.width = width;
    entry.height = height;
    if (device.call(VIDIOC_ENUM_FRAMEINTERVALS, entry) < 0) break;
    if (entry.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      rates.push_back(rate_of(entry.discrete));
      continue;
    }
    rates = {rate_of(entry.stepwise.max), rate_of(entry.stepwise.min)};
    break;
  }
  std::erase_if(rates, [](double rate) { return rate <= 0; });
  std::sort(rates.begin(), rates.end());
  return rates;
}

void add_sizes(const V4l2Device& device, uint32_t fourcc, std::vector<V4l2Mode>& modes) {
  for (uint32_t i = 0; i < kMaxEntries; ++i) {
    v4l2_frmsizeenum entry{};
    entry.index = i;
    entry.pixel_format = fourcc;
    if (device.call(VIDIOC_ENUM_FRAMESIZES, entry) < 0) break;
    const bool discrete = entry.type == V4L2_FRMSIZE_TYPE_DISCRETE;
    const uint32_t width = discrete ? entry.discrete.width : entry.stepwise.max_width;
    const uint32_t height = discrete ? entry.discrete.height : entry.stepwise.max_height;
    const uint32_t min_width = discrete ? width : entry.stepwise.min_width;
    const uint32_t min_height = discrete ? height : entry.stepwise.min_height;
    modes.push_back({fourcc, static_cast<int>(width), static_cast<int>(height),
                     static_cast<int>(min_width), static_cast<int>(min_height),
                     rates_of(device, fourcc, width, height)});
    if (!discrete) break;
  }
}

std::string list_of(const std::vector<V4l2Mode>& modes) {
  std::string text;
  for (const V4l2Mode& mode : modes) {
    if (!text.empty()) text += ", ";
    text += fmt::format("{} {}x{}", fourcc_name(mode.fourcc), mode.width, mode.height);
    if (!mode.rates_hz.empty()) text += fmt::format(" up to {:g}/s", mode.rates_hz.back());
  }
  return text.empty() ? "nothing" : text;
}

Result<v4l2_format> current_format(const V4l2Device& device) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (const int r = device.call(VIDIOC_G_FMT, format); r < 0) {
    return device.error(V4l2Step::kQuery, r);
  }
  return format;
}

double best_rate(const V4l2Mode& mode) { return mode.rates_hz.empty() ? 0 : mode.rates_hz.back(); }

// The first format, in order of preference, that gives the size at the rate.
Result<const FourccFormat*> choose_format(const V4l2Device& device,
                                          const std::vector<V4l2Mode>& modes, int width, int height,
                                          double rate_hz) {
  std::vector<std::pair<const FourccFormat*, double>> able;
  double reach = 0;
  for (const FourccFormat& format : fourcc_formats()) {
    for (const V4l2Mode& mode : modes) {
      if (mode.fourcc != format.fourcc || !mode.has_size(width, height)) continue;
      // A rate that the driver does not tell is taken on trust.
      const double rate = mode.rates_hz.empty() ? std::max(rate_hz, kUsualRate) : best_rate(mode);
      able.emplace_back(&format, rate);
      reach = std::max(reach, rate);
    }
  }
  const double least_rate = rate_hz > 0 ? rate_hz : std::min(reach, kUsualRate);
  for (const auto& [format, rate] : able) {
    if (rate >= 0.99 * least_rate) return format;
  }
  return make_error(ErrorCode::kInvalidInput, device.where(),
                    "{} ({}) has no usable format for {}x{}{}; it has: {}", device.path(),
                    device.card(), width, height,
                    rate_hz > 0 ? fmt::format(" at {:g}/s", rate_hz) : "", list_of(modes));
}

Result<const FourccFormat*> named_format(const V4l2Device& device, const std::string& name) {
  const FourccFormat* const format = find_fourcc_format(std::string_view(name));
  if (!format) {
    return make_error(ErrorCode::kInvalidInput, device.where(),
                      "unknown pixel format '{}'; {} ({}) has: {}", name, device.path(),
                      device.card(), list_of(v4l2_modes(device)));
  }
  return format;
}

Error other_than_asked(const V4l2Device& device, const FourccFormat& asked, int width, int height,
                       const v4l2_pix_format& got) {
  return make_error(ErrorCode::kInvalidInput, device.where(),
                    "{} ({}) gives {} {}x{} when asked for {} {}x{}; it has: {}", device.path(),
                    device.card(), fourcc_name(got.pixelformat), got.width, got.height, asked.name,
                    width, height, list_of(v4l2_modes(device)));
}

Result<StreamFormat> layout_of(const V4l2Device& device, const FourccFormat& format,
                               const v4l2_pix_format& pix) {
  auto stream = stream_format(format, static_cast<int>(pix.width), static_cast<int>(pix.height),
                              static_cast<ptrdiff_t>(pix.bytesperline));
  if (!stream) {
    return make_error(ErrorCode::kIo, device.where(), "the driver of {} is inconsistent: {}",
                      device.path(), stream.error().text);
  }
  if (stream->layout.image_bytes > pix.sizeimage) {
    return make_error(ErrorCode::kIo, device.where(),
                      "the driver of {} is inconsistent: an image of {} bytes in a buffer of {}",
                      device.path(), stream->layout.image_bytes, pix.sizeimage);
  }
  return stream;
}

v4l2_fract interval_of(double rate_hz) {
  const auto thousandths = static_cast<uint32_t>(std::lround(rate_hz * 1000));
  const uint32_t common = std::gcd(thousandths, 1000u);
  return {1000u / common, thousandths / common};
}

// Sets the rate if one is asked for; gives the rate in force, 0 if the driver does not say.
Result<double> set_rate(const V4l2Device& device, double rate_hz) {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (device.call(VIDIOC_G_PARM, parameters) < 0) return 0.0;
  v4l2_captureparm& capture = parameters.parm.capture;
  if (rate_hz > 0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
    capture.timeperframe = interval_of(rate_hz);
    if (const int r = device.call(VIDIOC_S_PARM, parameters); r < 0) {
      return device.error(V4l2Step::kFormat, r);
    }
  }
  const double got = rate_of(capture.timeperframe);
  if (rate_hz > 0 && got > 0 && std::abs(got - rate_hz) > 0.01 * rate_hz) {
    log::warning("{}: {} gives {:g} frames/s when asked for {:g}", device.where(), device.path(),
                 got, rate_hz);
  }
  return got;
}

}  // namespace

V4l2Device::V4l2Device(std::shared_ptr<V4l2System> system, int fd, std::string path,
                       std::string where)
    : system_(std::move(system)), fd_(fd), path_(std::move(path)), where_(std::move(where)) {}

V4l2Device::V4l2Device(V4l2Device&& other) noexcept
    : system_(std::move(other.system_)),
      fd_(std::exchange(other.fd_, -1)),
      path_(std::move(other.path_)),
      where_(std::move(other.where_)),
      card_(std::move(other.card_)) {}

void V4l2Device::close() {
  const Waiting wait("the camera");
  if (fd_ >= 0) system_->close(std::exchange(fd_, -1));
}

std::string V4l2Device::description() const {
  return card_.empty() ? path_ : fmt::format("{} ({})", path_, card_);
}

Error V4l2Device::error(V4l2Step step, int negative_errno) const {
  return v4l2_error(step, -negative_errno, where_, description());
}

Result<V4l2Device> V4l2Device::open(std::shared_ptr<V4l2System> system, const std::string& path,
                                    const std::string& where) {
  const int fd = system->open(path.c_str());
  if (fd < 0) return v4l2_error(V4l2Step::kOpen, -fd, where, path);
  V4l2Device device(std::move(system), fd, path, where);
  v4l2_capability capability{};
  if (const int r = device.call(VIDIOC_QUERYCAP, capability); r < 0) {
    return device.error(V4l2Step::kQuery, r);
  }
  device.card_ = text_of(capability.card, sizeof capability.card);
  const uint32_t able = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                            ? capability.device_caps
                            : capability.capabilities;
  if ((able & V4L2_CAP_VIDEO_CAPTURE) == 0) {
    return make_error(
        ErrorCode::kUnavailable, where, "{} ({}) {}", path, device.card_,
        (able & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0
            ? "has the multi-planar interface only; use it through libcamera"
            : "does not capture images (metadata or output node); `sightline cameras` lists the "
              "nodes that do");
  }
  if ((able & V4L2_CAP_STREAMING) == 0) {
    return make_error(ErrorCode::kUnavailable, where,
                      "the driver of {} ({}) has no memory-mapped streaming", path, device.card_);
  }
  return device;
}

std::vector<V4l2Mode> v4l2_modes(const V4l2Device& device) {
  std::vector<V4l2Mode> modes;
  for (uint32_t i = 0; i < kMaxEntries; ++i) {
    v4l2_fmtdesc description{};
    description.index = i;
    description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (device.call(VIDIOC_ENUM_FMT, description) < 0) break;
    if ((description.flags & V4L2_FMT_FLAG_EMULATED) == 0) {
      add_sizes(device, description.pixelformat, modes);
    }
  }
  return modes;
}

Result<StreamFormat> negotiate_v4l2(const V4l2Device& device, const V4l2Options& options) {
  SL_ASSIGN(v4l2_format request, current_format(device));
  v4l2_pix_format& pix = request.fmt.pix;
  const bool sized = options.width > 0 && options.height > 0;
  const int width = sized ? options.width : static_cast<int>(pix.width);
  const int height = sized ? options.height : static_cast<int>(pix.height);
  const FourccFormat* format = nullptr;
  if (options.format.empty() || options.format == "auto") {
    SL_ASSIGN(format, choose_format(device, v4l2_modes(device), width, height, options.rate_hz));
  } else {
    SL_ASSIGN(format, named_format(device, options.format));
  }

  pix = {};
  pix.width = static_cast<uint32_t>(width);
  pix.height = static_cast<uint32_t>(height);
  pix.pixelformat = format->fourcc;
  pix.field = V4L2_FIELD_NONE;
  if (const int r = device.call(VIDIOC_S_FMT, request); r < 0) {
    return device.error(V4l2Step::kFormat, r);
  }
  if (pix.pixelformat != format->fourcc || pix.width != static_cast<uint32_t>(width) ||
      pix.height != static_cast<uint32_t>(height)) {
    return other_than_asked(device, *format, width, height, pix);
  }
  if (V4L2_FIELD_IS_INTERLACED(pix.field) || V4L2_FIELD_HAS_T_OR_B(pix.field)) {
    return make_error(ErrorCode::kInvalidInput, device.where(),
                      "{} ({}) sends interlaced images; choose a progressive mode", device.path(),
                      device.card());
  }
  SL_ASSIGN(StreamFormat stream, layout_of(device, *format, pix));
  SL_ASSIGN(stream.layout.rate_hz, set_rate(device, options.rate_hz));
  return stream;
}

}  // namespace sightline::capture
