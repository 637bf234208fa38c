// SPDX-License-Identifier: Apache-2.0
//
// VISCA over RS-232 and RS-422 (Sony): 9600 or 38400 bits per second, 8N1; messages of up to 16
// bytes that end with 0xFF. Cameras are chained; AddressSet, sent to all, counts them through.
#include "capture/axes/visca_line.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <utility>

#include "sightline/base/waiting.hpp"
#include "sightline/capture/axes/axis_source.hpp"

namespace sightline {
namespace {

constexpr std::pair<int, speed_t> kBaudRates[] = {
    {1200, B1200},   {2400, B2400},   {4800, B4800},   {9600, B9600},
    {19200, B19200}, {38400, B38400}, {57600, B57600}, {115200, B115200}};

}  // namespace

bool is_baud_rate(int baud) {
  return std::ranges::any_of(kBaudRates, [baud](const auto& one) { return one.first == baud; });
}

namespace capture {
namespace {

using namespace std::chrono_literals;

constexpr uint8_t kEnd = 0xFF, kToAll = 0x88;
constexpr Duration kPatience = 100ms;  // for the line, and for an answer
constexpr Duration kAddressPatience = 400ms, kClearPatience = 200ms;
constexpr std::array<uint8_t, 4> kAddressSet = {kToAll, 0x30, 0x01, kEnd};
constexpr std::array<uint8_t, 5> kClear = {kToAll, 0x01, 0x00, 0x01, kEnd};

Status set_up(int fd, int baud) {
  termios line{};
  if (tcgetattr(fd, &line) != 0) return make_error(ErrorCode::kInvalidInput, "", "");
  cfmakeraw(&line);
  line.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS | PARENB);
  line.c_cflag |= CLOCAL | CREAD | CS8;
  const auto* const rate =
      std::ranges::find_if(kBaudRates, [baud](const auto& one) { return one.first == baud; });
  const bool set = rate != std::end(kBaudRates) && cfsetspeed(&line, rate->second) == 0 &&
                   tcsetattr(fd, TCSANOW, &line) == 0;
  if (!set) return make_error(ErrorCode::kInvalidInput, "", "");
  tcflush(fd, TCIOFLUSH);
  return {};
}

Result<UniqueFd> open_tty(const std::string& path, int baud, const std::string& name) {
  const Waiting wait("the serial line");
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!fd.is_open()) {
    const bool forbidden = errno == EACCES || errno == EPERM;
    return make_error(ErrorCode::kUnavailable, name, "cannot open the serial line {}: {}{}", path,
                      std::strerror(errno),
                      forbidden ? "; add the user to the group `dialout`"
                                : "; check that the adapter is plugged in");
  }
  if (::isatty(fd.get()) == 0 || !set_up(fd.get(), baud)) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "{} is no serial line, or has no {} bits per second", path, baud);
  }
  if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0 || ::ioctl(fd.get(), TIOCEXCL) != 0) {
    return make_error(ErrorCode::kUnavailable, name,
                      "another program is using the serial line {}; `fuser -v {}` shows which",
                      path, path);
  }
  return fd;
}

// Lines that are open, by their paths, so that several cameras share one.
struct OpenLines {
  std::mutex mutex;
  std::map<std::string, std::weak_ptr<ViscaLine>> lines;
};

OpenLines& open_lines() {
  static OpenLines lines;
  return lines;
}

}  // namespace

int sender_of(std::span<const uint8_t> message) {
  const int address = message.empty() ? 0 : message[0] >> 4;
  return address > 8 && (message[0] & 0x0F) == 0 ? address - 8 : 0;
}

ViscaKind kind_of(std::span<const uint8_t> message) {
  if (message.size() < 3 || message.back() != kEnd) return ViscaKind::kNonsense;
  const bool address = message[0] == kToAll && message[1] == 0x30 && message.size() == 4;
  if (address) return ViscaKind::kAddressesGiven;
  if (sender_of(message) == 0) return ViscaKind::kNonsense;
  const int word = message[1] & 0xF0, socket = message[1] & 0x0F;
  if (message.size() == 3 && message[1] == 0x38) return ViscaKind::kChainChanged;
  if (message.size() == 3 && word == 0x40) return ViscaKind::kAcknowledged;
  if (message.size() == 3 && word == 0x50) return ViscaKind::kDone;
  if (message.size() > 3 && word == 0x50) return ViscaKind::kAnswer;
  if (message.size() != 4 || word != 0x60) return ViscaKind::kNonsense;
  return socket != 0 && message[2] == 0x04 ? ViscaKind::kCanceled : ViscaKind::kRefused;
}

std::optional<ViscaMessage> ViscaFramer::push(uint8_t byte) {
  const bool begins = byte >= 0x80 && byte != kEnd;
  if (begins || message_.length == message_.bytes.size()) {
    dropped_ += message_.length;
    message_.length = 0;
  }
  if (message_.length == 0 && !begins) {
    ++dropped_;
    return std::nullopt;
  }
  message_.bytes[message_.length++] = byte;
  if (byte != kEnd) return std::nullopt;
  const ViscaMessage whole = message_;
  message_.length = 0;
  return whole;
}

Result<std::shared_ptr<ViscaLine>> ViscaLine::open(const std::string& path, int baud,
                                                   const std::string& name) {
  OpenLines& all = open_lines();
  const std::lock_guard lock(all.mutex);
  std::weak_ptr<ViscaLine>& known = all.lines[path];
  if (auto line = known.lock()) {
    const std::unique_lock free(line->mutex_, kPatience);
    if (!free.owns_lock()) {
      return make_error(ErrorCode::kUnavailable, name, "the serial line {} is busy", path);
    }
    if (!line->broken_ && line->baud_ == baud) return line;
    if (!line->broken_) {
      return make_error(ErrorCode::kInvalidInput, name,
                        "the serial line {} is used by {} with {} bits per second: give both "
                        "cameras the same axes_baud",
                        path, line->name_, line->baud_);
    }
    line->fd_.reset();
  }
  SL_ASSIGN(UniqueFd fd, open_tty(path, baud, name));
  std::shared_ptr<ViscaLine> line(new ViscaLine(std::move(fd), path, baud, name));
  line->give_addresses();
  known = line;
  return line;
}

ViscaLine::ViscaLine(UniqueFd fd, std::string path, int baud, std::string name)
    : fd_(std::move(fd)), path_(std::move(path)), name_(std::move(name)), baud_(baud) {}

// What has not been sent yet would hold the closing back for half a minute.
ViscaLine::~ViscaLine() {
  const Waiting wait("the serial line");
  if (fd_.is_open()) tcflush(fd_.get(), TCIOFLUSH);
  fd_.reset();
}

// Cameras with fixed addresses need not answer to either.
void ViscaLine::give_addresses() {
  const auto await = [this](Duration patience, auto&& done) {
    const Time deadline = MonotonicClock::now() + patience;
    while (true) {
      const auto message = receive(deadline);
      if (!message || !*message || done((*message)->span())) return;
    }
  };
  if (!send(kAddressSet)) return;
  await(kAddressPatience, [this](std::span<const uint8_t> message) {
    if (kind_of(message) != ViscaKind::kAddressesGiven) return false;
    cameras_ = message[2] >= 2 && message[2] <= 8 ? message[2] - 1 : 0;
    return true;
  });
  if (!send(kClear)) return;
  await(kClearPatience, [](std::span<const uint8_t> message) {
    return std::ranges::equal(message, std::span(kClear));
  });
}

Duration ViscaLine::lasts(size_t bytes) const {
  return from_seconds(static_cast<double>(bytes) * 10 / baud_);
}

Error ViscaLine::broken(const std::string& what) {
  broken_ = true;
  return make_error(ErrorCode::kUnavailable, name_, "the serial line {} {}", path_, what);
}

Status ViscaLine::send(std::span<const uint8_t> bytes) {
  const Waiting wait("the serial line");
  const Time deadline = MonotonicClock::now() + kPatience;
  while (!bytes.empty()) {
    const ssize_t sent = ::write(fd_.get(), bytes.data(), bytes.size());
    if (sent > 0) {
      bytes = bytes.subspan(static_cast<size_t>(sent));
      continue;
    }
    if (sent < 0 && errno != EAGAIN && errno != EINTR) {
      return broken(std::string("is gone: ") + std::strerror(errno));
    }
    const Duration left = deadline - MonotonicClock::now();
    if (left <= 0ms) return broken("takes nothing more: check cable and flow control");
    pollfd ready{fd_.get(), POLLOUT, 0};
    ::poll(&ready, 1, static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(left).count()));
  }
  return {};
}

// The next whole message, whoever sent it; empty: none until then.
Result<std::optional<ViscaMessage>> ViscaLine::receive(Time deadline) {
  for (bool late = false;;) {
    while (begin_ < end_) {
      if (auto message = framer_.push(waiting_[begin_++])) return message;
    }
    if (late) return std::optional<ViscaMessage>();  // however much it talks
    const Duration left = std::max<Duration>(deadline - MonotonicClock::now(), 0ms);
    late = left == 0ms;
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(left);
    pollfd ready{fd_.get(), POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(wait.count())) <= 0) {
      return std::optional<ViscaMessage>();
    }
    const ssize_t got = ::read(fd_.get(), waiting_.data(), waiting_.size());
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    if (got <= 0) return broken(std::string("is gone: ") + std::strerror(got < 0 ? errno : EIO));
    begin_ = 0;
    end_ = static_cast<size_t>(got);
  }
}

void ViscaLine::note(const ViscaMessage& message) {
  const ViscaKind kind = kind_of(message.span());
  if (kind == ViscaKind::kChainChanged) broken_ = true;
  if (kind == ViscaKind::kRefused) ++refused_[static_cast<size_t>(sender_of(message.span()))];
}

Result<std::optional<ViscaLine::Answer>> ViscaLine::exchange(int camera,
                                                             std::span<const uint8_t> message) {
  const std::unique_lock lock(mutex_, kPatience);
  if (!lock.owns_lock()) return std::optional<Answer>();
  const bool inquiry = message.size() > 1 && message[1] == 0x09;
  // What came late, of orders and of questions that were given up.
  for (int i = 0; i < 64 && !broken_; ++i) {
    SL_ASSIGN(const auto late, receive(Time{}));
    if (!late) break;
    note(*late);
  }
  if (broken_) return broken("has other cameras now, or is gone: it is opened again");
  ViscaMessage question;
  question.length = std::min(message.size(), question.bytes.size());
  std::copy_n(message.begin(), question.length, question.bytes.begin());
  question.bytes[0] = static_cast<uint8_t>(0x80 | camera);
  framer_.clear();
  const Time asked = MonotonicClock::now();
  SL_RETURN_IF_ERROR(send(question.span()));
  const Time deadline = asked + lasts(question.length) + kPatience;
  while (true) {
    SL_ASSIGN(const auto got, receive(deadline));
    if (!got) return std::optional<Answer>();
    const ViscaKind kind = kind_of(got->span());
    const bool wanted = kind == ViscaKind::kRefused ||
                        kind == (inquiry ? ViscaKind::kAnswer : ViscaKind::kAcknowledged);
    const bool of_an_order = inquiry && (got->bytes[1] & 0x0F) != 0;
    if (sender_of(got->span()) != camera || !wanted || of_an_order) {
      note(*got);
      if (broken_) return broken("has other cameras now: it is opened again");
      continue;
    }
    const Time answered = MonotonicClock::now();
    const Duration spent = answered - asked;
    const Duration out = lasts(question.length), back = lasts(got->length);
    Answer answer{*got, asked + spent / 2};
    if (spent > out + back) answer.stamp = asked + out + (spent - out - back) / 2;
    return std::optional(answer);
  }
}

uint64_t ViscaLine::take_refused(int camera) {
  const std::unique_lock lock(mutex_, kPatience);
  return lock.owns_lock() ? std::exchange(refused_[static_cast<size_t>(camera)], 0) : 0;
}

uint64_t ViscaLine::dropped() const {
  const std::unique_lock lock(mutex_, kPatience);
  return lock.owns_lock() ? framer_.dropped() : 0;
}

}  // namespace capture
}  // namespace sightline
