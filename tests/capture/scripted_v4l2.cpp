// SPDX-License-Identifier: Apache-2.0
#include "scripted_v4l2.hpp"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace sightline::test {
namespace {

template <typename T>
T& as(void* argument) {
  return *static_cast<T*>(argument);
}

void put_text(const std::string& text, void* to, size_t size) {
  std::memset(to, 0, size);
  std::memcpy(to, text.data(), std::min(size - 1, text.size()));
}

uint32_t bits_per_pixel(uint32_t fourcc) {
  switch (fourcc) {
    case V4L2_PIX_FMT_GREY:
    case V4L2_PIX_FMT_SRGGB8:
    case V4L2_PIX_FMT_SGRBG8:
    case V4L2_PIX_FMT_SGBRG8:
    case V4L2_PIX_FMT_SBGGR8:
      return 8;
    case V4L2_PIX_FMT_SRGGB10P:
      return 10;
    case V4L2_PIX_FMT_NV12:
    case V4L2_PIX_FMT_YUV420:
    case V4L2_PIX_FMT_SBGGR12P:
      return 12;
    case V4L2_PIX_FMT_RGB24:
    case V4L2_PIX_FMT_BGR24:
      return 24;
    default:
      return 16;
  }
}

bool planar(uint32_t fourcc) {
  return fourcc == V4L2_PIX_FMT_NV12 || fourcc == V4L2_PIX_FMT_YUV420;
}

}  // namespace

ScriptedV4l2::ScriptedV4l2() = default;
ScriptedV4l2::~ScriptedV4l2() = default;

void ScriptedV4l2::send(Buffer scripted) {
  std::lock_guard lock(mutex_);
  script_.push_back(std::move(scripted));
}

void ScriptedV4l2::send(std::vector<uint8_t> bytes) {
  Buffer scripted;
  scripted.bytes = std::move(bytes);
  send(std::move(scripted));
}

void ScriptedV4l2::break_down(int number) {
  std::lock_guard lock(mutex_);
  broken_ = number;
}

size_t ScriptedV4l2::queued() const {
  std::lock_guard lock(mutex_);
  return queued_.size();
}

bool ScriptedV4l2::owns(const uint8_t* p) const {
  return std::any_of(memory_.begin(), memory_.end(), [p](const auto& memory) {
    return p >= memory.data() && p < memory.data() + memory.size();
  });
}

int ScriptedV4l2::open(const char*) {
  if (open_errno != 0) return -open_errno;
  ++open_files_;
  return next_fd_++;
}

void ScriptedV4l2::close(int) { --open_files_; }

int ScriptedV4l2::map(int, size_t, int64_t offset, void** memory) {
  *memory = memory_[static_cast<size_t>(offset)].data();
  ++mapped_;
  return 0;
}

void ScriptedV4l2::unmap(void*, size_t) { --mapped_; }

int ScriptedV4l2::poll(int, Duration limit) {
  std::lock_guard lock(mutex_);
  if (script_.empty() && broken_ != 0) return POLLERR | POLLHUP;
  if (!streaming_) return POLLERR;
  if (!script_.empty() && !queued_.empty()) {
    now_ += period_;
    return POLLIN;
  }
  now_ += std::max<Duration>(limit, std::chrono::milliseconds(1));
  return 0;
}

void ScriptedV4l2::sleep(Duration time) {
  std::lock_guard lock(mutex_);
  now_ += time;
}

Time ScriptedV4l2::now() {
  std::lock_guard lock(mutex_);
  return now_;
}

int ScriptedV4l2::ioctl(int, unsigned long request, void* argument) {
  if (on_call) on_call(request);
  std::lock_guard lock(mutex_);
  const auto failure = failures.find(request);
  return failure != failures.end() ? -failure->second : answer_format(request, argument);
}

int ScriptedV4l2::answer_format(unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& answer = as<v4l2_capability>(argument);
      put_text(card, answer.card, sizeof answer.card);
      answer.capabilities = capabilities | V4L2_CAP_DEVICE_CAPS;
      answer.device_caps = capabilities;
      return 0;
    }
    case VIDIOC_ENUM_FMT:
      return enumerate_formats(as<v4l2_fmtdesc>(argument));
    case VIDIOC_ENUM_FRAMESIZES:
      return enumerate_sizes(as<v4l2_frmsizeenum>(argument));
    case VIDIOC_ENUM_FRAMEINTERVALS:
      return enumerate_rates(as<v4l2_frmivalenum>(argument));
    case VIDIOC_G_FMT:
      as<v4l2_format>(argument).fmt.pix.width = modes.at(0).width;
      as<v4l2_format>(argument).fmt.pix.height = modes.at(0).height;
      as<v4l2_format>(argument).fmt.pix.pixelformat = modes.at(0).fourcc;
      return 0;
    case VIDIOC_S_FMT:
      return set_format(as<v4l2_format>(argument));
    case VIDIOC_S_PARM: {
      const auto& interval = as<v4l2_streamparm>(argument).parm.capture.timeperframe;
      rate_hz_ = interval.denominator / interval.numerator;
      [[fallthrough]];
    }
    case VIDIOC_G_PARM:
      as<v4l2_streamparm>(argument).parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
      as<v4l2_streamparm>(argument).parm.capture.timeperframe = {1, rate_hz_};
      period_ = std::chrono::nanoseconds(1'000'000'000 / rate_hz_);
      return 0;
    default:
      return answer_streaming(request, argument);
  }
}

int ScriptedV4l2::answer_streaming(unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_REQBUFS:
      return request_buffers(as<v4l2_requestbuffers>(argument));
    case VIDIOC_QUERYBUF: {
      auto& buffer = as<v4l2_buffer>(argument);
      buffer.length = pix_.sizeimage;
      buffer.m.offset = buffer.index;
      return 0;
    }
    case VIDIOC_EXPBUF:
      if (!exports) return -ENOTTY;
      as<v4l2_exportbuffer>(argument).fd = next_fd_++;
      ++open_files_;
      return 0;
    case VIDIOC_STREAMON:
      streaming_ = true;
      return 0;
    case VIDIOC_STREAMOFF:
      streaming_ = false;
      queued_.clear();
      return 0;
    case VIDIOC_QBUF:
      return queue(as<v4l2_buffer>(argument));
    case VIDIOC_DQBUF:
      return dequeue(as<v4l2_buffer>(argument));
    default:
      return answer_control(request, argument);
  }
}

int ScriptedV4l2::answer_control(unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_QUERY_EXT_CTRL:
      return query_control(as<v4l2_query_ext_ctrl>(argument));
    case VIDIOC_QUERYMENU:
      return query_menu(as<v4l2_querymenu>(argument));
    case VIDIOC_S_EXT_CTRLS:
    case VIDIOC_G_EXT_CTRLS:
      return exchange_control(as<v4l2_ext_controls>(argument).controls[0],
                              request == VIDIOC_S_EXT_CTRLS);
    case VIDIOC_G_CTRL: {
      const Control* const control = control_of(as<v4l2_control>(argument).id);
      if (control) as<v4l2_control>(argument).value = control->value;
      return control ? 0 : -EINVAL;
    }
    default:
      return -ENOTTY;
  }
}

int ScriptedV4l2::enumerate_formats(v4l2_fmtdesc& entry) const {
  if (entry.index >= modes.size()) return -EINVAL;
  entry.pixelformat = modes[entry.index].fourcc;
  return 0;
}

int ScriptedV4l2::enumerate_sizes(v4l2_frmsizeenum& entry) const {
  // Every mode is a format of its own with one size.
  for (const Mode& mode : modes) {
    if (mode.fourcc != entry.pixel_format || entry.index != 0) continue;
    entry.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    entry.discrete = {mode.width, mode.height};
    return 0;
  }
  return -EINVAL;
}

int ScriptedV4l2::enumerate_rates(v4l2_frmivalenum& entry) const {
  for (const Mode& mode : modes) {
    if (mode.fourcc != entry.pixel_format || entry.index >= mode.rates_hz.size()) continue;
    entry.type = V4L2_FRMIVAL_TYPE_DISCRETE;
    entry.discrete = {1, mode.rates_hz[entry.index]};
    return 0;
  }
  return -EINVAL;
}

int ScriptedV4l2::set_format(v4l2_format& format) {
  v4l2_pix_format& pix = format.fmt.pix;
  if (adjusts_size) pix.width /= 2;
  const uint32_t row = pix.width * bits_per_pixel(pix.pixelformat) / 8;
  pix.bytesperline = bytes_per_line != 0                     ? bytes_per_line
                     : planar(pix.pixelformat)               ? pix.width
                     : pix.pixelformat == V4L2_PIX_FMT_MJPEG ? 0
                                                             : row;
  const uint32_t rows = planar(pix.pixelformat) ? pix.height * 3 / 2 : pix.height;
  pix.sizeimage = std::max(pix.bytesperline * rows, pix.width * pix.height * 2);
  pix.field = V4L2_FIELD_NONE;
  pix_ = pix;
  return 0;
}

int ScriptedV4l2::request_buffers(v4l2_requestbuffers& request) {
  request.count = std::min(request.count, max_buffers);
  if (request.count > 0) {
    memory_.assign(request.count, std::vector<uint8_t>(pix_.sizeimage));
  }
  return 0;
}

int ScriptedV4l2::queue(const v4l2_buffer& buffer) {
  if (queue_refusals_ > 0) {
    --queue_refusals_;
    return -EINVAL;
  }
  queued_.push_back(buffer.index);
  return 0;
}

int ScriptedV4l2::dequeue(v4l2_buffer& buffer) {
  if (script_.empty() && broken_ != 0) return -broken_;
  if (script_.empty() || queued_.empty()) return -EAGAIN;
  const Buffer scripted = std::move(script_.front());
  script_.pop_front();
  buffer.index = queued_.front();
  queued_.erase(queued_.begin());
  std::copy(scripted.bytes.begin(), scripted.bytes.end(), memory_[buffer.index].begin());
  sequence_ += scripted.advance;
  const int64_t stamp =
      scripted.stamp_ns == INT64_MIN ? to_ns(now_) - 1'000'000 : scripted.stamp_ns;
  buffer.bytesused = static_cast<uint32_t>(scripted.bytes.size());
  buffer.flags = scripted.flags;
  buffer.sequence = sequence_;
  buffer.timestamp.tv_sec = stamp / 1'000'000'000;
  buffer.timestamp.tv_usec = stamp % 1'000'000'000 / 1000;
  if (scripted.change) scripted.change(buffer);
  return 0;
}

int ScriptedV4l2::query_control(v4l2_query_ext_ctrl& query) const {
  const uint32_t after = query.id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
  const Control* found = nullptr;
  for (const Control& control : controls) {
    if (control.id > after && (!found || control.id < found->id)) found = &control;
  }
  if (!found) return -EINVAL;
  query.id = found->id;
  query.type = found->type;
  query.minimum = found->min;
  query.maximum = found->max;
  put_text(found->name, query.name, sizeof query.name);
  return 0;
}

int ScriptedV4l2::query_menu(v4l2_querymenu& menu) const {
  for (const Control& control : controls) {
    if (control.id != menu.id) continue;
    if (menu.index >= control.menu.size() || control.menu[menu.index].empty()) return -EINVAL;
    put_text(control.menu[menu.index], menu.name, sizeof menu.name);
    return 0;
  }
  return -EINVAL;
}

int ScriptedV4l2::exchange_control(v4l2_ext_control& one, bool set) {
  Control* const control = control_of(one.id);
  if (!control) return -EINVAL;
  const bool steered = control->id == V4L2_CID_EXPOSURE_ABSOLUTE;
  const Control* const automatic = control_of(V4L2_CID_EXPOSURE_AUTO);
  if (set && steered && automatic && automatic->value != V4L2_EXPOSURE_MANUAL) return -EACCES;
  if (set) control->value = std::min(one.value, control->driver_limit);
  one.value = control->value;
  return 0;
}

ScriptedV4l2::Control* ScriptedV4l2::control_of(uint32_t id) {
  for (Control& control : controls) {
    if (control.id == id) return &control;
  }
  return nullptr;
}

}  // namespace sightline::test
