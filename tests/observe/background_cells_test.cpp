// SPDX-License-Identifier: Apache-2.0
#include "observe/scene/background_cells.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "sightline/base/cpu.hpp"

namespace sightline::observe {
namespace {

constexpr int kWidth = 333, kHeight = 3;  // no multiple of what is computed at once

struct Row {
  std::array<std::vector<uint8_t>, 3> levels;
  std::vector<uint8_t> occupied;

  std::array<const uint8_t*, 3> data() const {
    return {levels[0].data(), levels[1].data(), levels[2].data()};
  }
};

// A scene at rest with noise; now and then something else stands or passes before it.
Row observed(int y, int time, std::mt19937& random) {
  std::normal_distribution<double> noise(0, 1.5);
  std::bernoulli_distribution rarely(0.05);
  Row row;
  row.occupied.resize(kWidth);
  for (auto& plane : row.levels) plane.resize(kWidth);
  for (int x = 0; x < kWidth; ++x) {
    const auto i = static_cast<size_t>(x);
    const bool in_front = (x / 40 == 3 && time > 30) || rarely(random);
    for (size_t k = 0; k < 3; ++k) {
      const double level = (x * 37 + y * 11 + static_cast<int>(k) * 50) % 240 + 8;
      row.levels[k][i] = static_cast<uint8_t>(
          std::clamp(level + noise(random) + (in_front ? 60.0 : 0.0), 0.0, 255.0));
    }
    row.occupied[i] = rarely(random) ? 1 : 0;
  }
  return row;
}

void expect_equal(const BackgroundCells& a, const BackgroundCells& b) {
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const size_t i = a.index(x, y);
      ASSERT_EQ(a.age(i), b.age(i)) << x;
      for (size_t k = 0; k < 3; ++k) ASSERT_EQ(a.mean_row(k, y)[x], b.mean_row(k, y)[x]) << x;
      for (size_t k = 0; k < 2; ++k) ASSERT_EQ(a.spread(k, i), b.spread(k, i)) << x;
    }
  }
}

TEST(BackgroundCells, ARowIsLearnedLikeEachOfItsCells) {
  std::mt19937 random(5);
  BackgroundCells rows(50), cells(50);
  rows.reset(kWidth, kHeight);
  cells.reset(kWidth, kHeight);
  size_t changed = 0;
  for (int time = 0; time < 90; ++time) {
    const int part = 180 * BackgroundCells::kUnit + 300 * (time % 5) * BackgroundCells::kUnit / 10;
    for (int y = 0; y < kHeight; ++y) {
      const Row row = observed(y, time, random);
      const auto learned = rows.learn_row(y, row.data(), row.occupied.data(), part);
      BackgroundCells::Learned each;
      for (int x = 0; x < kWidth; ++x) {
        const auto i = static_cast<size_t>(x);
        if (row.occupied[i] != 0) continue;
        ++each.observed;
        const BackgroundCells::Color color{light_free(row.levels[0][i], kBlack, part),
                                           light_free(row.levels[1][i], kNeutral, part),
                                           light_free(row.levels[2][i], kNeutral, part)};
        each.changed += cells.learn(cells.index(x, y), color) ? 0 : 1;
      }
      ASSERT_EQ(learned.observed, each.observed);
      ASSERT_EQ(learned.changed, each.changed);
      changed += each.changed;
    }
    if (time % 16 == 7) {
      EXPECT_EQ(rows.measure_min_spread(), cells.measure_min_spread());
    }
    if (time == 60) {
      rows.relearn();
      cells.relearn();
    }
  }
  EXPECT_GT(changed, 1000u) << "then this says nothing of what differs";
  expect_equal(rows, cells);
}

TEST(BackgroundCells, LearnTheSameWithAndWithoutAvx2) {
#ifdef SIGHTLINE_X86_64
  if (!cpu_has_avx2()) GTEST_SKIP() << "this processor has no AVX2";
  std::mt19937 random(6);
  const Row seen = observed(0, 0, random);
  std::uniform_int_distribution<int> age(0, 60), level(-3072, 32000), spread(0, 600);
  struct Cells {
    std::array<std::vector<int16_t>, 3> mean;
    std::array<std::vector<int16_t>, 2> spread;
    std::vector<uint8_t> age, rival, usual;
    bool operator==(const Cells&) const = default;
  } plain;
  for (int x = 0; x < kWidth; ++x) {
    const auto i = static_cast<size_t>(x);
    for (size_t k = 0; k < 3; ++k) {
      const bool far = x % 7 == 0;
      plain.mean[k].push_back(static_cast<int16_t>(
          far ? level(random) : light_free(seen.levels[k][i], k == 0 ? kBlack : kNeutral, 16384)));
    }
    for (auto& plane : plain.spread) plane.push_back(static_cast<int16_t>(spread(random)));
    plain.age.push_back(static_cast<uint8_t>(age(random)));
    plain.rival.push_back(static_cast<uint8_t>(age(random) / 20));
  }
  plain.usual.resize(kWidth);
  Cells fast = plain;
  const auto row_of = [&](Cells& cells) {
    BackgroundRow row{seen.data(),      seen.occupied.data(), {}, {},    {64, 64},
                      cells.age.data(), cells.rival.data(),   50, 16384, kWidth};
    for (size_t k = 0; k < 3; ++k) row.mean[k] = cells.mean[k].data();
    for (size_t k = 0; k < 2; ++k) row.spread[k] = cells.spread[k].data();
    return row;
  };
  learn_usual_scalar(row_of(plain), plain.usual.data());
  learn_usual_avx2(row_of(fast), fast.usual.data());
  EXPECT_TRUE(plain == fast);
  EXPECT_GT(std::count(plain.usual.begin(), plain.usual.end(), 1), kWidth / 2);
#endif
}

}  // namespace
}  // namespace sightline::observe
