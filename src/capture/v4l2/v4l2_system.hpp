// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "sightline/base/time.hpp"

namespace sightline::capture {

/// The system calls that the V4L2 source makes, so that tests can script a device. Results below
/// zero are negative errno values. Any thread.
class V4l2System {
 public:
  virtual ~V4l2System() = default;
  /// Read and write, non-blocking, close-on-exec.
  virtual int open(const char* path) = 0;
  virtual void close(int fd) = 0;
  /// Repeats a call that a signal interrupted.
  virtual int ioctl(int fd, unsigned long request, void* argument) = 0;
  virtual int map(int fd, size_t bytes, int64_t offset, void** memory) = 0;
  virtual void unmap(void* memory, size_t bytes) = 0;
  /// Waits for a filled buffer: the revents of poll(), 0 at the time limit.
  virtual int poll(int fd, Duration limit) = 0;
  virtual Time now() = 0;
  virtual void sleep(Duration time) = 0;
};

std::shared_ptr<V4l2System> real_v4l2_system();

}  // namespace sightline::capture
