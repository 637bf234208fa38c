// SPDX-License-Identifier: Apache-2.0
// Preloaded into a daemon under test: makes the disk slow. SLOW_READ and SLOW_SYNC are
// "TEXT:MILLISECONDS": every read() or fdatasync() of a file whose path has TEXT in it takes so
// much longer, as one of a disk that spins up or of a server that does not answer.
#include <dlfcn.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>

namespace {

bool path_has(int fd, const std::string& text) {
  char path[4096];
  const std::string link = "/proc/self/fd/" + std::to_string(fd);
  const ssize_t size = readlink(link.c_str(), path, sizeof path - 1);
  if (size <= 0) return false;
  path[size] = 0;
  return std::strstr(path, text.c_str()) != nullptr;
}

void delay(const char* variable, int fd) {
  const char* const rule = std::getenv(variable);
  const char* const colon = rule != nullptr ? std::strrchr(rule, ':') : nullptr;
  if (colon == nullptr || !path_has(fd, std::string(rule, colon))) return;
  const long ms = std::atol(colon + 1);
  timespec left{ms / 1000, (ms % 1000) * 1'000'000};
  while (nanosleep(&left, &left) != 0) {
  }
}

}  // namespace

extern "C" {

ssize_t read(int fd, void* bytes, size_t size) {
  using Read = ssize_t (*)(int, void*, size_t);
  static const auto real = reinterpret_cast<Read>(dlsym(RTLD_NEXT, "read"));
  delay("SLOW_READ", fd);
  return real(fd, bytes, size);
}

int fdatasync(int fd) {
  using Sync = int (*)(int);
  static const auto real = reinterpret_cast<Sync>(dlsym(RTLD_NEXT, "fdatasync"));
  delay("SLOW_SYNC", fd);
  return real(fd);
}

}  // extern "C"
