// SPDX-License-Identifier: Apache-2.0
#include "stream/rtsp_connections.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

namespace sightline::stream {
namespace {

using std::chrono::seconds;

RemoteHost peer(const std::string& address) {
  return {address, address, 1000, address.starts_with("127.")};
}
Occupant occupant(const std::string& address, int since_s, bool idle, bool leaving = false) {
  return {address, time_from_ns(int64_t{since_s} * 1'000'000'000), idle, leaving};
}
std::vector<Occupant> viewers(const std::string& address, size_t count) {
  return std::vector<Occupant>(count, occupant(address, 0, false));
}

TEST(Admission, TakesWhoeverFindsAFreePlace) {
  const auto three = viewers("127.0.0.1", 3);
  const Admission admission = admit(three, peer("127.0.0.1"), {4, 0});
  EXPECT_TRUE(admission.admitted);
  EXPECT_FALSE(admission.instead_of);
  EXPECT_FALSE(admit(viewers("127.0.0.1", 4), peer("10.0.0.1"), {4, 0}).admitted);
}

TEST(Admission, TheOldestIdleConnectionGivesWay) {
  const std::vector<Occupant> full = {
      occupant("127.0.0.1", 1, false), occupant("127.0.0.1", 9, true),
      occupant("127.0.0.1", 5, true), occupant("127.0.0.1", 7, true)};
  const Admission admission = admit(full, peer("127.0.0.1"), {4, 0});
  EXPECT_TRUE(admission.admitted);
  EXPECT_EQ(admission.instead_of, 2u);
}

TEST(Admission, TheAddressThatHasTheMostGivesWayFirst) {
  const std::vector<Occupant> full = {occupant("10.0.0.7", 1, true), occupant("10.0.0.8", 5, true),
                                      occupant("10.0.0.8", 3, true),
                                      occupant("127.0.0.1", 0, false)};
  EXPECT_EQ(admit(full, peer("10.0.0.9"), {4, 0}).instead_of, 2u);
}

TEST(Admission, OneOtherHostDoesNotTakeEveryPlace) {
  auto taken = viewers("10.0.0.7", 24);
  EXPECT_FALSE(admit(taken, peer("10.0.0.7"), {32, 0}).admitted);
  EXPECT_TRUE(admit(taken, peer("10.0.0.8"), {32, 0}).admitted);
  taken.pop_back();
  EXPECT_TRUE(admit(taken, peer("10.0.0.7"), {32, 0}).admitted);
  // All viewers on this host have one address.
  EXPECT_TRUE(admit(viewers("127.0.0.1", 31), peer("127.0.0.1"), {32, 0}).admitted);
  EXPECT_TRUE(admit({}, peer("10.0.0.7"), {1, 0}).admitted);
}

TEST(Admission, AnAddressThatHasAllItMayHaveExchangesItsOwn) {
  const std::vector<Occupant> some = {occupant("10.0.0.8", 0, true), occupant("127.0.0.1", 2, true),
                                      occupant("127.0.0.1", 3, false)};
  EXPECT_EQ(admit(some, peer("127.0.0.1"), {32, 2}).instead_of, 1u);
  EXPECT_FALSE(admit(viewers("127.0.0.1", 2), peer("127.0.0.1"), {32, 2}).admitted);
}

TEST(Admission, ThoseThatLeaveHoldNoPlaceButAreNotWithoutNumber) {
  std::vector<Occupant> leaving(4, occupant("127.0.0.1", 0, false, true));
  EXPECT_TRUE(admit(leaving, peer("127.0.0.1"), {4, 0}).admitted);
  leaving.push_back(leaving.front());
  EXPECT_FALSE(admit(leaving, peer("127.0.0.1"), {4, 0}).admitted);
}

/// Connections whose other ends the test holds.
class Connections : public testing::Test {
 protected:
  static constexpr Time kStart = time_from_ns(1'000'000'000'000);

  /// The client's key; even numbers have a session.
  void connect(const void* client) {
    int ends[2] = {-1, -1};
    ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
    far_ends_[client] = UniqueFd(ends[1]);
    inputs_[client] = std::make_shared<GuardedInput>();
    connections_.add(client,
                     {peer("127.0.0.1"), inputs_[client], UniqueFd(ends[0]), kStart, false});
  }
  bool was_ended(const void* client) const {
    pollfd waiting{far_ends_.at(client).get(), POLLIN, 0};
    return poll(&waiting, 1, 0) == 1;
  }
  void say(const void* client, std::string_view text, Time now) {
    inputs_.at(client)->guard.take({reinterpret_cast<const uint8_t*>(text.data()), text.size()},
                                   now);
  }
  static bool has_session(const void* client) { return *static_cast<const int*>(client) % 2 == 0; }

  RtspConnections connections_{{3, 0}, has_session};
  std::map<const void*, UniqueFd> far_ends_;
  std::map<const void*, std::shared_ptr<GuardedInput>> inputs_;
  const int watching_ = 0, asking_ = 1, silent_ = 3;
};

TEST_F(Connections, EndThoseThatDoNotComeToThePoint) {
  for (const int* client : {&watching_, &asking_, &silent_}) connect(client);
  const std::string_view request = "OPTIONS * RTSP/1.0\r\n\r\n";
  say(&watching_, request, kStart);
  say(&asking_, request, kStart);
  connections_.end_overdue(kStart + seconds(10));
  EXPECT_FALSE(was_ended(&silent_));
  connections_.end_overdue(kStart + seconds(11));
  EXPECT_TRUE(was_ended(&silent_));
  EXPECT_FALSE(was_ended(&asking_));
  connections_.end_overdue(kStart + seconds(21));
  EXPECT_TRUE(was_ended(&asking_));
  say(&watching_, "GET_PARA", kStart + seconds(3600));
  connections_.end_overdue(kStart + seconds(3610));
  EXPECT_FALSE(was_ended(&watching_));
  connections_.end_overdue(kStart + seconds(3611));
  EXPECT_TRUE(was_ended(&watching_));
  EXPECT_EQ(connections_.count(), 3);  // until their threads say that they have gone
}

TEST_F(Connections, MakeRoomByEndingAnIdleOne) {
  for (const int* client : {&watching_, &asking_, &silent_}) connect(client);
  EXPECT_TRUE(connections_.make_room(peer("127.0.0.1")));
  EXPECT_TRUE(was_ended(&asking_) != was_ended(&silent_));
  EXPECT_FALSE(was_ended(&watching_));
  connections_.remove(&asking_);
  EXPECT_EQ(connections_.count(), 2);
}

}  // namespace
}  // namespace sightline::stream
