// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/files.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <random>

#include "sightline/base/unique_fd.hpp"

namespace sightline {
namespace {

Error errno_error(const std::filesystem::path& path, const char* tried) {
  // Links in a circle and names that no file can have are the user's, as a wrong name is.
  const bool no_such =
      errno == ENOENT || errno == ENOTDIR || errno == ELOOP || errno == ENAMETOOLONG;
  const ErrorCode code = no_such ? ErrorCode::kNotFound : ErrorCode::kIo;
  return make_error(code, path.string(), "{}: {}", tried, std::strerror(errno));
}

Status write_all(int fd, std::string_view content, const std::filesystem::path& path) {
  while (!content.empty()) {
    const ssize_t n = ::write(fd, content.data(), content.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno_error(path, "cannot write");
    content.remove_prefix(static_cast<size_t>(n));
  }
  return {};
}

struct NewFile {
  UniqueFd fd;
  std::string name;
};

// With the permissions that any new file gets from the umask; mkstemp() gives others.
Result<NewFile> create_beside(const std::filesystem::path& directory,
                              const std::filesystem::path& path) {
  constexpr int kTries = 100;
  std::random_device random;
  for (int i = 0; i < kTries; ++i) {
    NewFile file;
    file.name = directory / fmt::format("{}.{:08x}", path.filename().string(), random());
    file.fd = UniqueFd(::open(file.name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
    if (file.fd.is_open()) return file;
    if (errno != EEXIST) break;
  }
  return errno_error(path, "cannot create a file beside it");
}

// What replaces a file lets nobody in whom that did not.
bool keep_narrow(int fd, const std::filesystem::path& replaced) {
  struct stat now {
  }, before{};
  if (::stat(replaced.c_str(), &before) != 0) return true;
  if (::fstat(fd, &now) != 0) return false;
  const mode_t mode = now.st_mode & before.st_mode & 0777;
  return mode == (now.st_mode & 0777) || ::fchmod(fd, mode) == 0;
}

Status sync_directory(const std::filesystem::path& directory) {
  UniqueFd fd(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd.is_open()) return errno_error(directory, "cannot open directory");
  if (::fsync(fd.get()) != 0) return errno_error(directory, "cannot sync directory");
  return {};
}

}  // namespace

Result<std::string> read_file(const std::filesystem::path& path, size_t limit_bytes) {
  // O_NONBLOCK: opening a FIFO by mistake must not hang.
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!fd.is_open()) return errno_error(path, "cannot open");
  struct stat info {};
  if (::fstat(fd.get(), &info) != 0) return errno_error(path, "cannot stat");
  if (!S_ISREG(info.st_mode)) {
    return make_error(ErrorCode::kInvalidInput, path.string(), "not a regular file");
  }
  const auto too_large = [&] {
    return make_error(ErrorCode::kInvalidInput, path.string(), "larger than {} bytes, refused",
                      limit_bytes);
  };
  // Before memory is asked for: a sparse file may claim any size.
  if (static_cast<uint64_t>(info.st_size) > limit_bytes) return too_large();
  std::string content;
  content.reserve(static_cast<size_t>(info.st_size));
  char buffer[1 << 16];
  for (;;) {
    const ssize_t n = ::read(fd.get(), buffer, sizeof buffer);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno_error(path, "cannot read");
    if (n == 0) return content;
    if (content.size() + static_cast<size_t>(n) > limit_bytes) return too_large();
    content.append(buffer, static_cast<size_t>(n));
  }
}

Status write_file_atomically(const std::filesystem::path& path, std::string_view content) {
  const auto directory = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  SL_ASSIGN(auto beside, create_beside(directory, path));
  const auto& [fd, temporary] = beside;
  auto written = write_all(fd.get(), content, temporary);
  if (written && !keep_narrow(fd.get(), path)) written = errno_error(temporary, "cannot chmod");
  if (written && ::fsync(fd.get()) != 0) written = errno_error(temporary, "cannot sync");
  if (written && ::rename(temporary.c_str(), path.c_str()) != 0) {
    written = errno_error(path, "cannot rename into place");
  }
  if (!written) {
    ::unlink(temporary.c_str());
    return written;
  }
  return sync_directory(directory);
}

uint64_t content_hash(std::string_view content) {
  uint64_t hash = 14695981039346656037ULL;
  for (const char c : content) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  }
  return hash;
}

}  // namespace sightline
