// SPDX-License-Identifier: Apache-2.0
#include "sightline/pipeline/parallel.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace sightline {
namespace {

class Executors
    : public testing::TestWithParam<void (*)(size_t, const std::function<void(size_t)>&)> {};

TEST_P(Executors, EveryIndexIsRunOnce) {
  std::vector<std::atomic<int>> runs(100);
  GetParam()(runs.size(), [&](size_t i) { ++runs[i]; });
  for (const auto& each : runs) EXPECT_EQ(each, 1);
  GetParam()(0, [](size_t) { FAIL() << "there is nothing to run"; });
}

TEST_P(Executors, WhatIsThrownComesOutAfterAllHaveRun) {
  std::atomic<int> ended{0};
  const auto body = [&](size_t i) {
    if (i == 3) throw std::runtime_error("of the fourth");
    ++ended;
  };
  EXPECT_THROW(GetParam()(20, body), std::runtime_error);
  EXPECT_EQ(ended, 19);
}

TEST_P(Executors, AllErrorsAreSaidTheLowestIndexFirst) {
  const Status done = for_each_index(GetParam(), 10, [](size_t i) -> Status {
    if (i != 4 && i != 7 && i != 8) return {};
    return make_error(i == 4 ? ErrorCode::kIo : ErrorCode::kDamaged, "part", "{}", i == 8 ? 4 : i);
  });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kIo);
  EXPECT_EQ(done.error().message(), "part: 4\npart: 7");
}

INSTANTIATE_TEST_SUITE_P(Parallel, Executors, testing::Values(&run_serially, &run_in_parallel));

}  // namespace
}  // namespace sightline
