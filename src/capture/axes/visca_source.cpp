// SPDX-License-Identifier: Apache-2.0
//
// VISCA over IP (Sony): UDP; a header of payload type, length and sequence number, then the bytes
// of the serial protocol. The position is asked for some 40 times a second, the zoom now and then.
#include <algorithm>
#include <array>
#include <numbers>

#include "capture/axes/axis_sources.hpp"
#include "capture/axes/visca_messages.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 25ms;
constexpr Duration kPatience = 200ms;                // for an answer
constexpr uint8_t kInquiry = 0x10, kCommand = 0x00;  // payload types
constexpr uint8_t kCanceled = 0x04;                  // an order, by a newer one
constexpr size_t kHeader = 8;

// Also of what a head cannot do, or not now.
bool is_error(std::span<const uint8_t> payload) {
  return payload.size() == 4 && payload[0] == 0x90 && (payload[1] & 0xF0) == 0x60 &&
         payload[3] == 0xFF;
}

class ViscaSource final : public AxisSource {
 public:
  ViscaSource(UdpSocket socket, const AxisSourceOptions& options)
      : socket_(std::move(socket)),
        count_(std::numbers::pi / 180 / options.counts_per_degree),
        fastest_(options.fastest) {}

  Result<std::optional<AxisReading>> next(Duration timeout) override {
    const Time now = MonotonicClock::now();
    if (order_ && answered_) SL_RETURN_IF_ERROR(send_order());
    if (asked_ == Time{} || now - asked_ >= (answered_ ? kPeriod : kPatience)) {
      SL_RETURN_IF_ERROR(ask());
    }
    const Duration wait = asked_ + (answered_ ? kPeriod : kPatience) - MonotonicClock::now();
    std::array<uint8_t, 256> buffer{};
    SL_ASSIGN(const auto length, socket_.receive(buffer, std::clamp<Duration>(wait, 0ms, timeout)));
    if (!length) return std::optional<AxisReading>();
    return take(std::span<const uint8_t>(buffer).first(*length));
  }
  Counts counts() const override { return counts_; }
  void turn(const HeadOrder& order) override { order_ = order; }

 private:
  template <size_t kLength>
  Status send(uint8_t kind, const std::array<uint8_t, kLength>& payload) {
    ++sequence_;
    std::array<uint8_t, kHeader + kLength> message = {0x01, kind, 0, kLength};
    for (size_t i = 0; i < 4; ++i) message[4 + i] = static_cast<uint8_t>(sequence_ >> (24 - 8 * i));
    std::copy(payload.begin(), payload.end(), message.begin() + kHeader);
    return socket_.send(message);
  }

  Status ask() {
    const bool zoom = ++asks_ % kViscaZoomEvery == 1;
    asked_ = MonotonicClock::now();
    answered_ = false;
    asked_zoom_ = zoom;
    SL_RETURN_IF_ERROR(send(kInquiry, zoom ? kViscaAskZoom : kViscaAskPosition));
    question_ = sequence_;
    return {};
  }

  Status send_order() {
    const auto payload = format_visca_order(*order_, count_, fastest_);
    order_.reset();
    ++counts_.ordered;
    SL_RETURN_IF_ERROR(send(kCommand, payload));
    orders_[counts_.ordered % orders_.size()] = sequence_;
    return {};
  }

  // Acknowledged, done, or refused: said of each order, some time later.
  bool is_of_order(uint32_t sequence, std::span<const uint8_t> payload) {
    if (std::find(orders_.begin(), orders_.end(), sequence) == orders_.end()) return false;
    if (is_error(payload) && payload[2] != kCanceled) ++counts_.refused;
    return true;
  }

  // Answers to what was asked before, and what is no answer, say nothing of now.
  std::optional<AxisReading> take(std::span<const uint8_t> message) {
    const auto refuse = [this] {
      ++counts_.bad;
      return std::optional<AxisReading>();
    };
    if (message.size() <= kHeader || message[0] != 0x01 || message[1] != 0x11 ||
        static_cast<size_t>(message[2] << 8 | message[3]) != message.size() - kHeader) {
      return refuse();
    }
    uint32_t sequence = 0;
    for (size_t i = 4; i < 8; ++i) sequence = sequence << 8 | message[i];
    const auto payload = message.subspan(kHeader);
    if (is_of_order(sequence, payload)) return std::nullopt;
    if (answered_ || sequence != question_) return refuse();
    if (asked_zoom_) {
      const auto zoom = parse_visca_zoom(payload);
      if (!zoom && !is_error(payload)) return refuse();
      if (zoom) zoom_ = *zoom;
      answered_ = true;
      asked_ -= kPeriod;  // the position at once
      return std::nullopt;
    }
    const auto position = parse_visca_position(payload);
    if (!position) return refuse();
    answered_ = true;
    ++counts_.good;
    return visca_reading(*position, count_, zoom_, asked_ + (MonotonicClock::now() - asked_) / 2);
  }

  UdpSocket socket_;
  const double count_, fastest_;       ///< [rad], [rad/s]
  std::optional<HeadOrder> order_;     ///< not sent yet
  std::array<uint32_t, 16> orders_{};  ///< sequence numbers of the newest
  Time asked_{};
  bool answered_ = false, asked_zoom_ = false;
  int asks_ = 0;
  uint32_t sequence_ = 0, question_ = 0;
  double zoom_ = 0;
  Counts counts_;
};

}  // namespace

Result<std::unique_ptr<AxisSource>> open_visca(const AxisSourceOptions& options,
                                               const std::string& name) {
  SL_ASSIGN(UdpSocket socket, UdpSocket::connect(options.host, options.port, name));
  return std::unique_ptr<AxisSource>(std::make_unique<ViscaSource>(std::move(socket), options));
}

}  // namespace sightline::capture
