// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <functional>
#include <random>
#include <string>

#include "clock.hpp"
#include "faults.hpp"
#include "pattern.hpp"
#include "registers.hpp"
#include "streamer.hpp"

namespace sightline::gige {

struct CameraOptions {
  std::string serial = "SIM1", user_name, model = "Simulator";
  int width = 640, height = 480;  ///< of the sensor
  double rate_hz = 25;
  double exposure_us = 5000;
  std::string pixel_format = "Mono8";
  double phase_ms = 0;  ///< of free-running exposures, on the grid of CLOCK_MONOTONIC
  double readout_us = 2000;
  double line1_hz = 0;  ///< an outside trigger on Line1; all simulators see the same one
  uint64_t tick_hz = 1'000'000'000;
  double drift_ppm = 0;
  uint64_t first_id = 1;
  int mtu = 9000;          ///< larger test packets get lost
  bool stamp_end = false;  ///< stamps at the end of exposure
  bool without_latch = false;
  bool ptp_master = true;  ///< somebody on the network is the PTP master
  std::string truth;       ///< file for the exposures; empty: none
};

/// The camera behind the registers: exposes when it is time or when it is triggered, and hands
/// frames to the streamer. Single thread; times are CLOCK_MONOTONIC in nanoseconds.
class Camera {
 public:
  Camera(const CameraOptions& options, Registers& registers, Streamer& streamer, Faults& faults,
         std::mt19937_64& random);
  ~Camera();
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;

  /// After the host wrote there, before the host reads there.
  void written(uint32_t address, int64_t now_ns);
  void about_to_read(uint32_t address, int64_t now_ns);

  enum class Trigger : uint32_t { kSoftware = 0, kLine1 = 1, kLine2 = 2, kAction = 3 };
  void trigger(Trigger source, int64_t at_ns);
  void stop();

  DeviceClock& clock() { return clock_; }
  void set_next_id(uint64_t id) { next_id_ = id; }
  void set_rate(double hz) { registers_.set_f64(reg::kFrameRate, hz); }
  bool streaming() const { return streaming_; }

  int64_t next_due() const;
  void run(int64_t now_ns);

 private:
  void start(int64_t now_ns);
  void expose(int64_t start_ns);
  void add_chunks(OutFrame& frame, double exposure_us);
  uint64_t stamp(int64_t at_ns);
  uint64_t ticks_as_ns(uint64_t ticks) const;
  uint32_t payload_bytes() const;
  bool triggered() const { return registers_.u32(reg::kTriggerMode) != 0; }
  int64_t period_ns() const;
  int64_t next_on_grid(int64_t after_ns, int64_t period, double phase_ms) const;
  void update_ptp(int64_t now_ns);
  const WireFormat& format() const;

  const CameraOptions options_;
  Registers& registers_;
  Streamer& streamer_;
  Faults& faults_;
  std::mt19937_64& random_;
  DeviceClock clock_;
  std::FILE* truth_ = nullptr;
  bool streaming_ = false;
  int64_t next_exposure_ns_ = 0;  ///< of itself or by Line1; 0: none
  int64_t busy_until_ns_ = 0;
  int64_t scheduled_trigger_ns_ = 0;
  int64_t ptp_since_ns_ = 0;
  uint64_t next_id_;
  uint64_t exposed_ = 0;  ///< since the start of acquisition
  std::vector<uint8_t> image_;
};

}  // namespace sightline::gige
