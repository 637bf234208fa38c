// SPDX-License-Identifier: Apache-2.0
// What a frame of 1280x720 costs: the decoders and conversions alone, by format, and (source/...)
// the whole way from poll() on the driver to I420, without what the kernel does.
#include <benchmark/benchmark.h>
#include <turbojpeg.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <random>
#include <vector>

#include "capture/aravis/genicam_formats.hpp"
#include "capture/aravis/genicam_image.hpp"
#include "capture/decode/bayer_decoder.hpp"
#include "capture/decode/fourcc_formats.hpp"
#include "capture/decode/mjpeg_decoder.hpp"
#include "capture/device_tree.hpp"
#include "capture/scripted_v4l2.hpp"
#include "capture/v4l2/v4l2_open.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/image/image.hpp"

namespace sightline::capture {
namespace {

constexpr int kWidth = 1280, kHeight = 720;

// A ramp with some noise, so that the JPEG is neither empty nor incompressible.
std::vector<uint8_t> content(size_t size) {
  std::mt19937 random(1);
  std::vector<uint8_t> bytes(size);
  for (size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<uint8_t>(40 + i / 3 % kWidth / 8 + random() % 12);
  }
  return bytes;
}

void raw(benchmark::State& state, PixelFormat format) {
  const auto bytes = content(*raw_image_bytes(format, kWidth, kHeight, 0));
  Image image(kWidth, kHeight);
  for (auto _ : state) {
    if (!raw_to_i420(format, bytes, 0, image.mutable_view())) std::abort();
  }
}

void bayer(benchmark::State& state, BayerPacking packing) {
  const size_t row = bayer_row_bytes(packing, kWidth);
  const auto bytes = content(row * kHeight);
  BayerDecoder decoder(MosaicPattern::kRggb, packing, kWidth, kHeight);
  Image image(kWidth, kHeight);
  for (auto _ : state) {
    if (!decoder.decode(bytes, static_cast<ptrdiff_t>(row), image.mutable_view())) std::abort();
  }
}

std::vector<uint8_t> jpeg_of(const std::vector<uint8_t>& rgb, int sampling) {
  const tjhandle turbo = tjInitCompress();
  unsigned char* jpeg = nullptr;
  unsigned long size = 0;
  tjCompress2(turbo, rgb.data(), kWidth, 0, kHeight, TJPF_RGB, &jpeg, &size, sampling, 80, 0);
  std::vector<uint8_t> bytes(jpeg, jpeg + size);
  tjFree(jpeg);
  tjDestroy(turbo);
  return bytes;
}

void mjpeg(benchmark::State& state, int sampling) {
  const auto rgb = content(size_t{kWidth} * kHeight * 3);
  const auto jpeg = jpeg_of(rgb, sampling);
  MjpegDecoder decoder;
  Image image(kWidth, kHeight);
  for (auto _ : state) {
    if (!decoder.decode(jpeg, image.mutable_view())) std::abort();
  }
  state.counters["bytes"] = static_cast<double>(jpeg.size());
}

// GigE Vision and USB3 Vision: what these formats add (unpacking) included.
void genicam(benchmark::State& state, const char* name) {
  const GenicamFormat& format = *find_genicam_format(name);
  GenicamImage image(format, kWidth, kHeight, 0);
  const auto bytes = content(image.bytes_needed());
  FrameInfo info;
  for (auto _ : state) {
    const FramePtr frame = image.frame(info, bytes, nullptr);
    benchmark::DoNotOptimize(frame->i420().y.data);
  }
}

// The driver is a script whose buffers are full from the start, so that its work costs nothing.
void source(benchmark::State& state, const char* name) {
  const FourccFormat& format = *find_fourcc_format(std::string_view(name));
  const auto device = std::make_shared<test::ScriptedV4l2>();
  device->modes = {{format.fourcc, kWidth, kHeight, {30}}};
  test::DeviceTree tree;
  tree.add(0, "Bench");
  V4l2Options options;
  options.device = tree.dev("video0");
  options.format = name;
  const auto opened = open_v4l2_source_in(options, CameraId(0), "bench", tree.places(), device);
  if (!opened) {
    state.SkipWithError(opened.error().message().c_str());
    return;
  }
  auto image = content(size_t{kWidth} * kHeight * 3);
  if (format.kind == FormatKind::kMjpeg) image = jpeg_of(image, TJSAMP_422);
  const size_t bytes = std::min<size_t>(image.size(), device->format().sizeimage);
  for (size_t i = 0; i < device->buffers(); ++i) {
    std::copy_n(image.begin(), bytes, device->memory(i));
  }
  test::ScriptedV4l2::Buffer scripted;
  scripted.change = [bytes](v4l2_buffer& buffer) {
    buffer.bytesused = static_cast<uint32_t>(bytes);
  };
  for (auto _ : state) {
    device->send(scripted);
    const auto step = (*opened)->next({}, std::chrono::seconds(1));
    if (!step || !step->frame) std::abort();
    benchmark::DoNotOptimize(step->frame->i420().y.data);
  }
}

BENCHMARK_CAPTURE(raw, i420, PixelFormat::kI420);
BENCHMARK_CAPTURE(raw, nv12, PixelFormat::kNv12);
BENCHMARK_CAPTURE(raw, yuyv, PixelFormat::kYuyv);
BENCHMARK_CAPTURE(raw, uyvy, PixelFormat::kUyvy);
BENCHMARK_CAPTURE(raw, gray, PixelFormat::kGray);
BENCHMARK_CAPTURE(raw, y12, PixelFormat::kY12);
BENCHMARK_CAPTURE(raw, rgb24, PixelFormat::kRgb24);
BENCHMARK_CAPTURE(bayer, srggb8, BayerPacking::k8);
BENCHMARK_CAPTURE(bayer, srggb12, BayerPacking::k12);
BENCHMARK_CAPTURE(bayer, srggb10p, BayerPacking::kPacked10);
BENCHMARK_CAPTURE(genicam, mono8, "Mono8");
BENCHMARK_CAPTURE(genicam, mono12packed, "Mono12Packed");
BENCHMARK_CAPTURE(genicam, mono10p, "Mono10p");
BENCHMARK_CAPTURE(genicam, mono12p, "Mono12p");
BENCHMARK_CAPTURE(genicam, bayerrg8, "BayerRG8");
BENCHMARK_CAPTURE(genicam, bayerrg12p, "BayerRG12p");
BENCHMARK_CAPTURE(mjpeg, mjpeg_420, TJSAMP_420);
BENCHMARK_CAPTURE(mjpeg, mjpeg_422, TJSAMP_422);

#define SOURCE(format) BENCHMARK_CAPTURE(source, format, #format)
SOURCE(YUYV);
SOURCE(UYVY);
SOURCE(NV12);
SOURCE(YUV420);
SOURCE(GRAY);
SOURCE(Y10);
SOURCE(Y12);
SOURCE(Y16);
SOURCE(RGB24);
SOURCE(BGR24);
SOURCE(SRGGB8);
SOURCE(SRGGB10);
SOURCE(SRGGB12);
SOURCE(SRGGB16);
SOURCE(SRGGB10P);
SOURCE(SRGGB12P);
SOURCE(MJPEG);
#undef SOURCE

}  // namespace
}  // namespace sightline::capture
