// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>

#include "sightline/base/time.hpp"

namespace sightline::base {

/// Lines to a descriptor that may be a pipe or a socket that nobody reads: what cannot be written
/// at once is kept, up to a bound; beyond that the oldest are lost, and counted. Never waits but in
/// flush(). Does not change the mode of the descriptor, which may be another program's too. One
/// thread at a time.
class LineWriter {
 public:
  /// Keeps up to `most` bytes. `note` makes the line that says how many were lost, which stands
  /// where they would have stood.
  LineWriter(int fd, size_t most, std::function<std::string(uint64_t lost)> note);

  /// A line with its end.
  void write(std::string line);
  /// Waits for room, at most so long; true if all has been written.
  bool flush(Duration patience);
  /// Of all time.
  uint64_t lost() const { return lost_; }

 private:
  void drain();
  bool say_lost();
  void drop_oldest();
  void drop_all();
  bool put(const std::string& text, size_t& sent);

  enum class Kind { kFile, kSocket, kPipe };
  const int fd_;
  const Kind kind_;
  const size_t most_;
  const std::function<std::string(uint64_t)> note_;
  std::deque<std::string> lines_;
  size_t bytes_ = 0;  ///< in lines_
  size_t sent_ = 0;   ///< of the first of lines_
  uint64_t lost_ = 0, unsaid_ = 0;
};

/// Where this is possible (pipe, terminal), makes `fd` refer to a description of its own that does
/// not block, so that what libraries print to it cannot block either. The other holders of the pipe
/// do not notice.
void reopen_without_blocking(int fd);

}  // namespace sightline::base
