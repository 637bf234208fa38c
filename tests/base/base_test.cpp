// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <memory>
#include <thread>

#include "sightline/base/bounded_queue.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/latest_slot.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/thread.hpp"
#include "sightline/base/time.hpp"
#include "sightline/base/toml_nesting.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

Result<int> half(int x) {
  if (x % 2 != 0) return make_error(ErrorCode::kInvalidInput, "here", "{} is odd", x);
  return x / 2;
}

Result<int> quarter(int x) {
  SL_ASSIGN(const int h, half(x));
  return half(h);
}

TEST(Result, CarriesValueOrError) {
  EXPECT_EQ(*quarter(8), 2);
  const auto failed = quarter(6);
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().message(), "here: 3 is odd");
  EXPECT_EQ(exit_code(failed.error()), 2);
}

TEST(Result, HoldsMoveOnlyValues) {
  Result<std::unique_ptr<int>> r(std::make_unique<int>(3));
  std::unique_ptr<int> p = *std::move(r);
  EXPECT_EQ(*p, 3);
}

TEST(ResultDeathTest, ValueOfAnErrorAborts) { EXPECT_DEATH((void)*half(3), "3 is odd"); }

TEST(LatestSlot, NewestWinsAndDropsAreCounted) {
  LatestSlot<int> slot;
  EXPECT_FALSE(slot.put(1));
  EXPECT_TRUE(slot.put(2));
  EXPECT_EQ(slot.take({}, 0ms), 2);
  EXPECT_EQ(slot.take({}, 0ms), std::nullopt);
  EXPECT_EQ(slot.dropped(), 1u);
}

TEST(LatestSlot, StopEndsAWait) {
  LatestSlot<int> slot;
  std::jthread waiter([&](std::stop_token stop) { EXPECT_EQ(slot.take(stop, 1h), std::nullopt); });
  waiter.request_stop();
}

TEST(BoundedQueue, KeepsOrderAndDropsOldest) {
  BoundedQueue<int> queue(2);
  EXPECT_FALSE(queue.push(1));
  EXPECT_FALSE(queue.push(2));
  EXPECT_TRUE(queue.push(3));
  EXPECT_EQ(queue.pop({}, 0ms), 2);
  EXPECT_EQ(queue.pop({}, 0ms), 3);
  EXPECT_EQ(queue.pop({}, 0ms), std::nullopt);
  EXPECT_EQ(queue.dropped(), 1u);
}

TEST(Registry, SameNameAndLabelsIsTheSameCounter) {
  Registry registry;
  registry.counter("b_total", "b", {{"camera", "left"}}).add(2);
  registry.counter("b_total", "b", {{"camera", "left"}}).add(1);
  registry.gauge("a", "a").set(0.5);
  const auto samples = registry.samples();
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(samples[0].name, "a");
  EXPECT_EQ(samples[1].value, 3.0);
}

TEST(Registry, AHistogramCountsUpToEachBound) {
  Registry registry;
  LatencyHistogram& histogram = registry.histogram("a_seconds", "a", {{"stage", "sent"}});
  for (const double seconds : {0.0, 0.001, 0.0011, 0.2, 99.0}) histogram.observe(seconds);
  const auto sample = registry.samples().at(0);
  EXPECT_EQ(sample.kind, Registry::Kind::kHistogram);
  EXPECT_DOUBLE_EQ(sample.value, 99.2021);
  ASSERT_EQ(sample.cumulative.size(), LatencyHistogram::kBounds.size() + 1);
  EXPECT_EQ(sample.cumulative[0], 2u);
  EXPECT_EQ(sample.cumulative[1], 3u);
  EXPECT_EQ(sample.cumulative[LatencyHistogram::kBounds.size() - 1], 4u);
  EXPECT_EQ(sample.cumulative.back(), 5u);
  registry.remove("stage", "sent");
  EXPECT_TRUE(registry.samples().empty());
}

TEST(StartThread, ReportsAnException) {
  std::string failure;
  start_thread(
      "thrower", [](std::stop_token) { throw std::runtime_error("boom"); },
      [&](const std::string& what) { failure = what; })
      .join();
  EXPECT_EQ(failure, "thrower: boom");
}

class Files : public testing::Test {
 protected:
  void SetUp() override {
    char name[] = "/tmp/sightline_files.XXXXXX";
    directory_ = mkdtemp(name);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  std::filesystem::path directory_;
};

TEST_F(Files, WritesAsideAndReplaces) {
  const auto path = directory_ / "a.txt";
  ASSERT_TRUE(write_file_atomically(path, "one"));
  ASSERT_TRUE(write_file_atomically(path, "two"));
  EXPECT_EQ(*read_file(path), "two");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_), {}), 1);
}

TEST_F(Files, RefusesWhatIsNotAFile) {
  EXPECT_EQ(read_file(directory_ / "none").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(read_file(directory_).error().code, ErrorCode::kInvalidInput);
  std::filesystem::create_symlink("circle", directory_ / "circle");
  EXPECT_EQ(read_file(directory_ / "circle").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(read_file(directory_ / std::string(300, 'x')).error().code, ErrorCode::kNotFound);
  mkfifo((directory_ / "fifo").c_str(), 0600);
  EXPECT_EQ(read_file(directory_ / "fifo").error().code, ErrorCode::kInvalidInput);
  ASSERT_TRUE(write_file_atomically(directory_ / "big", std::string(100, 'x')));
  EXPECT_THAT(read_file(directory_ / "big", 10).error().text, testing::HasSubstr("larger"));
}

TEST_F(Files, ASparseFileOfAnySizeIsRefusedBeforeItIsRead) {
  ASSERT_TRUE(write_file_atomically(directory_ / "sparse", "x"));
  std::error_code code;
  std::filesystem::resize_file(directory_ / "sparse", uint64_t{8} << 40, code);
  if (code) GTEST_SKIP() << "no sparse file of 8 TB here: " << code.message();
  EXPECT_THAT(read_file(directory_ / "sparse").error().text, testing::HasSubstr("larger"));
}

std::string repeated(std::string_view part, size_t count) {
  std::string text;
  for (size_t i = 0; i < count; ++i) text += part;
  return text;
}

TEST(TomlNesting, DeepHeadersKeysAndListsAreRefused) {
  const auto where = [](const std::string& text) {
    const Status status = check_toml_nesting(text, "f.toml");
    return status ? std::string("accepted") : status.error().where;
  };
  EXPECT_EQ(where("a = 1\n[" + repeated("a.", 35000) + "a]\n"), "f.toml:2:65");
  EXPECT_EQ(where(repeated("a . ", 40) + "a = 1\n"), "f.toml:1:127");
  EXPECT_EQ(where("a = " + repeated("[", 35000)), "f.toml:1:37");
  EXPECT_EQ(where("a = " + repeated("{a=", 35000)), "f.toml:1:101");
  EXPECT_EQ(where(repeated("\"x.y\".", 35000) + "a = 1"), "f.toml:1:192");
  // A quote right before the three that close belongs to the text.
  EXPECT_NE(where("a = {x = \"\"\"y\"\"\"\", " + repeated("b.", 35000) + "b = 1}"), "accepted");
}

TEST(TomlNesting, LongFlatFilesAreAccepted) {
  const auto accepts = [](const std::string& text) {
    return check_toml_nesting(text, "f.toml").has_value();
  };
  EXPECT_TRUE(accepts("a = [" + repeated("[1.5, 2.5],\n", 1000) + "]\n"));
  EXPECT_TRUE(accepts(repeated("[[a.b]]\nc = {d.e = 1.5}\n", 1000)));
  const std::string brackets(1000, '[');
  EXPECT_TRUE(accepts("a = \"" + brackets + "\" # " + brackets));
  EXPECT_TRUE(accepts("a = '" + brackets + "\\' # '" + brackets));
  EXPECT_TRUE(accepts("a = \"\"\"\n\"" + brackets + "\\\"\"\"\"\n"));
  EXPECT_TRUE(accepts("a = '''\n'" + brackets + "'''\n"));
  EXPECT_TRUE(accepts("a = \"" + repeated(".", 1000) + "\""));
}

TEST_F(Files, UniqueFdClosesOnce) {
  UniqueFd fd(open("/dev/null", O_RDONLY));
  const int number = fd.get();
  UniqueFd moved(std::move(fd));
  EXPECT_EQ(fcntl(number, F_GETFD) >= 0, true);
  moved.reset();
  EXPECT_EQ(fcntl(number, F_GETFD), -1);
}

TEST(Time, RoundTripsSeconds) {
  EXPECT_EQ(from_seconds(0.033), Duration(33'000'000));
  EXPECT_DOUBLE_EQ(to_seconds(Duration(1'500'000'000)), 1.5);
  EXPECT_EQ(to_ns(time_from_ns(42)), 42);
}

}  // namespace
}  // namespace sightline
