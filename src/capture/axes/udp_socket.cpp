// SPDX-License-Identifier: Apache-2.0
#include "capture/axes/udp_socket.hpp"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>

namespace sightline::capture {
namespace {

using Addresses = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

Result<Addresses> resolve(const std::string& host, uint16_t port, int flags,
                          const std::string& name) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_DGRAM;
  hints.ai_flags = flags | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const char* node = host.empty() ? "0.0.0.0" : host.c_str();
  const int fault = getaddrinfo(node, std::to_string(port).c_str(), &hints, &found);
  if (fault == 0) return Addresses(found, &freeaddrinfo);
  return make_error(ErrorCode::kNotFound, name, "cannot find the address {}: {}", node,
                    gai_strerror(fault));
}

using Join = int (*)(int, const sockaddr*, socklen_t);

Result<UniqueFd> open_at(const addrinfo& at, Join join, const char* what, uint16_t port,
                         const std::string& name) {
  UniqueFd fd(::socket(at.ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (fd.is_open() && join(fd.get(), at.ai_addr, at.ai_addrlen) == 0) return fd;
  return make_error(ErrorCode::kUnavailable, name, "cannot {} UDP port {}: {}", what, port,
                    std::strerror(errno));
}

}  // namespace

Result<UdpSocket> UdpSocket::listen(const std::string& address, uint16_t port,
                                    const std::string& name) {
  SL_ASSIGN(const Addresses found, resolve(address, port, AI_PASSIVE, name));
  SL_ASSIGN(UniqueFd fd, open_at(*found, &::bind, "listen at", port, name));
  return UdpSocket(std::move(fd), name);
}

Result<UdpSocket> UdpSocket::connect(const std::string& host, uint16_t port,
                                     const std::string& name) {
  SL_ASSIGN(const Addresses found, resolve(host, port, 0, name));
  SL_ASSIGN(UniqueFd fd, open_at(*found, &::connect, "talk to", port, name));
  return UdpSocket(std::move(fd), name);
}

Result<std::optional<size_t>> UdpSocket::receive(std::span<uint8_t> buffer, Duration timeout) {
  const auto wait = std::chrono::ceil<std::chrono::milliseconds>(timeout);
  pollfd waiting{fd_.get(), POLLIN, 0};
  const int ready =
      ::poll(&waiting, 1, static_cast<int>(std::clamp<int64_t>(wait.count(), 0, 200)));
  if (ready <= 0) return std::optional<size_t>();
  const ssize_t length = ::recv(fd_.get(), buffer.data(), buffer.size(), 0);
  if (length >= 0) return std::optional<size_t>(static_cast<size_t>(length));
  if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) return std::optional<size_t>();
  return make_error(ErrorCode::kUnavailable, name_, "nobody answers: {}", std::strerror(errno));
}

Status UdpSocket::send(std::span<const uint8_t> bytes) {
  const ssize_t sent = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (sent == static_cast<ssize_t>(bytes.size()) || errno == EAGAIN || errno == EINTR) return {};
  return make_error(ErrorCode::kUnavailable, name_, "cannot send: {}", std::strerror(errno));
}

}  // namespace sightline::capture
