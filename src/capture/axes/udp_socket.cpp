// SPDX-License-Identifier: Apache-2.0
#include "capture/axes/udp_socket.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
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

// The number of an interface; 0 for none.
Result<unsigned> number_of(const std::string& interface, const std::string& name) {
  if (interface.empty()) return 0U;
  const unsigned number = ::if_nametoindex(interface.c_str());
  if (number != 0) return number;
  return make_error(ErrorCode::kUnavailable, name,
                    "there is no network interface {}; `ip link` lists those that are there",
                    interface);
}

int join_group(int fd, const addrinfo& at, unsigned interface) {
  if (at.ai_family == AF_INET6) {
    ipv6_mreq request{};
    request.ipv6mr_multiaddr = reinterpret_cast<const sockaddr_in6*>(at.ai_addr)->sin6_addr;
    request.ipv6mr_interface = interface;
    return ::setsockopt(fd, IPPROTO_IPV6, IPV6_JOIN_GROUP, &request, sizeof request);
  }
  ip_mreqn request{};
  request.imr_multiaddr = reinterpret_cast<const sockaddr_in*>(at.ai_addr)->sin_addr;
  request.imr_ifindex = static_cast<int>(interface);
  return ::setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request);
}

// Bound to the group's own address: nothing else at the port comes in.
Result<UniqueFd> listen_to_group(addrinfo& at, const std::string& group, unsigned interface,
                                 uint16_t port, const std::string& name) {
  if (at.ai_family == AF_INET6) {
    reinterpret_cast<sockaddr_in6*>(at.ai_addr)->sin6_scope_id = interface;
  }
  const int shared = 1;
  UniqueFd fd(::socket(at.ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd.is_open() ||
      ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &shared, sizeof shared) != 0 ||
      ::bind(fd.get(), at.ai_addr, at.ai_addrlen) != 0 ||
      join_group(fd.get(), at, interface) != 0) {
    return make_error(ErrorCode::kUnavailable, name,
                      "cannot join the group {} at UDP port {}: {}; name the interface behind it, "
                      "as in {}%eth0",
                      group, port, std::strerror(errno), group);
  }
  return fd;
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

bool is_multicast(const std::string& address) {
  in_addr four{};
  in6_addr six{};
  if (inet_pton(AF_INET, address.c_str(), &four) == 1) return IN_MULTICAST(ntohl(four.s_addr));
  return inet_pton(AF_INET6, address.c_str(), &six) == 1 && six.s6_addr[0] == 0xff;
}

Result<UdpSocket> UdpSocket::listen(const std::string& address, const std::string& interface,
                                    uint16_t port, const std::string& name) {
  SL_ASSIGN(const Addresses found, resolve(address, port, AI_PASSIVE, name));
  if (is_multicast(address)) {
    SL_ASSIGN(const unsigned number, number_of(interface, name));
    SL_ASSIGN(UniqueFd group, listen_to_group(*found, address, number, port, name));
    UdpSocket socket(std::move(group), name);
    socket.group_ = address;
    return socket;
  }
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
  if (ready <= 0) {
    if (group_.empty() || MonotonicClock::now() - heard_ < kForgotten) {
      return std::optional<size_t>();
    }
    return make_error(ErrorCode::kUnavailable, name_,
                      "the group {} has said nothing for {} s, and is joined anew; check its "
                      "sender, the interface and what switches forward (IGMP)",
                      group_, std::chrono::duration_cast<std::chrono::seconds>(kForgotten).count());
  }
  const ssize_t length = ::recv(fd_.get(), buffer.data(), buffer.size(), 0);
  if (length >= 0) {
    if (!group_.empty()) heard_ = MonotonicClock::now();
    return std::optional<size_t>(static_cast<size_t>(length));
  }
  if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) return std::optional<size_t>();
  return make_error(ErrorCode::kUnavailable, name_, "nobody answers: {}", std::strerror(errno));
}

Status UdpSocket::send(std::span<const uint8_t> bytes) {
  const ssize_t sent = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (sent == static_cast<ssize_t>(bytes.size()) || errno == EAGAIN || errno == EINTR) return {};
  return make_error(ErrorCode::kUnavailable, name_, "cannot send: {}", std::strerror(errno));
}

}  // namespace sightline::capture
