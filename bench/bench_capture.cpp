// SPDX-License-Identifier: Apache-2.0
// What a frame of 1280x720 costs from the camera's bytes to I420, by format.
#include <benchmark/benchmark.h>
#include <turbojpeg.h>

#include <cstdlib>
#include <random>
#include <vector>

#include "bayer_decoder.hpp"
#include "genicam_formats.hpp"
#include "genicam_picture.hpp"
#include "mjpeg_decoder.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/image/picture.hpp"

namespace sightline {
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
  const auto bytes = content(*raw_picture_bytes(format, kWidth, kHeight, 0));
  Picture picture(kWidth, kHeight);
  for (auto _ : state) {
    if (!raw_to_i420(format, bytes, 0, picture.mutable_view())) std::abort();
  }
}

void bayer(benchmark::State& state, BayerPacking packing) {
  const size_t row = bayer_row_bytes(packing, kWidth);
  const auto bytes = content(row * kHeight);
  BayerDecoder decoder(MosaicPattern::kRggb, packing, kWidth, kHeight);
  Picture picture(kWidth, kHeight);
  for (auto _ : state) {
    if (!decoder.decode(bytes, static_cast<ptrdiff_t>(row), picture.mutable_view())) std::abort();
  }
}

void mjpeg(benchmark::State& state, int sampling) {
  const auto rgb = content(size_t{kWidth} * kHeight * 3);
  const tjhandle turbo = tjInitCompress();
  unsigned char* jpeg = nullptr;
  unsigned long size = 0;
  tjCompress2(turbo, rgb.data(), kWidth, 0, kHeight, TJPF_RGB, &jpeg, &size, sampling, 80, 0);
  MjpegDecoder decoder;
  Picture picture(kWidth, kHeight);
  for (auto _ : state) {
    if (!decoder.decode({jpeg, size}, picture.mutable_view())) std::abort();
  }
  state.counters["bytes"] = static_cast<double>(size);
  tjFree(jpeg);
  tjDestroy(turbo);
}

// GigE Vision and USB3 Vision: what these formats add (unpacking) included.
void genicam(benchmark::State& state, const char* name) {
  const GenicamFormat& format = *find_genicam_format(name);
  GenicamPicture picture(format, kWidth, kHeight, 0);
  const auto bytes = content(picture.bytes_needed());
  FrameInfo info;
  for (auto _ : state) {
    const FramePtr frame = picture.frame(info, bytes, nullptr);
    benchmark::DoNotOptimize(frame->i420().y.data);
  }
}

BENCHMARK_CAPTURE(raw, i420, PixelFormat::kI420);
BENCHMARK_CAPTURE(raw, nv12, PixelFormat::kNv12);
BENCHMARK_CAPTURE(raw, yuyv, PixelFormat::kYuyv);
BENCHMARK_CAPTURE(raw, uyvy, PixelFormat::kUyvy);
BENCHMARK_CAPTURE(raw, grey, PixelFormat::kGrey);
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

}  // namespace
}  // namespace sightline
