// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/tile/tile_compositor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include <cmath>
#include <random>

#include "sightline/base/cpu.hpp"
#include "test_images.hpp"

namespace sightline {
namespace tile {
extern const Kernels kPlainKernels;  // tile_kernels_plain.cpp
}
namespace {

using test::GrayImage;

constexpr Yuv kGreen{145, 54, 34};
constexpr Yuv kViolet{120, 190, 170};

/// A disc of constant depth and shade.
RasterTile disc(const TileRect& rect, float center_x, float center_y, float radius) {
  RasterTile tile;
  tile.reset(rect);
  for (int y = 0; y < rect.height; ++y) {
    for (int x = 0; x < rect.width; ++x) {
      const float dx = static_cast<float>(rect.x + x) - center_x;
      const float dy = static_cast<float>(rect.y + y) - center_y;
      if (dx * dx + dy * dy > radius * radius) continue;
      tile.inverse_depth(y)[x] = 0.5f;
      tile.shade(y)[x] = 200;
    }
  }
  return tile;
}

TilePaint paint(float fill, float outline) {
  TilePaint result;
  result.color = kGreen;
  result.xray_color = kViolet;
  result.fill_opacity = fill;
  result.outline_px = outline;
  return result;
}

TEST(TileCompositor, OpaqueFillIsTheMaskExactly) {
  const RasterTile tile = disc({20, 10, 64, 60}, 52, 40, 24.3f);
  TileCompositor compositor(160, 120);
  const TileCoverage coverage = compositor.classify(tile, nullptr, 1.01f);
  EXPECT_EQ(coverage.bounds, (TileRect{28, 16, 49, 49}));
  EXPECT_FALSE(coverage.hidden);
  GrayImage image(160, 120, 0);
  blend_tile(compositor.compose(tile, paint(1, 0)), image.mutable_view());
  test::for_each_luma(image.view(), [&](int x, int y, int luma) {
    const bool covered =
        tile.rect().contains(x, y) && tile.inverse_depth(y - tile.rect().y)[x - tile.rect().x] > 0;
    EXPECT_EQ(luma != 0, covered) << x << "," << y;
  });
}

TEST(TileCompositor, OutlineFollowsTheEdgeWithADarkHalo) {
  const RasterTile tile = disc({20, 10, 64, 60}, 52, 40, 24.3f);
  TileCompositor compositor(160, 120);
  compositor.classify(tile, nullptr, 1.01f);
  GrayImage image(160, 120, 200);
  blend_tile(compositor.compose(tile, paint(0, 2)), image.mutable_view());
  double weight = 0;
  double moment = 0;
  int halo = 0;
  test::for_each_luma(image.view(), [&](int x, int y, int luma) {
    const double r = std::hypot(x - 52, y - 40);
    if (luma == 200) return;
    EXPECT_NEAR(r, 24.8, 4.3);
    if (luma < 120) {
      ++halo;
      EXPECT_GT(r, 24.8);
    }
    const int v = image.view().v.row(y / 2)[x / 2];
    weight += 128 - v;
    moment += r * (128 - v);
  });
  EXPECT_GT(halo, 50);
  // The disc's edge lies half a pixel outside its last covered pixel centers.
  EXPECT_NEAR(moment / weight, 24.5, 0.7);
}

TEST(TileCompositor, NoOutlineAlongTheBorderOfTheImage) {
  for (const auto& [width, height] : {std::pair{100, 80}, std::pair{101, 81}}) {
    const TileRect rect{60, 40, ((width + 1) & ~1) - 60, ((height + 1) & ~1) - 40};
    RasterTile tile = disc(rect, 100, 80, 30);
    if (width % 2 == 1) {
      for (int y = 0; y < rect.height; ++y) tile.inverse_depth(y)[rect.width - 1] = 0;
    }
    if (height % 2 == 1) {
      for (int x = 0; x < rect.width; ++x) tile.inverse_depth(rect.height - 1)[x] = 0;
    }
    TileCompositor compositor(width, height);
    compositor.classify(tile, nullptr, 1.01f);
    GrayImage image(width, height, 200);
    blend_tile(compositor.compose(tile, paint(0, 2)), image.mutable_view());
    for (int y = 60; y < height; ++y) EXPECT_EQ(image.view().y.row(y)[width - 1], 200) << y;
    for (int x = 80; x < width; ++x) EXPECT_EQ(image.view().y.row(height - 1)[x], 200) << x;
  }
}

TEST(TileCompositor, DashedOutlineHasGaps) {
  const RasterTile tile = disc({20, 10, 64, 60}, 52, 40, 24.3f);
  TileCompositor compositor(160, 120);
  compositor.classify(tile, nullptr, 1.01f);
  TilePaint dashed = paint(0, 2);
  dashed.dashed = true;
  GrayImage image(160, 120, 16);
  blend_tile(compositor.compose(tile, dashed), image.mutable_view());
  int changes = 0;
  bool before = false;
  for (int i = 0; i <= 720; ++i) {
    const double angle = i * 3.14159265 / 360;
    const int x = static_cast<int>(std::lround(52 + 24.5 * std::cos(angle)));
    const int y = static_cast<int>(std::lround(40 + 24.5 * std::sin(angle)));
    const bool on = image.view().y.row(y)[x] > 60;
    changes += i > 0 && on != before ? 1 : 0;
    before = on;
  }
  EXPECT_GE(changes, 16);
  EXPECT_LE(changes, 40);
}

TEST(TileCompositor, AnEmptyTilePaintsNothing) {
  TileCompositor compositor(160, 120);
  RasterTile tile;
  tile.reset({0, 0, 32, 32});
  EXPECT_TRUE(compositor.classify(tile, nullptr, 1).bounds.empty());
  EXPECT_EQ(compositor.compose(tile, paint(1, 2)).luma.width, 0);
  tile.reset({});
  EXPECT_TRUE(compositor.classify(tile, nullptr, 1).bounds.empty());
}

/// Random inputs through both builds of the kernels.
/// What the compositor leaves out, because it is deep inside or far outside, is what the kernels
/// make of the whole rows: rings, bars and dots of all sizes, some of them hidden.
TEST(TileCompositor, ShortcutsChangeNothing) {
  std::mt19937 random(99);
  const auto dice = [&](int low, int high) {
    return low + static_cast<int>(random() % static_cast<unsigned>(high - low + 1));
  };
  const tile::Kernels& kernels = tile::kBaseKernels;
  TileCompositor compositor(640, 480);
  for (int round = 0; round < 40; ++round) {
    const int width = 2 * dice(8, 170), height = 2 * dice(8, 60);
    RasterTile tile, occluders;
    for (RasterTile* each : {&tile, &occluders}) each->reset({40, 30, width, height});
    for (int shape = dice(1, 6); shape > 0; --shape) {
      const int x = dice(4, width - 5), y = dice(4, height - 5), outer = dice(1, width / 2);
      const int inner = dice(0, 1) * dice(0, outer);
      for (int py = 4; py < height - 4; ++py) {
        for (int px = 4; px < width - 4; ++px) {
          const double r = std::hypot(px - x, py - y);
          if (r <= outer && r >= inner) tile.inverse_depth(py)[px] = 1;
        }
      }
    }
    const int wall = dice(-width, width);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        tile.shade(y)[x] = static_cast<uint8_t>((3 * x + 5 * y) & 255);
        if (x < wall) occluders.inverse_depth(y)[x] = 2;
      }
    }
    if (compositor.classify(tile, occluders, 1.01f).bounds.empty()) continue;
    const TilePaint wanted = paint(0.4f, 3);
    const OverlayTileView view = compositor.compose(tile, wanted);
    // The same from whole rows, but for hatching, which is the compositor's own.
    const auto n = static_cast<size_t>(width);
    const auto mask_at = [&](int px, int py) {
      return px >= 0 && py >= 0 && px < width && py < height && tile.inverse_depth(py)[px] > 0;
    };
    for (int y = view.y - 30; y < view.y - 30 + view.luma.height; ++y) {
      std::vector<uint16_t> sums(n + 6, 0);
      std::array<std::vector<uint8_t>, 7> rows;
      std::array<const uint8_t*, 7> pointers;
      for (size_t k = 0; k < 7; ++k) {
        rows[k].resize(n);
        for (int x = 0; x < width; ++x)
          rows[k][static_cast<size_t>(x)] = mask_at(x, y + static_cast<int>(k) - 3) ? 255 : 0;
        pointers[k] = rows[k].data();
      }
      std::vector<uint8_t> blurred(n);
      kernels.blur_down(pointers, sums.data() + 3, width);
      kernels.blur_along(sums.data(), blurred.data(), width);
      for (int x = view.x - 40; x < view.x - 40 + view.luma.width; ++x) {
        const int alpha = view.alpha.row(y - (view.y - 30))[x - (view.x - 40)];
        const int soft = blurred[static_cast<size_t>(x)];
        const bool hides = x < wall;
        if (soft == 0) {
          ASSERT_EQ(alpha, 0) << round << ": " << x << ", " << y;
        } else if (soft == tile::kInside && !hides) {
          ASSERT_EQ(alpha, 102) << round << ": " << x << ", " << y;
        } else if (soft > 90 && soft < 150 && std::abs(x - wall) > 4 && !hides) {
          ASSERT_GT(alpha, 240) << round << ": " << x << ", " << y;
        } else if (soft == tile::kInside) {
          ASSERT_TRUE(alpha >= 20 && alpha <= 90)
              << round << ": " << x << ", " << y << " " << alpha;
        }
      }
    }
  }
}

// Plain loops (tile_kernels_plain.cpp) against the vectors `b`.
void expect_same_bits(const tile::Kernels& b) {
  const tile::Kernels& a = tile::kPlainKernels;
  std::mt19937 random(7);
  const auto bytes = [&](size_t n, int max) {
    std::vector<uint8_t> v(n);
    for (uint8_t& x : v) x = static_cast<uint8_t>(random() % static_cast<unsigned>(max + 1));
    return v;
  };
  const auto binary = [&](size_t n) {
    std::vector<uint8_t> v = bytes(n, 1);
    for (uint8_t& x : v) x = x != 0 ? 255 : 0;
    return v;
  };
  for (const size_t n : {size_t{2}, size_t{15}, size_t{64}, size_t{333}}) {
    const int count = static_cast<int>(n);
    std::vector<float> object(n), scene(n);
    for (size_t i = 0; i < n; ++i) {
      object[i] = random() % 3 == 0 ? 0 : static_cast<float>(random() % 1000) * 0.01f;
      scene[i] = static_cast<float>(random() % 1000) * 0.01f;
    }
    std::array<std::array<std::vector<uint8_t>, 4>, 2> out;
    for (auto& set : out) {
      for (auto& plane : set) plane.assign(n, 9);
    }
    std::array<tile::CoveredSpan, 2> spans;
    for (size_t k = 0; k < 2; ++k) {
      spans[k] = (k == 0 ? a : b)
                     .classify(object.data(), n == 64 ? nullptr : scene.data(), 1.013f,
                               out[k][0].data(), out[k][1].data(), out[k][2].data(), count);
    }
    EXPECT_EQ(spans[0].first, spans[1].first);
    EXPECT_EQ(spans[0].end, spans[1].end);
    EXPECT_EQ(spans[0].gap, spans[1].gap);
    EXPECT_EQ(spans[0].last_run, spans[1].last_run);
    EXPECT_EQ(spans[0].hidden, spans[1].hidden);
    EXPECT_EQ(out[0][0], out[1][0]);
    EXPECT_EQ(out[0][1], out[1][1]);
    EXPECT_EQ(out[0][2], out[1][2]);
    const auto rows = binary(7 * n);
    std::array<const uint8_t*, 7> pointers;
    for (size_t r = 0; r < 7; ++r) pointers[r] = rows.data() + r * n;
    std::vector<uint16_t> sums[2];
    for (int k = 0; k < 2; ++k) {
      sums[k].assign(n + 6, 0);
      (k == 0 ? a : b).blur_down(pointers, sums[k].data() + 3, count);
      (k == 0 ? a : b).blur_along(sums[k].data(), out[k][0].data(), count);
    }
    EXPECT_EQ(sums[0], sums[1]);
    EXPECT_EQ(out[0][0], out[1][0]);

    auto mask = binary(n);
    const auto hidden = binary(n);
    auto blurred = bytes(n, tile::kInside);
    const auto blurred_hidden = bytes(n, tile::kInside);
    // Some stretches lie wholly inside or outside.
    for (size_t i = 0; i < n; ++i) {
      if (i / 40 % 3 == 0) continue;
      const bool inside = i / 40 % 3 == 1;
      mask[i] = inside ? 255 : 0;
      blurred[i] = inside ? uint8_t{tile::kInside} : uint8_t{0};
    }
    const auto shade = bytes(n, 255), hatch = bytes(n, 255);
    tile::InkStyle ink_style;
    ink_style.luma = 190;
    ink_style.xray_luma = 120;
    ink_style.fill_alpha = 77;
    ink_style.outline = {26, 72};
    ink_style.halo = {1, 270};
    const auto compose = [&](const tile::Kernels& kernels, size_t from, size_t pixels,
                             std::array<std::vector<uint8_t>, 4>& to) {
      kernels.compose(
          ink_style,
          {mask.data() + from, hidden.data() + from, blurred.data() + from,
           blurred_hidden.data() + from, shade.data() + from, hatch.data() + from, 21.0f,
           -17.5f + static_cast<float>(from), 3.5f},
          {to[0].data() + from, to[1].data() + from, to[2].data() + from, to[3].data() + from},
          static_cast<int>(pixels));
    };
    for (int k = 0; k < 2; ++k) compose(k == 0 ? a : b, 0, n, out[k]);
    for (size_t plane = 0; plane < 4; ++plane) EXPECT_EQ(out[0][plane], out[1][plane]) << plane;
    // Pieces too short for the shortcuts give the same.
    auto pieces = out[0];
    for (auto& plane : pieces) std::fill(plane.begin(), plane.end(), uint8_t{1});
    for (size_t from = 0; from < n; from += 31)
      compose(a, from, std::min<size_t>(31, n - from), pieces);
    for (size_t plane = 0; plane < 4; ++plane) EXPECT_EQ(out[0][plane], pieces[plane]) << plane;
    // Premultiplied: color never exceeds alpha, inks share the alpha.
    for (size_t i = 0; i < n; ++i) {
      EXPECT_LE(out[0][0][i], out[0][1][i] + 1);
      EXPECT_LE(out[0][2][i] + out[0][3][i], out[0][1][i]);
    }
    tile::ChromaIn chroma{{out[0][1].data(), out[0][1].data()},
                          {out[0][2].data(), out[0][2].data()},
                          {out[0][3].data(), out[0][3].data()},
                          54,
                          34,
                          190,
                          170};
    std::vector<uint8_t> uva[2][3];
    for (int k = 0; k < 2; ++k) {
      for (auto& plane : uva[k]) plane.assign(n / 2, 0);
      (k == 0 ? a : b)
          .chroma(chroma, uva[k][0].data(), uva[k][1].data(), uva[k][2].data(), count / 2);
    }
    for (int plane = 0; plane < 3; ++plane) EXPECT_EQ(uva[0][plane], uva[1][plane]);

    // The same with colors of each pixel's own.
    const auto own = bytes(n, 255);
    std::array<std::array<std::vector<uint8_t>, 5>, 2> colored;
    for (int k = 0; k < 2; ++k) {
      for (auto& plane : colored[k]) plane.assign(n, 3);
      auto& to = colored[k];
      (k == 0 ? a : b)
          .compose(ink_style,
                   {mask.data(), hidden.data(), blurred.data(), blurred_hidden.data(), shade.data(),
                    hatch.data(), 21.0f, -17.5f, 3.5f, own.data()},
                   {to[0].data(), to[1].data(), to[2].data(), to[3].data(), to[4].data()}, count);
    }
    for (size_t plane = 0; plane < 5; ++plane) EXPECT_EQ(colored[0][plane], colored[1][plane]);
    EXPECT_EQ(colored[0][1], out[0][1]) << "colors do not change how opaque it is";
    for (size_t i = 0; i < n; ++i)
      EXPECT_EQ(colored[0][2][i] + colored[0][4][i], out[0][2][i]) << "inks share the alpha";
    chroma.own_ink[0] = chroma.own_ink[1] = colored[0][4].data();
    chroma.visible_ink[0] = chroma.visible_ink[1] = colored[0][2].data();
    chroma.own_u[0] = chroma.own_u[1] = own.data();
    chroma.own_v[0] = chroma.own_v[1] = own.data();
    for (int k = 0; k < 2; ++k) {
      (k == 0 ? a : b)
          .chroma(chroma, uva[k][0].data(), uva[k][1].data(), uva[k][2].data(), count / 2);
    }
    for (int plane = 0; plane < 3; ++plane) EXPECT_EQ(uva[0][plane], uva[1][plane]);
  }
}

TEST(TileKernels, VectorsOfEachProcessorEqualPlainLoopsBitForBit) {
  expect_same_bits(tile::kBaseKernels);
}

TEST(TileKernels, Avx2EqualsPlainLoopsBitForBit) {
#ifndef SIGHTLINE_X86_64
  GTEST_SKIP() << "not an x86-64 build";
#else
  if (!cpu_has_avx2()) GTEST_SKIP() << "no AVX2 here";
  expect_same_bits(tile::kAvx2Kernels);
#endif
}

}  // namespace
}  // namespace sightline
