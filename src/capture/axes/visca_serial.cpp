// SPDX-License-Identifier: Apache-2.0
//
// VISCA over a serial line: one question at a time, as fast as the line takes it, at 9600 bits per
// second some 30 a second.
#include <algorithm>
#include <numbers>
#include <thread>

#include "capture/axes/axis_sources.hpp"
#include "capture/axes/visca_line.hpp"
#include "capture/axes/visca_messages.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 25ms;
constexpr int kMostFailures = 10;  // in a row

// As camera 1 says it over IP.
std::span<const uint8_t> as_of_first(ViscaMessage& message) {
  message.bytes[0] = 0x90;
  return message.span();
}

class ViscaSerialSource final : public AxisSource {
 public:
  ViscaSerialSource(std::shared_ptr<ViscaLine> line, const AxisSourceOptions& options,
                    std::string name)
      : line_(std::move(line)),
        path_(options.line),
        name_(std::move(name)),
        camera_(options.device),
        count_(std::numbers::pi / 180 / options.counts_per_degree),
        fastest_(options.fastest) {}

  Result<std::optional<AxisReading>> next(Duration timeout) override {
    if (order_) SL_RETURN_IF_ERROR(send_order());
    const Duration early = asked_ + kPeriod - MonotonicClock::now();
    if (early > timeout) {
      std::this_thread::sleep_for(timeout);
      return std::optional<AxisReading>();
    }
    if (early > 0ms) std::this_thread::sleep_for(early);
    asked_ = MonotonicClock::now();
    const bool zoom = ++asks_ % kViscaZoomEvery == 0;
    SL_ASSIGN(auto answer, line_->exchange(camera_, zoom ? kViscaAskZoom : kViscaAskPosition));
    counts_.refused += line_->take_refused(camera_);
    if (!answer) return failed();
    const auto payload = as_of_first(answer->message);
    if (zoom) {  // cameras without one refuse
      zoom_ = parse_visca_zoom(payload).value_or(static_cast<int>(zoom_));
      return std::optional<AxisReading>();
    }
    const auto position = parse_visca_position(payload);
    if (!position) return failed();
    failures_ = 0;
    ++counts_.good;
    return std::optional(visca_reading(*position, count_, zoom_, answer->stamp));
  }
  Counts counts() const override { return counts_; }
  void turn(const HeadOrder& order) override { order_ = order; }

 private:
  Result<std::optional<AxisReading>> failed() {
    ++counts_.bad;
    if (++failures_ < kMostFailures) return std::optional<AxisReading>();
    const int there = line_->cameras();
    return make_error(ErrorCode::kUnavailable, name_,
                      "camera {} on the serial line {} does not answer{}; check cable, power and "
                      "axes_baud",
                      camera_, path_,
                      there > 0 ? fmt::format(", which gave addresses to {}", there) : "");
  }

  Status send_order() {
    const auto message = format_visca_order(*order_, count_, fastest_);
    order_.reset();
    ++counts_.ordered;
    SL_ASSIGN(const auto answer, line_->exchange(camera_, message));
    if (answer && kind_of(answer->message.span()) == ViscaKind::kRefused) ++counts_.refused;
    if (!answer) ++counts_.bad;
    return {};
  }

  const std::shared_ptr<ViscaLine> line_;
  const std::string path_, name_;
  const int camera_;
  const double count_, fastest_;    ///< [rad], [rad/s]
  std::optional<HeadOrder> order_;  ///< not sent yet
  Time asked_{};
  int asks_ = 0, failures_ = 0;
  double zoom_ = 0;
  Counts counts_;
};

}  // namespace

Result<std::unique_ptr<AxisSource>> open_visca_serial(const AxisSourceOptions& options,
                                                      const std::string& name) {
  SL_ASSIGN(auto line, ViscaLine::open(options.line, options.baud, name));
  return std::unique_ptr<AxisSource>(
      std::make_unique<ViscaSerialSource>(std::move(line), options, name));
}

}  // namespace sightline::capture
