// SPDX-License-Identifier: Apache-2.0
#include "capture/v4l2/v4l2_system.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <thread>

namespace sightline::capture {
namespace {

class RealV4l2System final : public V4l2System {
 public:
  int open(const char* path) override {
    const int fd = ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return fd < 0 ? -errno : fd;
  }

  void close(int fd) override { ::close(fd); }

  int ioctl(int fd, unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ::ioctl(fd, request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? -errno : result;
  }

  int map(int fd, size_t bytes, int64_t offset, void** memory) override {
    *memory = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, fd, offset);
    return *memory == MAP_FAILED ? -errno : 0;
  }

  void unmap(void* memory, size_t bytes) override { ::munmap(memory, bytes); }

  int poll(int fd, Duration limit) override {
    pollfd waited{fd, POLLIN, 0};
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(limit).count();
    const int ready = ::poll(&waited, 1, static_cast<int>(ms));
    if (ready < 0) return errno == EINTR ? 0 : -errno;
    return ready == 0 ? 0 : waited.revents;
  }

  Time now() override { return MonotonicClock::now(); }

  void sleep(Duration time) override { std::this_thread::sleep_for(time); }
};

}  // namespace

std::shared_ptr<V4l2System> real_v4l2_system() { return std::make_shared<RealV4l2System>(); }

}  // namespace sightline::capture
