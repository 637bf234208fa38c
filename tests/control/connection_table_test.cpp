// SPDX-License-Identifier: Apache-2.0
#include "control/connection_table.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>

#include <string>

namespace sightline::control {
namespace {

using namespace std::chrono_literals;

constexpr Time kStart = time_from_ns(1'000'000'000);

PeerKey key_of(const std::string& text) {
  sockaddr_in v4{};
  if (inet_pton(AF_INET, text.c_str(), &v4.sin_addr) == 1) {
    v4.sin_family = AF_INET;
    return peer_key(reinterpret_cast<const sockaddr*>(&v4));
  }
  sockaddr_in6 v6{};
  EXPECT_EQ(inet_pton(AF_INET6, text.c_str(), &v6.sin6_addr), 1) << text;
  v6.sin6_family = AF_INET6;
  return peer_key(reinterpret_cast<const sockaddr*>(&v6));
}

TEST(PeerKey, IsAnAddressOrANetworkThatOneHostHasToItself) {
  EXPECT_EQ(key_of("192.0.2.1"), key_of("192.0.2.1"));
  EXPECT_NE(key_of("192.0.2.1"), key_of("192.0.2.2"));
  EXPECT_EQ(key_of("2001:db8::1"), key_of("2001:db8::ffff:1:2"));
  EXPECT_NE(key_of("2001:db8::1"), key_of("2001:db8:0:1::1"));
  EXPECT_EQ(key_of("::ffff:192.0.2.1"), key_of("192.0.2.1"));
  EXPECT_NE(key_of("::ffff:192.0.2.1"), key_of("::ffff:192.0.2.2"));
}

TEST(ConnectionTable, TheDeadlineRunsFromTheStartAndFromEachAnswer) {
  ConnectionTable table(4, 10s, 100ms);
  EXPECT_FALSE(table.next_deadline());
  auto* const slow = table.add(1, key_of("192.0.2.1"), kStart);
  auto* const answered = table.add(2, key_of("192.0.2.2"), kStart);
  EXPECT_EQ(table.next_deadline(), kStart + 10s);
  EXPECT_EQ(table.overdue(kStart + 10s - 1ns), nullptr);
  table.answered(answered, kStart + 5s);
  EXPECT_EQ(table.overdue(kStart + 10s), slow);
  table.cut(slow);
  EXPECT_EQ(table.overdue(kStart + 10s), nullptr);
  EXPECT_EQ(table.next_deadline(), kStart + 15s);
  EXPECT_EQ(table.size(), 2u);
  table.remove(slow);
  table.remove(answered);
  EXPECT_EQ(table.size(), 0u);
}

TEST(ConnectionTable, TheOldestGivesWayUnlessAllAreNew) {
  ConnectionTable table(2, 10s, 100ms);
  auto* const first = table.add(1, key_of("192.0.2.1"), kStart);
  EXPECT_FALSE(table.full());
  auto* const second = table.add(2, key_of("192.0.2.1"), kStart + 50ms);
  EXPECT_TRUE(table.full());
  EXPECT_EQ(table.yields(kStart + 60ms), nullptr);
  EXPECT_EQ(table.next_yield(kStart + 60ms), kStart + 100ms);
  EXPECT_EQ(table.yields(kStart + 200ms), first);
  table.answered(first, kStart + 60ms);
  EXPECT_EQ(table.yields(kStart + 200ms), second);
  table.cut(second);
  EXPECT_FALSE(table.full());
  EXPECT_EQ(table.yields(kStart + 200ms), first);
  table.remove(second);
  EXPECT_EQ(table.size(), 1u);
}

TEST(ConnectionTable, WhoHoldsMostGivesWayFirst) {
  ConnectionTable table(4, 10s, 100ms);
  auto* const honest = table.add(1, key_of("192.0.2.1"), kStart);
  auto* const greedy = table.add(2, key_of("192.0.2.66"), kStart + 1s);
  auto* const more = table.add(3, key_of("192.0.2.66"), kStart + 2s);
  EXPECT_EQ(table.yields(kStart + 5s), greedy);
  table.cut(greedy);
  EXPECT_EQ(table.yields(kStart + 5s), honest);  // even now, so the older
  table.remove(honest);
  EXPECT_EQ(table.yields(kStart + 5s), more);
}

}  // namespace
}  // namespace sightline::control
