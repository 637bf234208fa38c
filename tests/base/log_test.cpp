// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/log.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "base/line_writer.hpp"
#include "sightline/base/log_output.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using base::LineWriter;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

constexpr size_t kMost = 64 << 10;

struct Channel {
  UniqueFd reader, writer;
};

Channel make_channel(bool socket) {
  std::array<int, 2> fds{};
  EXPECT_EQ(socket ? socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fds.data())
                   : pipe2(fds.data(), O_CLOEXEC),
            0);
  return {UniqueFd(fds[0]), UniqueFd(fds[1])};
}

/// What is there; does not wait.
std::string read_available(int fd) {
  std::string text;
  std::array<char, 4096> chunk;
  for (pollfd ready{fd, POLLIN, 0}; poll(&ready, 1, 0) > 0;) {
    const ssize_t got = read(fd, chunk.data(), chunk.size());
    if (got <= 0) break;
    text.append(chunk.data(), static_cast<size_t>(got));
  }
  return text;
}

LineWriter writer_to(const Channel& channel, size_t most = kMost) {
  return {channel.writer.get(), most,
          [](uint64_t lost) { return std::to_string(lost) + " lost\n"; }};
}

std::string numbered(int number, size_t size = 100) {
  std::string line = std::to_string(number) + " ";
  line.resize(size - 1, 'x');
  return line + "\n";
}

/// The numbers of the lines in order, -N for "N lost"; every line has to be whole.
std::vector<int> numbers_of(const std::string& text) {
  std::vector<int> numbers;
  EXPECT_THAT(text, EndsWith("\n"));
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = text.find('\n', begin);
    const std::string line = text.substr(begin, end - begin);
    const int number = std::atoi(line.c_str());
    const bool lost = line == std::to_string(number) + " lost";
    EXPECT_TRUE(lost || line + "\n" == numbered(number, line.size() + 1)) << line;
    numbers.push_back(lost ? -number : number);
    begin = end + 1;
  }
  return numbers;
}

class LineWriterTo : public testing::TestWithParam<bool> {};

TEST_P(LineWriterTo, WritesAtOnceWhatIsRead) {
  const Channel channel = make_channel(GetParam());
  LineWriter writer = writer_to(channel);
  for (int i = 0; i < 3; ++i) writer.write(numbered(i));
  EXPECT_EQ(numbers_of(read_available(channel.reader.get())), (std::vector{0, 1, 2}));
}

TEST_P(LineWriterTo, AnUnreadOneLosesTheOldestAndSaysHowMany) {
  const Channel channel = make_channel(GetParam());
  LineWriter writer = writer_to(channel);
  constexpr int kCount = 20'000;  // 2 MB: pipes and sockets hold less
  for (int i = 0; i < kCount; ++i) writer.write(numbered(i));
  EXPECT_GT(writer.lost(), 0u);
  EXPECT_FALSE(writer.flush(0ms));
  std::string text;
  while (!writer.flush(0ms)) text += read_available(channel.reader.get());
  text += read_available(channel.reader.get());
  const std::vector<int> numbers = numbers_of(text);
  int next = 0;
  for (const int number : numbers) {
    if (number < 0) {
      next -= number;  // they would have stood here
    } else {
      EXPECT_EQ(number, next++);
    }
  }
  EXPECT_EQ(next, kCount);
}

TEST_P(LineWriterTo, ALineLongerThanAllThatIsKeptIsLostAloneOrWrittenWhole) {
  const Channel channel = make_channel(GetParam());
  LineWriter writer = writer_to(channel);
  writer.write(numbered(0, 4 << 20));
  writer.write(numbered(1));
  std::string text;
  while (!writer.flush(0ms)) text += read_available(channel.reader.get());
  text += read_available(channel.reader.get());
  EXPECT_EQ(numbers_of(text), (std::vector{0, 1}));
}

TEST_P(LineWriterTo, AFlushWaitsForTheReaderButNotForEver) {
  const Channel channel = make_channel(GetParam());
  LineWriter writer = writer_to(channel, 1 << 20);
  for (int i = 0; i < 5000; ++i) writer.write(numbered(i));
  EXPECT_FALSE(writer.flush(10ms));
  std::string text;
  std::jthread reader([&](std::stop_token stop) {
    while (!stop.stop_requested()) text += read_available(channel.reader.get());
  });
  EXPECT_TRUE(writer.flush(20s));
  EXPECT_EQ(writer.lost(), 0u);
}

TEST_P(LineWriterTo, AReaderThatIsGoneIsNoError) {
  Channel channel = make_channel(GetParam());
  LineWriter writer = writer_to(channel);
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  channel.reader.reset();
  for (int i = 0; i < 3; ++i) writer.write(numbered(i));
  EXPECT_TRUE(writer.flush(20s));
  EXPECT_EQ(writer.lost(), 3u);
  std::signal(SIGPIPE, before);
}

INSTANTIATE_TEST_SUITE_P(LineWriter, LineWriterTo, testing::Bool(), [](const auto& param) {
  return param.param ? std::string("Socket") : std::string("Pipe");
});

TEST(ReopenWithoutBlocking, LeavesTheOtherHoldersAlone) {
  const Channel channel = make_channel(false);
  const UniqueFd other(fcntl(channel.writer.get(), F_DUPFD_CLOEXEC, 0));
  base::reopen_without_blocking(channel.writer.get());
  EXPECT_NE(fcntl(channel.writer.get(), F_GETFL) & O_NONBLOCK, 0);
  EXPECT_EQ(fcntl(other.get(), F_GETFL) & O_NONBLOCK, 0);
  EXPECT_EQ(write(channel.writer.get(), "a\n", 2), 2);
  EXPECT_EQ(read_available(channel.reader.get()), "a\n");
}

/// What `log` writes to stderr in a process of its own, as the first that is logged: this one must
/// not log anything.
std::string stderr_of(bool journal, const std::function<void()>& log) {
  Channel channel = make_channel(false);
  const pid_t child = fork();
  if (child == 0) {
    dup2(channel.writer.get(), STDERR_FILENO);
    if (journal) {
      setenv("JOURNAL_STREAM", "1:2", 1);
    } else {
      unsetenv("JOURNAL_STREAM");
    }
    log();
    _exit(0);
  }
  channel.writer.reset();
  std::string text;
  std::array<char, 4096> chunk;
  for (ssize_t got = 0; (got = read(channel.reader.get(), chunk.data(), chunk.size())) > 0;) {
    text.append(chunk.data(), static_cast<size_t>(got));
  }
  return text;
}

TEST(Log, EachLineOfAMessageHasItsPriorityUnderTheJournal) {
  for (const bool waits : {true, false}) {
    const std::string text = stderr_of(true, [waits] {
      if (!waits) log::never_wait();
      log::error("first\nsecond\nthird");
      log::info("fourth");
    });
    EXPECT_EQ(text, "<3>first\n<3>second\n<3>third\n<6>fourth\n");
  }
}

TEST(Log, SaysTimeAndLevelElsewhere) {
  for (const bool waits : {true, false}) {
    const std::string text = stderr_of(false, [waits] {
      if (!waits) log::never_wait();
      log::warning("look");
    });
    EXPECT_THAT(text, testing::MatchesRegex("[0-9:.]+ warning +look\n"));
  }
}

TEST(Log, WhatIsKeptComesOutAtTheEnd) {
  const std::string text = stderr_of(true, [] {
    log::never_wait();
    for (int i = 0; i < 2000; ++i) log::info("{} {}", i, std::string(90, 'x'));
    log::error("the end");
    (void)log::flush(20s);
  });
  EXPECT_THAT(text, StartsWith("<6>0 xxx"));
  EXPECT_THAT(text, EndsWith("<3>the end\n"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2001);
}

}  // namespace
}  // namespace sightline
