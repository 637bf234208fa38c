// SPDX-License-Identifier: Apache-2.0
#include "camera.hpp"

#include <algorithm>
#include <bit>
#include <cinttypes>
#include <cmath>
#include <limits>

namespace sightline::gige {
namespace {

constexpr int64_t kMillisecond = 1'000'000;
constexpr size_t kChunkTail = 8;  // id and length
constexpr size_t kChunkBytes = 8;
constexpr size_t kIpAndUdp = 28;
constexpr int64_t kPtpListens = 300 * kMillisecond, kPtpCalibrates = 600 * kMillisecond;

int64_t to_ns(double us) { return std::llround(us * 1e3); }

void append_u32(std::vector<uint8_t>& bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<uint8_t>(value >> shift));
}

void append_chunk(std::vector<uint8_t>& bytes, Chunk id, uint64_t value) {
  append_u32(bytes, static_cast<uint32_t>(value >> 32));
  append_u32(bytes, static_cast<uint32_t>(value));
  append_u32(bytes, static_cast<uint32_t>(id));
  append_u32(bytes, kChunkBytes);
}

}  // namespace

Camera::Camera(const CameraOptions& options, Registers& registers, Streamer& streamer,
               Faults& faults, std::mt19937_64& random)
    : options_(options),
      registers_(registers),
      streamer_(streamer),
      faults_(faults),
      random_(random),
      clock_(options.tick_hz, options.drift_ppm, host_now_ns()),
      next_id_(options.first_id) {
  Registers& r = registers_;
  const auto width = static_cast<uint32_t>(options.width);
  const auto height = static_cast<uint32_t>(options.height);
  r.set_u32(reg::kWidth, width);
  r.set_u32(reg::kHeight, height);
  r.set_u32(reg::kSensorWidth, width);
  r.set_u32(reg::kSensorHeight, height);
  const WireFormat* const wanted = find_wire_format(options.pixel_format);
  r.set_u32(reg::kPixelFormat, wanted != nullptr ? wanted->code : wire_formats().front().code);
  r.set_f64(reg::kFrameRate, options.rate_hz);
  r.set_f64(reg::kExposureTime, options.exposure_us);
  r.set_u32(reg::kFrameRateEnable, 1);
  r.set_u32(reg::kFrameCount, 1);
  r.set_u32(reg::kLineMode + 4, 1);
  r.set_u32(reg::kLineSource + 4, 1);  // Line2 gives the strobe
  if (!options.truth.empty()) truth_ = std::fopen(options.truth.c_str(), "we");
}

Camera::~Camera() {
  if (truth_ != nullptr) std::fclose(truth_);
}

const WireFormat& Camera::format() const {
  const WireFormat* const found = find_wire_format(registers_.u32(reg::kPixelFormat));
  return found != nullptr ? *found : wire_formats().front();
}

int64_t Camera::period_ns() const {
  return std::llround(1e9 / std::clamp(registers_.f64(reg::kFrameRate), 0.1, 1000.0));
}

int64_t Camera::next_on_grid(int64_t after_ns, int64_t period, double phase_ms) const {
  const int64_t phase = std::llround(phase_ms * 1e6);
  return ((after_ns - phase) / period + 1) * period + phase;
}

uint32_t Camera::payload_bytes() const {
  size_t bytes = image_bytes(format(), static_cast<int>(registers_.u32(reg::kWidth)),
                             static_cast<int>(registers_.u32(reg::kHeight)));
  if (registers_.u32(reg::kChunkMode) != 0) {
    bytes += kChunkTail;
    for (uint32_t i = 1; i < 4; ++i) {
      if (registers_.u32(reg::kChunkEnable + 4 * i) != 0) bytes += kChunkBytes + kChunkTail;
    }
  }
  return static_cast<uint32_t>(bytes);
}

void Camera::written(uint32_t address, int64_t now_ns) {
  Registers& r = registers_;
  const uint32_t value = r.contains(address, 4) ? r.u32(address) : 0;
  switch (address) {
    case reg::kAcquisition:
      if (value == 1) start(now_ns);
      if (value == 2) stop();
      break;
    case reg::kTriggerSoftware:
      trigger(Trigger::kSoftware, now_ns);
      break;
    case reg::kTimestampControl:
      if ((value & 1) != 0) clock_.reset(now_ns);
      if ((value & 2) != 0) r.set_u64(reg::kLatchedHigh, stamp(now_ns));
      r.set_u32(address, 0);
      break;
    case reg::kPacketSize:
      if ((value & 1u << 31) != 0) {
        r.set_u32(address, value & ~(1u << 31));
        const auto size = static_cast<int>(value & 0xFFFF);
        if (size <= options_.mtu) streamer_.send_test(static_cast<size_t>(size));
      }
      break;
    case reg::kStreamPort:
    case reg::kStreamAddress:
      streamer_.set_destination({htonl(r.u32(reg::kStreamAddress))},
                                static_cast<uint16_t>(r.u32(reg::kStreamPort)));
      break;
    case reg::kPtpEnable:
      ptp_since_ns_ = now_ns;
      update_ptp(now_ns);
      break;
    default:
      break;
  }
}

void Camera::about_to_read(uint32_t address, int64_t now_ns) {
  if (address == reg::kPayloadSize) registers_.set_u32(address, payload_bytes());
  if (address == reg::kPtpStatus || address == reg::kPtpOffset) update_ptp(now_ns);
}

void Camera::update_ptp(int64_t now_ns) {
  uint32_t status = 0;
  if (registers_.u32(reg::kPtpEnable) != 0) {
    const int64_t since = now_ns - ptp_since_ns_;
    const uint32_t settled = options_.ptp_master ? 3 : 4;
    status = since < kPtpListens ? 1 : since < kPtpCalibrates && options_.ptp_master ? 2 : settled;
  }
  registers_.set_u32(reg::kPtpStatus, status);
  clock_.set_ptp(status == 3);
  const int64_t offset =
      status == 3 ? std::uniform_int_distribution<int64_t>(-200, 200)(random_) : 0;
  registers_.set_u64(reg::kPtpOffset, static_cast<uint64_t>(offset));
}

void Camera::start(int64_t now_ns) {
  streaming_ = true;
  exposed_ = 0;
  busy_until_ns_ = 0;
  next_exposure_ns_ = 0;
  if (!triggered()) {
    next_exposure_ns_ = next_on_grid(now_ns + kMillisecond, period_ns(), options_.phase_ms);
  } else if (registers_.u32(reg::kTriggerSource) == static_cast<uint32_t>(Trigger::kLine1) &&
             options_.line1_hz > 0) {
    next_exposure_ns_ = next_on_grid(now_ns, std::llround(1e9 / options_.line1_hz), 0);
  }
}

void Camera::stop() {
  streaming_ = false;
  next_exposure_ns_ = scheduled_trigger_ns_ = 0;
  streamer_.forget();
}

void Camera::trigger(Trigger source, int64_t at_ns) {
  const uint32_t wanted = registers_.u32(reg::kTriggerSource);
  if (!streaming_ || !triggered() || wanted != static_cast<uint32_t>(source)) return;
  scheduled_trigger_ns_ = at_ns + to_ns(registers_.f64(reg::kTriggerDelay));
}

int64_t Camera::next_due() const {
  int64_t due = std::numeric_limits<int64_t>::max();
  if (next_exposure_ns_ > 0) due = next_exposure_ns_;
  if (scheduled_trigger_ns_ > 0) due = std::min(due, scheduled_trigger_ns_);
  return due;
}

void Camera::run(int64_t now_ns) {
  if (ptp_since_ns_ > 0) update_ptp(now_ns);
  if (scheduled_trigger_ns_ > 0 && scheduled_trigger_ns_ <= now_ns) {
    const int64_t at = scheduled_trigger_ns_;
    scheduled_trigger_ns_ = 0;
    expose(at);
  }
  while (next_exposure_ns_ > 0 && next_exposure_ns_ <= now_ns) {
    const int64_t at = next_exposure_ns_;
    const int64_t period =
        triggered() ? std::llround(1e9 / options_.line1_hz) : clock_.host_duration(period_ns());
    next_exposure_ns_ = at + period;
    // After it was stopped for a while, it does not make up for what it missed.
    if (now_ns - at > 3 * period) {
      next_exposure_ns_ += (now_ns - at) / period * period;
      continue;
    }
    expose(at);
  }
}

uint64_t Camera::ticks_as_ns(uint64_t ticks) const {
  const uint64_t hz = options_.tick_hz;
  return ticks / hz * 1'000'000'000 + ticks % hz * 1'000'000'000 / hz;
}

uint64_t Camera::stamp(int64_t at_ns) {
  if (faults_.stamp_jitter_ns > 0) {
    std::normal_distribution<double> noise(0, static_cast<double>(faults_.stamp_jitter_ns));
    at_ns += std::llround(noise(random_));
  }
  return clock_.ticks(at_ns);
}

void Camera::expose(int64_t start_ns) {
  if (!streaming_ || start_ns < busy_until_ns_) return;
  const double exposure_us = registers_.f64(reg::kExposureTime);
  const int64_t end_ns = start_ns + to_ns(exposure_us);
  busy_until_ns_ = end_ns;
  const Registers& r = registers_;
  auto frame = std::make_shared<OutFrame>();
  frame->extended_ids = r.u32(reg::kExtendedIds) != 0;
  if (!frame->extended_ids && (next_id_ & 0xFFFF) == 0) ++next_id_;  // 0 is no number
  frame->block_id = frame->extended_ids ? next_id_ : next_id_ & 0xFFFF;
  ++next_id_;
  frame->pixel_format = format().code;
  frame->width = r.u32(reg::kWidth);
  frame->height = r.u32(reg::kHeight);
  frame->offset_x = r.u32(reg::kOffsetX);
  frame->offset_y = r.u32(reg::kOffsetY);
  frame->stamp = faults_.no_stamp ? 0 : stamp(options_.stamp_end ? end_ns : start_ns);
  draw_pattern(format(), static_cast<int>(frame->width), static_cast<int>(frame->height), exposed_,
               frame->payload);
  if (r.u32(reg::kChunkMode) != 0) add_chunks(*frame, exposure_us);
  const size_t header = frame->extended_ids ? 20 : 8;
  frame->packet_bytes = (r.u32(reg::kPacketSize) & 0xFFFF) - kIpAndUdp - header;
  const auto chance = [&](double share) {
    return std::uniform_real_distribution<double>(0, 1)(random_) < share;
  };
  frame->short_leader = chance(faults_.short_leader);
  frame->wrong_size = chance(faults_.wrong_size);
  if (truth_ != nullptr) {
    std::fprintf(truth_, "%" PRIu64 " %" PRIu64 " %" PRIu64 " %" PRId64 " %" PRId64 "\n", exposed_,
                 frame->block_id, ticks_as_ns(frame->stamp), start_ns, end_ns);
    std::fflush(truth_);
  }
  ++exposed_;
  int64_t ready = end_ns + to_ns(options_.readout_us);
  if (faults_.jitter_ns > 0) {
    std::exponential_distribution<double> late(1.0 / static_cast<double>(faults_.jitter_ns));
    ready += std::llround(late(random_));
  }
  // A tick of the delay register is one of the time stamp's.
  streamer_.set_gap(static_cast<int64_t>(ticks_as_ns(r.u32(reg::kPacketDelay))));
  streamer_.send(std::move(frame), ready);
  const uint32_t mode = r.u32(reg::kAcquisitionMode);
  if (mode != 0 && exposed_ >= (mode == 1 ? 1 : r.u32(reg::kFrameCount))) {
    streaming_ = false;
    next_exposure_ns_ = 0;
  }
}

void Camera::add_chunks(OutFrame& frame, double exposure_us) {
  frame.chunks = true;
  const auto image = static_cast<uint32_t>(frame.payload.size());
  append_u32(frame.payload, static_cast<uint32_t>(Chunk::kImage));
  append_u32(frame.payload, image);
  const auto enabled = [&](uint32_t i) { return registers_.u32(reg::kChunkEnable + 4 * i) != 0; };
  if (enabled(1)) append_chunk(frame.payload, Chunk::kTimestamp, frame.stamp);
  if (enabled(2)) {
    append_chunk(frame.payload, Chunk::kExposureTime, std::bit_cast<uint64_t>(exposure_us));
  }
  if (enabled(3)) append_chunk(frame.payload, Chunk::kFrameId, frame.block_id);
}

}  // namespace sightline::gige
