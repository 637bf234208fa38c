// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/kernels/gradient_kernel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sightline/base/cpu.hpp"
#include "support/random.hpp"

namespace sightline::test {
namespace {

using observe::GradientRow;
using observe::GradientRows;

constexpr int kWidth = 101;  // no multiple of what is computed at once

struct Rows {
  explicit Rows(unsigned seed) {
    Random random(seed);
    for (size_t i = 0; i < bytes.size(); ++i) {
      bytes[i].resize(kWidth);
      // Planes that are flat in places, and as strong as one another in others.
      for (int x = 0; x < kWidth; ++x) {
        const bool flat = x / 12 % 3 == static_cast<int>(i / 3);
        bytes[i][static_cast<size_t>(x)] =
            static_cast<uint8_t>(flat ? 90 : random.uniform(0, 255.99));
      }
    }
    if (seed % 2 != 0) {
      for (size_t i = 3; i < 6; ++i) bytes[i + 3] = bytes[i];
    }
  }
  std::array<GradientRows, 3> planes() const {
    std::array<GradientRows, 3> out;
    for (size_t k = 0; k < 3; ++k) {
      out[k] = {bytes[3 * k].data(), bytes[3 * k + 1].data(), bytes[3 * k + 2].data(),
                k == 0 ? 0.125f : 0.25f};
    }
    return out;
  }
  std::array<std::vector<uint8_t>, 9> bytes;
};

struct Gradients {
  std::vector<float> x = std::vector<float>(kWidth, -1), y = x, magnitude = x;
  GradientRow row() { return {x.data(), y.data(), magnitude.data()}; }
  bool operator==(const Gradients&) const = default;
};

TEST(GradientKernel, IsSobelOfTheStrongestPlane) {
  for (const unsigned seed : {1u, 2u}) {
    const Rows rows(seed);
    Gradients found;
    observe::find_gradients(rows.planes(), 1, kWidth - 1, found.row());
    for (int x = 1; x + 1 < kWidth; ++x) {
      float gx = 0, gy = 0, best = 0;
      for (const GradientRows& p : rows.planes()) {
        const int dx = p.above[x + 1] + 2 * p.here[x + 1] + p.below[x + 1] - p.above[x - 1] -
                       2 * p.here[x - 1] - p.below[x - 1];
        const int dy = p.below[x - 1] + 2 * p.below[x] + p.below[x + 1] - p.above[x - 1] -
                       2 * p.above[x] - p.above[x + 1];
        const float u = p.weight * static_cast<float>(dx), v = p.weight * static_cast<float>(dy);
        if (!(u * u + v * v > best)) continue;
        gx = u, gy = v, best = u * u + v * v;
      }
      const auto i = static_cast<size_t>(x);
      ASSERT_EQ(found.x[i], gx) << x;
      ASSERT_EQ(found.y[i], gy) << x;
      ASSERT_EQ(found.magnitude[i], std::sqrt(best)) << x;
    }
    EXPECT_EQ(found.x.front(), -1) << "not asked for";
    EXPECT_EQ(found.x.back(), -1);
  }
}

TEST(GradientKernel, IsTheSameWithAndWithoutAvx2) {
#ifdef SIGHTLINE_X86_64
  if (!cpu_has_avx2()) GTEST_SKIP() << "this processor has no AVX2";
  for (const unsigned seed : {3u, 4u}) {
    const Rows rows(seed);
    for (const int right : {2, 9, 17, 64, kWidth - 1}) {
      Gradients plain, fast;
      observe::find_gradients_scalar(rows.planes(), 1, right, plain.row());
      observe::find_gradients_avx2(rows.planes(), 1, right, fast.row());
      EXPECT_TRUE(plain == fast) << right;
    }
  }
#endif
}

}  // namespace
}  // namespace sightline::test
