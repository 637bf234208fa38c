// SPDX-License-Identifier: Apache-2.0
#include "service_manager.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <string>

#include "sightline/base/unique_fd.hpp"

namespace sightline {
namespace {

// The service manager's end of the socket.
class ServiceManagerTest : public testing::Test {
 protected:
  ServiceManagerTest() : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    const std::string name = "@sightline-notify-" + std::to_string(::getpid());
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, name.data(), name.size());
    address.sun_path[0] = 0;
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<sockaddr*>(&address), size), 0);
    ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  ~ServiceManagerTest() override { ::unsetenv("NOTIFY_SOCKET"); }

  std::string read() {
    char bytes[512];
    const ssize_t got = ::recv(socket_.get(), bytes, sizeof bytes, 0);
    return got < 0 ? "" : std::string(bytes, static_cast<size_t>(got));
  }

  UniqueFd socket_;
  const ServiceManager manager_{};
};

TEST_F(ServiceManagerTest, TellsWhatSystemdUnderstands) {
  manager_.ready("three cameras");
  EXPECT_EQ(read(), "READY=1\nSTATUS=three cameras");
  manager_.feed_watchdog();
  EXPECT_EQ(read(), "WATCHDOG=1");
  manager_.reloading();
  EXPECT_EQ(read().substr(0, 26), "RELOADING=1\nMONOTONIC_USEC");
  manager_.stopping();
  EXPECT_EQ(read(), "STOPPING=1");
  EXPECT_EQ(read(), "");
}

// Would hang until the test's time limit.
TEST_F(ServiceManagerTest, AReaderThatSleepsStopsNobody) {
  constexpr int kSent = 16;  // the kernel's queue takes some ten
  for (int i = 0; i < kSent; ++i) manager_.status(std::to_string(i));
  int received = 0;
  while (!read().empty()) ++received;
  EXPECT_GT(received, 0);
  EXPECT_LE(received, kSent);
  manager_.feed_watchdog();
  EXPECT_EQ(read(), "WATCHDOG=1");
}

TEST(ServiceManager, WithoutOneNothingHappens) {
  ::unsetenv("NOTIFY_SOCKET");
  ServiceManager().ready("");
  ::setenv("NOTIFY_SOCKET", "/nowhere/there", 1);
  ServiceManager().feed_watchdog();
  ::setenv("NOTIFY_SOCKET", "nonsense", 1);
  ServiceManager().stopping();
  ::unsetenv("NOTIFY_SOCKET");
}

}  // namespace
}  // namespace sightline
