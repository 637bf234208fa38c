// SPDX-License-Identifier: Apache-2.0
// What is looked up for many places at once is what plain code finds, one place after the other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "observe/detect/kernels/response_kernel.hpp"
#include "observe/detect/pixels/edge_maps.hpp"
#include "observe/detect/pixels/sample_edges.hpp"
#include "sightline/base/cpu.hpp"
#include "support/random.hpp"

namespace sightline::test {
namespace {

using observe::EdgeImage;
using observe::HalfSizeImage;
using observe::PlacedFeatures;
using observe::ResponseMaps;

constexpr int kWidth = 122, kHeight = 94;  // of the half-size image; no multiples

// Blocks of random colors: edges of all directions, and flat places.
EdgeImage blocks(unsigned seed) {
  Random random(seed);
  HalfSizeImage image;
  image.width = kWidth;
  image.height = kHeight;
  for (auto& plane : image.planes) plane.assign(size_t{kWidth} * kHeight, 128);
  for (int block = 0; block < 30; ++block) {
    const int left = static_cast<int>(random.uniform(-10, kWidth));
    const int top = static_cast<int>(random.uniform(-10, kHeight));
    const auto level = static_cast<uint8_t>(random.uniform(0, 255));
    const double slope = random.uniform(-1, 1);
    for (int y = std::max(0, top); y < std::min(kHeight, top + 20); ++y) {
      const int from = left + static_cast<int>(slope * (y - top));
      for (int x = std::max(0, from); x < std::min(kWidth, from + 25); ++x)
        image.planes[0][static_cast<size_t>(y * kWidth + x)] = level;
    }
  }
  EdgeImage edges;
  edges.compute(image);
  return edges;
}

PlacedFeatures features(Random& random, size_t count) {
  PlacedFeatures out;
  out.count = count;
  for (size_t i = 0; i < PlacedFeatures::kMax; ++i) {
    out.bins[i] = static_cast<int32_t>(random.uniform(0, observe::kEdgeBins - 0.01));
    out.x[i] = static_cast<float>(random.uniform(-0.2, 0.2));
    out.y[i] = static_cast<float>(random.uniform(-0.2, 0.2));
  }
  return out;
}

TEST(ResponseSums, AreThoseOfThePlaces) {
  const EdgeImage edges = blocks(1);
  ResponseMaps maps;
  maps.compute(edges, edges.bins(), 2, 9);
  Random random(2);
  int most = 0;
  for (int round = 0; round < 400; ++round) {
    const PlacedFeatures placed = features(random, 1 + static_cast<size_t>(round) % 31);
    // Also beside the image.
    const auto x = static_cast<float>(random.uniform(-5, maps.width() + 5));
    const auto y = static_cast<float>(random.uniform(-5, maps.height() + 5));
    const auto scale = static_cast<float>(random.uniform(1, 150));
    int expected = 0;
    for (size_t i = 0; i < placed.count; ++i) {
      expected += maps.at(placed.bins[i], static_cast<int>(std::floor(x + scale * placed.x[i])),
                          static_cast<int>(std::floor(y + scale * placed.y[i])));
    }
    EXPECT_EQ(observe::sum_responses(maps.planes(), placed, x, y, scale), expected);
    EXPECT_EQ(observe::sum_responses_scalar(maps.planes(), placed, x, y, scale), expected);
#ifdef SIGHTLINE_X86_64
    if (cpu_has_avx2()) {
      EXPECT_EQ(observe::sum_responses_avx2(maps.planes(), placed, x, y, scale), expected);
    }
#endif
    most = std::max(most, expected);
  }
  EXPECT_GT(most, 30) << "what is compared has to be something";
}

// As the header says it: of the crossings along the line the best by strength and nearness.
std::optional<double> best_edge_of_all(const EdgeImage& edges,
                                       const observe::ProjectedSample& sample, double reach) {
  const auto strength = [&](int s) {
    const Eigen::Vector2d place = sample.pixel + Eigen::Vector2d::Constant(0.5) + s * sample.normal;
    const int x = static_cast<int>(place.x()), y = static_cast<int>(place.y());
    if (x < 1 || y < 1 || x >= kWidth - 1 || y >= kHeight - 1) return 0.0f;
    const auto i = static_cast<size_t>(y * kWidth + x);
    if (edges.magnitude()[i] < edges.threshold()) return 0.0f;
    const float along = std::abs(edges.gradient_x()[i] * static_cast<float>(sample.normal.x()) +
                                 edges.gradient_y()[i] * static_cast<float>(sample.normal.y()));
    return along > 0.8f * edges.magnitude()[i] ? along : 0.0f;
  };
  float best = 0;
  int at = 0;
  const int steps = static_cast<int>(reach);
  for (int s = -steps; s <= steps; ++s) {
    const float off = static_cast<float>(s) * static_cast<float>(1 / (reach + 1));
    const float value = std::min(strength(s), 4 * edges.threshold()) * (1 - 0.7f * off * off);
    if (value <= best) continue;
    best = value;
    at = s;
  }
  if (!(best > 0)) return std::nullopt;
  const double before = static_cast<double>(strength(at - 1)),
               middle = static_cast<double>(strength(at)),
               after = static_cast<double>(strength(at + 1));
  const double bend = before + after - 2 * middle;
  return at + (bend < -1e-6 ? std::clamp(0.5 * (before - after) / bend, -0.7, 0.7) : 0.0);
}

TEST(BestEdge, IsTheBestOfAllOnTheLine) {
  const EdgeImage edges = blocks(3);
  Random random(4);
  int found = 0, none = 0;
  for (int round = 0; round < 3000; ++round) {
    observe::ProjectedSample sample;
    sample.pixel = {random.uniform(-3, kWidth + 3), random.uniform(-3, kHeight + 3)};
    const double angle = random.uniform(0, 6.28);
    sample.normal = {std::cos(angle), std::sin(angle)};
    const double reach = random.uniform(1, 20);
    const auto expected = best_edge_of_all(edges, sample, reach);
    const auto got = best_edge(edges, sample, reach);
    ASSERT_EQ(got.has_value(), expected.has_value());
    ++(got ? found : none);
    if (got) {
      EXPECT_DOUBLE_EQ(*got, *expected);
    }
  }
  EXPECT_GT(found, 300);
  EXPECT_GT(none, 100);
}

TEST(EdgeImage, StrongIsWhatReachesTheThreshold) {
  EdgeImage edges = blocks(5);
  const auto expect_all = [&] {
    for (int y = 1; y + 1 < kHeight; ++y) {
      for (int x = 1; x + 1 < kWidth; ++x) {
        const auto i = static_cast<size_t>(y * kWidth + x);
        EXPECT_EQ(edges.strong()[i] != 0, edges.magnitude()[i] >= edges.threshold());
      }
    }
  };
  expect_all();
  std::vector<uint8_t> near(edges.bins().size(), 0);
  std::fill(near.begin(), near.begin() + static_cast<ptrdiff_t>(near.size() / 2), uint8_t{1});
  edges.keep_where(near);
  expect_all();
}

}  // namespace
}  // namespace sightline::test
