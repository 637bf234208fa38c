// SPDX-License-Identifier: Apache-2.0
#include "control/host_name.hpp"

#include <gtest/gtest.h>

#include <string>

namespace sightline::control {
namespace {

TEST(HostName, LoopbackHasThreeKindsOfNames) {
  for (const std::string host :
       {"localhost", "LocalHost", "localhost:80", "localhost:65535", "127.0.0.1", "127.0.0.1:8080",
        "127.255.255.254", "[::1]", "[::1]:8080", "[0:0:0:0:0:0:0:1]:1"}) {
    EXPECT_TRUE(names_loopback(host)) << host;
  }
}

TEST(HostName, WhatOnlyBeginsLikeItIsAnother) {
  for (const std::string host : {"[::1].evil",
                                 "[::1]x",
                                 "[::1].evil:80",
                                 "[::1]@evil",
                                 "[::1]]",
                                 "[::1",
                                 "[]",
                                 "[",
                                 "localhost.evil",
                                 "localhost.",
                                 "localhostx",
                                 "xlocalhost",
                                 "localhost evil",
                                 "localhost/x",
                                 "127.0.0.1.evil",
                                 "127.evil",
                                 "127.1evil",
                                 "127.0.0.1x",
                                 "127.0.0.1.",
                                 "127.0.0.1.1"}) {
    EXPECT_FALSE(names_loopback(host)) << host;
  }
}

TEST(HostName, OtherAddressesAreNotLoopback) {
  for (const std::string host : {"", "128.0.0.1", "0.0.0.0", "10.0.0.1", "[::]", "[::2]", "::1",
                                 "[::ffff:127.0.0.1]", "[127.0.0.1]", "[localhost]", "evil.example",
                                 "127", "127.1", "0x7f.0.0.1", "2130706433", "127..0.1"}) {
    EXPECT_FALSE(names_loopback(host)) << host;
  }
}

TEST(HostName, APortIsANumber) {
  for (const std::string port : {":", ":x", ":80x", ":-1", ":+1", ": 80", ":80 ", ":65536",
                                 ":99999999999999999999", ":80:80", ":80.evil", ":@evil"}) {
    for (const std::string name : {"localhost", "127.0.0.1", "[::1]"}) {
      EXPECT_FALSE(names_loopback(name + port)) << name << port;
    }
  }
}

TEST(HostName, NothingHidesBehindAZero) {
  EXPECT_FALSE(names_loopback(std::string("localhost\0.evil", 15)));
  EXPECT_FALSE(names_loopback(std::string("127.0.0.1\0.evil", 15)));
  EXPECT_FALSE(names_loopback(std::string("[::1\0]", 6)));
}

}  // namespace
}  // namespace sightline::control
