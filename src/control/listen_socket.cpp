// SPDX-License-Identifier: Apache-2.0
#include "control/listen_socket.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <optional>

namespace sightline::control {
namespace {

struct Address {
  sockaddr_storage storage{};
  socklen_t length = 0;
  bool loopback = false;
};

std::optional<Address> parse_address(const std::string& text, uint16_t port) {
  Address address;
  auto* v4 = reinterpret_cast<sockaddr_in*>(&address.storage);
  auto* v6 = reinterpret_cast<sockaddr_in6*>(&address.storage);
  if (inet_pton(AF_INET, text.c_str(), &v4->sin_addr) == 1) {
    v4->sin_family = AF_INET;
    v4->sin_port = htons(port);
    address.length = sizeof(*v4);
    address.loopback = (ntohl(v4->sin_addr.s_addr) >> 24) == 127;
    return address;
  }
  if (inet_pton(AF_INET6, text.c_str(), &v6->sin6_addr) == 1) {
    v6->sin6_family = AF_INET6;
    v6->sin6_port = htons(port);
    address.length = sizeof(*v6);
    address.loopback = std::memcmp(&v6->sin6_addr, &in6addr_loopback, sizeof(in6_addr)) == 0;
    return address;
  }
  return std::nullopt;
}

Error bind_error(int number, const std::string& address, uint16_t port) {
  if (number == EADDRINUSE) {
    return make_error(ErrorCode::kUnavailable, "http",
                      "port {} of {} is in use by another program; stop it (`ss -ltnp 'sport = "
                      ":{}'` names it) or choose another port under [http]",
                      port, address, port);
  }
  return make_error(ErrorCode::kUnavailable, "http", "cannot listen on {} port {}: {}", address,
                    port, std::strerror(number));
}

uint16_t port_of(int fd) {
  sockaddr_storage storage{};
  socklen_t length = sizeof(storage);
  if (getsockname(fd, reinterpret_cast<sockaddr*>(&storage), &length) != 0) return 0;
  return ntohs(storage.ss_family == AF_INET6
                   ? reinterpret_cast<const sockaddr_in6*>(&storage)->sin6_port
                   : reinterpret_cast<const sockaddr_in*>(&storage)->sin_port);
}

}  // namespace

Result<ListenSocket> open_listen_socket(const std::string& address, uint16_t port,
                                        bool allow_remote) {
  const auto parsed = parse_address(address, port);
  if (!parsed) {
    return make_error(ErrorCode::kInvalidInput, "http",
                      "\"{}\" is not a numeric address, such as 127.0.0.1 or ::1", address);
  }
  if (!parsed->loopback && !allow_remote) {
    return make_error(
        ErrorCode::kInvalidInput, "http",
        "{} can be reached from other machines: give out tokens ([access] tokens), or "
        "say that everybody is meant ([http] open = true), or use 127.0.0.1",
        address);
  }
  ListenSocket result;
  result.loopback = parsed->loopback;
  result.fd =
      UniqueFd(socket(parsed->storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!result.fd.is_open()) return bind_error(errno, address, port);
  const int on = 1;
  setsockopt(result.fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  if (bind(result.fd.get(), reinterpret_cast<const sockaddr*>(&parsed->storage), parsed->length) !=
          0 ||
      listen(result.fd.get(), SOMAXCONN) != 0) {
    return bind_error(errno, address, port);
  }
  result.port = port_of(result.fd.get());
  return result;
}

}  // namespace sightline::control
