// SPDX-License-Identifier: Apache-2.0
#include "record/out_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "sightline/base/waiting.hpp"

namespace sightline::record {
namespace {

constexpr const char* kDisk = "the disk";
constexpr int64_t kAhead = int64_t{8} << 20;

Error system_error(const std::string& path, const char* tried) {
  const int code = errno;
  const char* advice = code == ENOSPC || code == EDQUOT ? "; free some space and record again" : "";
  return make_error(ErrorCode::kIo, path, "{}: {}{}", tried, std::strerror(code), advice);
}

}  // namespace

Result<OutFile> OutFile::create(const std::filesystem::path& path, Existing existing) {
  const Waiting wait(kDisk);
  const int how = existing == Existing::kRefuse ? O_EXCL : O_TRUNC;
  UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | how, 0644));
  if (!fd.is_open()) return system_error(path.string(), "cannot create");
  return OutFile(std::move(fd), path.string());
}

Status OutFile::write(std::string_view bytes) {
  const Waiting wait(kDisk);
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_.get(), bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error(path_, "cannot write");
    bytes.remove_prefix(static_cast<size_t>(n));
  }
  return {};
}

void OutFile::reserve(int64_t size) {
  if (size <= reserved_ || reserved_ < 0) return;
  const Waiting wait(kDisk);
  const int64_t from = reserved_;
  reserved_ = size + kAhead;
  if (::fallocate(fd_.get(), FALLOC_FL_KEEP_SIZE, from, reserved_ - from) != 0) reserved_ = -1;
}

Status OutFile::seek(int64_t offset) {
  const Waiting wait(kDisk);
  if (::lseek(fd_.get(), offset, SEEK_SET) < 0) return system_error(path_, "cannot seek");
  return {};
}

Result<int64_t> OutFile::size() const {
  const Waiting wait(kDisk);
  struct stat info {};
  if (::fstat(fd_.get(), &info) != 0) return system_error(path_, "cannot stat");
  return int64_t{info.st_size};
}

Status OutFile::truncate(int64_t size) {
  const Waiting wait(kDisk);
  if (::ftruncate(fd_.get(), size) != 0) return system_error(path_, "cannot cut off");
  return {};
}

Status OutFile::sync() {
  const Waiting wait(kDisk);
  // Pipes and /dev/null cannot be synced, and need not be.
  if (::fdatasync(fd_.get()) != 0 && errno != EINVAL) return system_error(path_, "cannot sync");
  return {};
}

Status OutFile::close() {
  if (!fd_.is_open()) return {};
  const Waiting wait(kDisk);
  if (reserved_ != 0) {
    const auto used = size();
    if (used) (void)truncate(*used);
  }
  if (::close(fd_.release()) != 0) return system_error(path_, "cannot close");
  return {};
}

}  // namespace sightline::record
