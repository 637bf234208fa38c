// SPDX-License-Identifier: Apache-2.0
#include "base/line_writer.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <utility>

#include "sightline/base/unique_fd.hpp"

namespace sightline::base {

LineWriter::LineWriter(int fd, size_t most, std::function<std::string(uint64_t lost)> note)
    : fd_(fd),
      kind_([fd] {
        struct stat info {};
        if (::fstat(fd, &info) != 0 || S_ISREG(info.st_mode)) return Kind::kFile;
        return S_ISSOCK(info.st_mode) ? Kind::kSocket : Kind::kPipe;
      }()),
      most_(most),
      note_(std::move(note)) {}

void LineWriter::write(std::string line) {
  bytes_ += line.size();
  lines_.push_back(std::move(line));
  drain();
  // What has been written in part has to be ended, and does not count.
  const size_t begun = sent_ > 0 ? lines_.front().size() : 0;
  while (bytes_ - begun > most_) drop_oldest();
}

bool LineWriter::flush(Duration patience) {
  const Time end = MonotonicClock::now() + patience;
  for (;;) {
    drain();
    if (lines_.empty() && unsaid_ == 0) return true;
    const Duration left = end - MonotonicClock::now();
    if (left <= Duration::zero()) return false;
    pollfd writable{fd_, POLLOUT, 0};
    const auto left_ms = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    if (::poll(&writable, 1, static_cast<int>(std::min<int64_t>(left_ms, INT_MAX))) == 0) {
      return false;
    }
  }
}

void LineWriter::drain() {
  if (sent_ == 0 && unsaid_ > 0 && !say_lost()) return;
  while (!lines_.empty()) {
    if (!put(lines_.front(), sent_)) return;
    bytes_ -= lines_.front().size();
    lines_.pop_front();
    sent_ = 0;
    if (unsaid_ > 0 && !say_lost()) return;
  }
}

// True once it is said. What is said in part becomes the first line.
bool LineWriter::say_lost() {
  std::string line = note_(unsaid_);
  size_t sent = 0;
  const bool whole = put(line, sent);
  if (sent == 0) return false;
  unsaid_ = 0;
  if (whole) return true;
  bytes_ += line.size();
  lines_.push_front(std::move(line));
  sent_ = sent;
  return false;
}

void LineWriter::drop_oldest() {
  const auto oldest = lines_.begin() + (sent_ > 0 ? 1 : 0);
  bytes_ -= oldest->size();
  lines_.erase(oldest);
  ++lost_;
  ++unsaid_;
}

// Nobody will ever read it.
void LineWriter::drop_all() {
  lost_ += lines_.size();
  lines_.clear();
  bytes_ = sent_ = 0;
  unsaid_ = 0;
}

// True if all of it has been written. A pipe that is writable takes PIPE_BUF bytes without waiting.
bool LineWriter::put(const std::string& text, size_t& sent) {
  while (sent < text.size()) {
    const char* const data = text.data() + sent;
    const size_t size = text.size() - sent;
    ssize_t done = 0;
    if (kind_ == Kind::kSocket) {
      done = ::send(fd_, data, size, MSG_DONTWAIT | MSG_NOSIGNAL);
    } else if (kind_ == Kind::kFile) {
      done = ::write(fd_, data, size);
    } else {
      pollfd writable{fd_, POLLOUT, 0};
      const int ready = ::poll(&writable, 1, 0);
      if (ready <= 0) return false;
      done = ::write(fd_, data, std::min<size_t>(size, PIPE_BUF));
    }
    if (done >= 0) {
      sent += static_cast<size_t>(done);
    } else if (errno == EAGAIN) {
      return false;
    } else if (errno != EINTR) {
      drop_all();
      return false;
    }
  }
  return true;
}

void reopen_without_blocking(int fd) {
  struct stat info {};
  if (::fstat(fd, &info) != 0 || (!S_ISFIFO(info.st_mode) && !S_ISCHR(info.st_mode))) return;
  const std::string name = "/proc/self/fd/" + std::to_string(fd);
  const UniqueFd own(::open(name.c_str(), O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  if (own.is_open()) (void)::dup2(own.get(), fd);
}

}  // namespace sightline::base
