// SPDX-License-Identifier: Apache-2.0
//
// Loaded before the C library (LD_PRELOAD) it makes the disk under one folder slow or full. The
// file SIGHTLINE_DISK_FAULT says how with its first letter: 's' every sync takes two seconds, 'f'
// nothing can be written; anything else: as it is. SIGHTLINE_DISK_FOLDER names the folder. Each
// fault that took place appends its letter to SIGHTLINE_DISK_FAULT.done.
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

constexpr timespec kSlow{2, 0};

bool is_inside(int fd) {
  static const char* const folder = std::getenv("SIGHTLINE_DISK_FOLDER");
  if (folder == nullptr || fd < 0) return false;
  char link[64], target[512];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(link, target, sizeof target - 1);
  if (length <= 0) return false;
  target[length] = '\0';
  return std::strncmp(target, folder, std::strlen(folder)) == 0;
}

/// True, and noted, if this fault is asked for.
bool has_fault(char letter) {
  static const char* const file = std::getenv("SIGHTLINE_DISK_FAULT");
  if (file == nullptr) return false;
  const int fd = open(file, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return false;
  char found = 0;
  const bool asked = read(fd, &found, 1) == 1 && found == letter;
  close(fd);
  if (!asked) return false;
  char done[512];
  std::snprintf(done, sizeof done, "%s.done", file);
  const int note = open(done, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (note >= 0) {
    (void)!syscall(SYS_write, note, &letter, 1);
    close(note);
  }
  return true;
}

int slow_sync(int fd, long call) {
  if (is_inside(fd) && has_fault('s')) nanosleep(&kSlow, nullptr);
  return static_cast<int>(syscall(call, fd));
}

}  // namespace

extern "C" {

__attribute__((visibility("default"))) int fdatasync(int fd) {
  return slow_sync(fd, SYS_fdatasync);
}

__attribute__((visibility("default"))) int fsync(int fd) { return slow_sync(fd, SYS_fsync); }

__attribute__((visibility("default"))) ssize_t write(int fd, const void* data, size_t size) {
  if (is_inside(fd) && has_fault('f')) {
    errno = ENOSPC;
    return -1;
  }
  return syscall(SYS_write, fd, data, size);
}

}  // extern "C"
