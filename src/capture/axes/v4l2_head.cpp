// SPDX-License-Identifier: Apache-2.0
//
// Pan, tilt and zoom of a camera of the kernel (UVC and others) by its controls: pan_absolute and
// tilt_absolute in arc seconds, positive to the right and up; pan_speed and tilt_speed in the
// driver's own steps, 0 stops (Linux media, userspace API, camera control reference). Read some 30
// times a second: not every driver sends events of what moves by itself.
#include "capture/axes/v4l2_head.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "capture/axes/axis_sources.hpp"
#include "capture/axes/rate_order.hpp"
#include "capture/v4l2/v4l2_device.hpp"
#include "sightline/base/log.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 33ms;
constexpr Duration kRepeat = 500ms;  // of what has been set already
constexpr int kMostFailures = 5;     // in a row
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kFar = 0.5 * kDegree;  // further than this even the slowest rate is of use

struct Control {
  uint32_t id = 0;  ///< 0: the camera has none
  int64_t low = 0, high = 0, step = 1;
  bool readable = false, writable = false;

  // The nearest value that it takes.
  int64_t nearest(double value) const {
    const double inside = std::clamp(value, static_cast<double>(low), static_cast<double>(high));
    const double steps =
        std::round((inside - static_cast<double>(low)) / static_cast<double>(step));
    const int64_t rounded = low + static_cast<int64_t>(steps) * step;
    return rounded > high ? rounded - step : rounded;
  }
};

Control control_of(const V4l2Device& device, uint32_t id) {
  v4l2_query_ext_ctrl query{};
  query.id = id;
  if (device.call(VIDIOC_QUERY_EXT_CTRL, query) < 0) return {};
  const uint32_t flags = query.flags;
  if ((flags & V4L2_CTRL_FLAG_DISABLED) != 0 || query.maximum < query.minimum) return {};
  Control control{id, query.minimum, query.maximum, 1, true, true};
  control.step = std::max<int64_t>(static_cast<int64_t>(query.step), 1);
  control.readable = (flags & V4L2_CTRL_FLAG_WRITE_ONLY) == 0;
  control.writable = (flags & (V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_INACTIVE)) == 0;
  return control;
}

/// What a camera has of a head; pan and tilt in each pair.
struct Controls {
  std::array<Control, 2> place, speed;
  Control zoom;

  bool takes_places() const { return place[0].writable && place[1].writable; }
  bool takes_speeds() const { return speed[0].writable && speed[1].writable; }
};

Result<Controls> controls_of(const V4l2Device& device) {
  Controls out;
  out.place = {control_of(device, V4L2_CID_PAN_ABSOLUTE),
               control_of(device, V4L2_CID_TILT_ABSOLUTE)};
  out.speed = {control_of(device, V4L2_CID_PAN_SPEED), control_of(device, V4L2_CID_TILT_SPEED)};
  out.zoom = control_of(device, V4L2_CID_ZOOM_ABSOLUTE);
  std::string missing, there;
  const auto add = [](std::string& list, const char* name) {
    list += (list.empty() ? "" : ", ") + std::string(name);
  };
  const auto look = [&](const Control& control, const char* name, bool needed) {
    if (control.readable || (control.id != 0 && !needed)) {
      add(there, name);
    } else if (needed) {
      add(missing, name);
    }
  };
  look(out.place[0], "pan_absolute", true);
  look(out.place[1], "tilt_absolute", true);
  look(out.speed[0], "pan_speed", false);
  look(out.speed[1], "tilt_speed", false);
  look(out.zoom, "zoom_absolute", false);
  if (missing.empty()) return out;
  return make_error(ErrorCode::kInvalidInput, device.where(),
                    "{} does not tell its angles: it has no {} that can be read; of a head it has "
                    "{}; `v4l2-ctl -d {} -l` lists all",
                    device.description(), missing, there.empty() ? "nothing" : there,
                    device.path());
}

class V4l2Head final : public AxisSource {
 public:
  V4l2Head(V4l2Device device, const Controls& controls, const AxisSourceOptions& options)
      : device_(std::move(device)),
        controls_(controls),
        unit_(kDegree / options.counts_per_degree),
        fastest_(options.fastest),
        by_rate_(options.orders == HeadOrders::kContinuous ||
                 (options.orders == HeadOrders::kAny && !controls.takes_places())) {}
  V4l2Head(const V4l2Head&) = delete;
  V4l2Head& operator=(const V4l2Head&) = delete;
  ~V4l2Head() override {
    if (turns_ != std::array<int64_t, 2>{}) (void)set(controls_.speed, {0, 0});
  }

  Result<std::optional<AxisReading>> next(Duration timeout) override {
    SL_RETURN_IF_ERROR(send_orders());
    const Duration early = asked_ + kPeriod - system().now();
    if (early > timeout) {
      system().sleep(timeout);
      return std::optional<AxisReading>();
    }
    if (early > 0ms) system().sleep(early);
    asked_ = system().now();
    return read();
  }
  Counts counts() const override { return counts_; }
  void turn(const HeadOrder& order) override { order_ = order; }

 private:
  V4l2System& system() const { return *device_.shared_system(); }

  // Both axes, and the zoom where there is one, in one call: the driver reads them together.
  Result<std::optional<AxisReading>> read() {
    std::array<v4l2_ext_control, 3> values{};
    values[0].id = controls_.place[0].id;
    values[1].id = controls_.place[1].id;
    values[2].id = controls_.zoom.id;
    v4l2_ext_controls list{};
    list.which = V4L2_CTRL_WHICH_CUR_VAL;
    list.count = controls_.zoom.readable ? 3 : 2;
    list.controls = values.data();
    const int result = device_.call(VIDIOC_G_EXT_CTRLS, list);
    const Time answered = system().now();
    if (result < 0) {
      ++counts_.bad;
      const bool over = result == -ENODEV || ++failures_ >= kMostFailures;
      if (over) return device_.error(V4l2Step::kReadControl, result);
      return std::optional<AxisReading>();
    }
    failures_ = 0;
    AxisReading reading;
    reading.stamp = asked_ + (answered - asked_) / 2;
    angles_ = HeadAngles(values[0].value * unit_, values[1].value * unit_);
    reading.pan = angles_.x();
    reading.tilt = angles_.y();
    reading.zoom = values[2].value;
    if (angles_.cwiseAbs().maxCoeff() > 2 * std::numbers::pi) {
      ++counts_.bad;
      return std::optional<AxisReading>();
    }
    ++counts_.good;
    return std::optional(reading);
  }

  int set(const std::array<Control, 2>& controls, const std::array<int64_t, 2>& values) {
    std::array<v4l2_ext_control, 2> both{};
    for (size_t i = 0; i < 2; ++i) {
      both[i].id = controls[i].id;
      both[i].value = static_cast<int32_t>(values[i]);
    }
    v4l2_ext_controls list{};
    list.which = V4L2_CTRL_WHICH_CUR_VAL;
    list.count = 2;
    list.controls = both.data();
    return device_.call(VIDIOC_S_EXT_CTRLS, list);
  }

  Status send_orders() {
    if (order_ && counts_.good == 0) return {};  // it is not known where it stands
    if (order_) {
      const HeadOrder order = *order_;
      order_.reset();
      if (by_rate_ ? !controls_.takes_speeds() : !controls_.takes_places()) return cannot();
      if (!by_rate_) return send_place(order);
      rate_.take(order, system().now());
      return send_speeds(true);
    }
    return turns_ == std::array<int64_t, 2>{} ? Status() : send_speeds(false);
  }

  Status send_place(const HeadOrder& order) {
    const std::array<int64_t, 2> values{controls_.place[0].nearest(order.place.x() / unit_),
                                        controls_.place[1].nearest(order.place.y() / unit_)};
    const Time now = system().now();
    if (values == sent_ && now - sent_at_ < kRepeat) return {};
    sent_ = values;
    sent_at_ = now;
    return sent(set(controls_.place, values));
  }

  // Steps of the fastest one, to the nearest; what is far away is not left for being slow.
  Status send_speeds(bool ordered) {
    const HeadAngles rates = rate_.rates(system().now(), angles_);
    std::array<int64_t, 2> values{};
    for (size_t i = 0; i < 2; ++i) {
      const Control& control = controls_.speed[i];
      const double rate = rates[static_cast<int>(i)];
      const double steps = rate / fastest_ * static_cast<double>(control.high);
      values[i] = control.nearest(steps);
      const bool far =
          std::abs(rate_.place()[static_cast<int>(i)] - angles_[static_cast<int>(i)]) > kFar;
      if (values[i] == 0 && rate != 0 && far) {
        values[i] = control.nearest(std::copysign(static_cast<double>(control.step), rate));
      }
    }
    if (values == turns_ && !ordered) return {};
    if (values == turns_ && system().now() - sent_at_ < kRepeat) return {};
    turns_ = values;
    sent_at_ = system().now();
    return sent(set(controls_.speed, values));
  }

  Status sent(int result) {
    ++counts_.ordered;
    if (result == -ENODEV) return device_.error(V4l2Step::kControl, result);
    if (result < 0) ++counts_.refused;
    return {};
  }

  Status cannot() {
    ++counts_.ordered;
    ++counts_.refused;
    if (!told_) {
      log::warning({.camera = device_.where(), .cause = "follow"},
                   "{}: {} cannot be turned {}: {} and {} are missing or read-only",
                   device_.where(), device_.description(), by_rate_ ? "at rates" : "to places",
                   by_rate_ ? "pan_speed" : "pan_absolute",
                   by_rate_ ? "tilt_speed" : "tilt_absolute");
    }
    told_ = true;
    return {};
  }

  V4l2Device device_;
  const Controls controls_;
  const double unit_, fastest_;  ///< [rad], [rad/s]
  const bool by_rate_;
  std::optional<HeadOrder> order_;  ///< not sent yet
  RateOrder rate_;
  std::array<int64_t, 2> sent_{};   ///< the newest place
  std::array<int64_t, 2> turns_{};  ///< speeds in force
  Time asked_{}, sent_at_{};
  HeadAngles angles_ = HeadAngles::Zero();  ///< newest, as the device counts
  int failures_ = 0;
  bool told_ = false;
  Counts counts_;
};

}  // namespace

Result<std::unique_ptr<AxisSource>> open_v4l2_head_in(const AxisSourceOptions& options,
                                                      const std::string& name,
                                                      const V4l2Places& places,
                                                      const std::shared_ptr<V4l2System>& system) {
  SL_ASSIGN(const V4l2Node node, choose_v4l2_node(options.line, find_v4l2_nodes(places), name));
  SL_ASSIGN(V4l2Device device, V4l2Device::open(system, node.path, name));
  SL_ASSIGN(const Controls controls, controls_of(device));
  return std::unique_ptr<AxisSource>(
      std::make_unique<V4l2Head>(std::move(device), controls, options));
}

Result<std::unique_ptr<AxisSource>> open_v4l2_head(const AxisSourceOptions& options,
                                                   const std::string& name) {
  return open_v4l2_head_in(options, name, {}, real_v4l2_system());
}

}  // namespace sightline::capture
