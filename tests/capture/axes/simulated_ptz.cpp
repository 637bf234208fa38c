// SPDX-License-Identifier: Apache-2.0
#include "simulated_ptz.hpp"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <string_view>

namespace sightline::test {

SimulatedPtz::SimulatedPtz() {
  controls[V4L2_CID_PAN_ABSOLUTE] = {-360000, 360000, 3600};
  controls[V4L2_CID_TILT_ABSOLUTE] = {-72000, 72000, 3600};
  controls[V4L2_CID_ZOOM_ABSOLUTE] = {100, 500, 1};
  controls[V4L2_CID_PAN_SPEED] = {-8, 8, 1};
  controls[V4L2_CID_TILT_SPEED] = {-8, 8, 1};
}

int SimulatedPtz::open(const char* path) {
  if (!std::string_view(path).ends_with("/video0")) return -ENOENT;
  ++open_files_;
  return 7;
}

void SimulatedPtz::close(int) { --open_files_; }

int SimulatedPtz::poll(int, Duration) { return POLLERR; }

void SimulatedPtz::run(Duration time) {
  now_ += time;
  if (stuck) return;
  const double most = kRate * to_seconds(time);
  const std::array<uint32_t, 2> places{V4L2_CID_PAN_ABSOLUTE, V4L2_CID_TILT_ABSOLUTE};
  const std::array<uint32_t, 2> speeds{V4L2_CID_PAN_SPEED, V4L2_CID_TILT_SPEED};
  for (size_t i = 0; i < 2; ++i) {
    if (!controls.contains(places[i])) continue;
    if (speed_[i] != 0) {
      angle_[i] += most * speed_[i] / controls.at(speeds[i]).high;
      goal_[i] = angle_[i];
    } else {
      angle_[i] += std::clamp(goal_[i] - angle_[i], -most, most);
    }
    const Control& ends = controls.at(places[i]);
    angle_[i] = std::clamp<double>(angle_[i], ends.low, ends.high);
  }
}

int SimulatedPtz::ioctl(int, unsigned long request, void* argument) {
  run(transfer);
  if (const auto fault = failures.find(request); fault != failures.end()) return -fault->second;
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& answer = *static_cast<v4l2_capability*>(argument);
      std::memcpy(answer.card, "Motor", 6);
      answer.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      return 0;
    }
    case VIDIOC_QUERY_EXT_CTRL: {
      auto& query = *static_cast<v4l2_query_ext_ctrl*>(argument);
      const auto found = controls.find(query.id);
      if (found == controls.end()) return -EINVAL;
      query.minimum = found->second.low;
      query.maximum = found->second.high;
      query.step = static_cast<uint64_t>(found->second.step);
      query.flags = found->second.flags;
      return 0;
    }
    case VIDIOC_G_EXT_CTRLS:
      return exchange(*static_cast<v4l2_ext_controls*>(argument), false);
    case VIDIOC_S_EXT_CTRLS:
      return exchange(*static_cast<v4l2_ext_controls*>(argument), true);
    default:
      return -ENOTTY;
  }
}

int SimulatedPtz::exchange(v4l2_ext_controls& list, bool set) {
  for (uint32_t i = 0; i < list.count; ++i) {
    const int result = set ? put(list.controls[i]) : get(list.controls[i]);
    if (result < 0) return result;
  }
  return 0;
}

int SimulatedPtz::get(v4l2_ext_control& one) const {
  const auto found = controls.find(one.id);
  if (found == controls.end()) return -EINVAL;
  if ((found->second.flags & V4L2_CTRL_FLAG_WRITE_ONLY) != 0) return -EACCES;
  const bool pan = one.id == V4L2_CID_PAN_ABSOLUTE, tilt = one.id == V4L2_CID_TILT_ABSOLUTE;
  one.value = pan    ? static_cast<int32_t>(std::lround(angle_[0]))
              : tilt ? static_cast<int32_t>(std::lround(angle_[1]))
                     : found->second.low;
  return 0;
}

// As UVC drivers do: what lies beyond the ends or between two steps is refused, not rounded.
int SimulatedPtz::put(const v4l2_ext_control& one) {
  const auto found = controls.find(one.id);
  if (found == controls.end()) return -EINVAL;
  const Control& control = found->second;
  if ((control.flags & V4L2_CTRL_FLAG_READ_ONLY) != 0) return -EACCES;
  if (one.value < control.low || one.value > control.high) return -ERANGE;
  if ((one.value - control.low) % control.step != 0) return -EINVAL;
  orders_.emplace_back(one.id, one.value);
  if (one.id == V4L2_CID_PAN_ABSOLUTE || one.id == V4L2_CID_TILT_ABSOLUTE) {
    const size_t axis = one.id == V4L2_CID_PAN_ABSOLUTE ? 0 : 1;
    goal_[axis] = one.value;
    speed_[axis] = 0;
  } else {
    speed_[one.id == V4L2_CID_PAN_SPEED ? 0 : 1] = one.value;
  }
  return 0;
}

}  // namespace sightline::test
