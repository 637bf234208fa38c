// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "sightline/base/result.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::record {

/// A file that is written, unbuffered: what write() returned from survives the end of the process,
/// what sync() returned from survives a power cut.
class OutFile {
 public:
  enum class Existing { kRefuse, kReplace };
  static Result<OutFile> create(const std::filesystem::path& path, Existing existing);

  bool is_open() const { return fd_.is_open(); }
  const std::string& path() const { return path_; }
  Status write(std::string_view bytes);
  /// More is going to be written, large: blocks are taken some MB ahead, which halves what a write
  /// costs. close() gives back what was not used; where that cannot be done nothing happens.
  void reserve(int64_t size);
  /// Moves to `offset` from the start.
  Status seek(int64_t offset);
  Result<int64_t> size() const;
  /// Cuts it off after `size` bytes.
  Status truncate(int64_t size);
  Status sync();
  Status close();

 private:
  OutFile(UniqueFd fd, std::string path) : fd_(std::move(fd)), path_(std::move(path)) {}
  UniqueFd fd_;
  std::string path_;
  int64_t reserved_ = 0;
};

}  // namespace sightline::record
