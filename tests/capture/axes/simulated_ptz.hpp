// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/videodev2.h>

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "capture/v4l2/v4l2_system.hpp"

namespace sightline::test {

/// A camera of the kernel with a motor under it, on a clock of its own: nothing sleeps. It goes to
/// places in its steps, or turns at speeds until it is stopped, at kRate, and not past its ends.
class SimulatedPtz final : public capture::V4l2System {
 public:
  struct Control {
    int32_t low, high, step;
    uint32_t flags = 0;
  };
  static constexpr double kRate = 36000;  // arc seconds a second, at the fastest

  SimulatedPtz();

  std::map<uint32_t, Control> controls;              ///< by id
  std::map<unsigned long, int> failures = {};        ///< request -> errno
  Duration transfer = std::chrono::milliseconds(2);  ///< of each call
  bool stuck = false;                                ///< it takes orders, and stands

  double pan() const { return angle_[0]; }  ///< [arc seconds], to the right
  double tilt() const { return angle_[1]; }
  bool turns() const { return speed_[0] != 0 || speed_[1] != 0; }
  int open_files() const { return open_files_; }
  /// What it was set to, in order: id and value.
  const std::vector<std::pair<uint32_t, int32_t>>& orders() const { return orders_; }

  int open(const char* path) override;
  void close(int fd) override;
  int ioctl(int fd, unsigned long request, void* argument) override;
  int map(int, size_t, int64_t, void**) override { return -25; }
  void unmap(void*, size_t) override {}
  /// A node that does not stream has nothing to wait for.
  int poll(int, Duration) override;
  Time now() override { return now_; }
  void sleep(Duration time) override { run(time); }

 private:
  void run(Duration time);
  int exchange(v4l2_ext_controls& list, bool set);
  int get(v4l2_ext_control& one) const;
  int put(const v4l2_ext_control& one);

  Time now_ = time_from_ns(1'000'000'000'000);
  std::array<double, 2> angle_{}, goal_{};
  std::array<int32_t, 2> speed_{};
  std::vector<std::pair<uint32_t, int32_t>> orders_;
  int open_files_ = 0;
};

}  // namespace sightline::test
