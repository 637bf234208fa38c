// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "capture/v4l2/v4l2_system.hpp"

namespace sightline::test {

/// A camera that follows a script, on a clock of its own: nothing sleeps. Waiting in vain lets the
/// time pass; every frame takes a period. Set it up before it is opened.
class ScriptedV4l2 final : public capture::V4l2System {
 public:
  struct Mode {
    uint32_t fourcc;
    uint32_t width, height;
    std::vector<uint32_t> rates_hz;
  };
  struct Control {
    uint32_t id;
    std::string name;
    uint32_t type;
    int32_t min, max, value;
    std::vector<std::string> menu = {};
    int32_t driver_limit = INT32_MAX;  ///< larger values become this one
  };
  struct Buffer {
    std::vector<uint8_t> bytes;
    uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    uint32_t advance = 1;          ///< of the sequence number
    int64_t stamp_ns = INT64_MIN;  ///< default: a millisecond before the buffer is taken
    std::function<void(v4l2_buffer&)> change = nullptr;
  };

  ScriptedV4l2();
  ~ScriptedV4l2() override;

  std::string card = "Scripted camera";
  uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::vector<Mode> modes;
  std::vector<Control> controls;
  uint32_t bytes_per_line = 0;  ///< reported by S_FMT
  uint32_t max_buffers = 32;
  bool exports = true;
  bool adjusts_size = false;                   ///< S_FMT gives half of what is asked
  std::map<unsigned long, int> failures = {};  ///< request -> errno, every time
  int open_errno = 0;
  std::function<void(unsigned long)> on_call = nullptr;  ///< each request, before its answer

  /// Scripts the next thing that happens.
  void send(Buffer scripted);
  void send(std::vector<uint8_t> bytes);
  /// From here on poll reports trouble, and taking a buffer fails so.
  void break_down(int number);
  void refuse_next_queueing(int times) { queue_refusals_ = times; }

  Duration period() const { return period_; }
  size_t queued() const;
  size_t mapped() const { return mapped_; }
  int open_files() const { return open_files_; }
  bool streaming() const { return streaming_; }
  uint32_t buffers() const { return static_cast<uint32_t>(memory_.size()); }
  bool owns(const uint8_t* p) const;
  uint8_t* memory(size_t index) { return memory_[index].data(); }
  const v4l2_pix_format& format() const { return pix_; }

  int open(const char* path) override;
  void close(int fd) override;
  int ioctl(int fd, unsigned long request, void* argument) override;
  int map(int fd, size_t bytes, int64_t offset, void** memory) override;
  void unmap(void* memory, size_t bytes) override;
  int poll(int fd, Duration limit) override;
  Time now() override;
  void sleep(Duration time) override;

 private:
  int answer_format(unsigned long request, void* argument);
  int answer_streaming(unsigned long request, void* argument);
  int answer_control(unsigned long request, void* argument);
  int enumerate_formats(v4l2_fmtdesc& entry) const;
  int enumerate_sizes(v4l2_frmsizeenum& entry) const;
  int enumerate_rates(v4l2_frmivalenum& entry) const;
  int set_format(v4l2_format& format);
  int request_buffers(v4l2_requestbuffers& request);
  int queue(const v4l2_buffer& buffer);
  int dequeue(v4l2_buffer& buffer);
  int query_control(v4l2_query_ext_ctrl& query) const;
  int query_menu(v4l2_querymenu& menu) const;
  int exchange_control(v4l2_ext_control& one, bool set);
  Control* control_of(uint32_t id);

  mutable std::mutex mutex_;
  Time now_ = time_from_ns(1'000'000'000'000);
  Duration period_ = std::chrono::milliseconds(40);
  v4l2_pix_format pix_{};
  uint32_t rate_hz_ = 25;
  std::vector<std::vector<uint8_t>> memory_;
  std::vector<uint32_t> queued_;
  std::deque<Buffer> script_;
  uint32_t sequence_ = UINT32_MAX;
  size_t mapped_ = 0;
  int open_files_ = 0, next_fd_ = 1000, broken_ = 0, queue_refusals_ = 0;
  bool streaming_ = false;
};

}  // namespace sightline::test
