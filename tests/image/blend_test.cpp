// SPDX-License-Identifier: Apache-2.0
#include "sightline/image/blend.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "image/blend_kernels.hpp"
#include "sightline/base/cpu.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/image/image.hpp"

namespace sightline {
namespace {

using namespace image;

using Bytes = std::vector<uint8_t>;

uint8_t reference(uint8_t in, uint8_t color, uint8_t alpha) {
  const long sum = color + std::lround(in * (255.0 - alpha) / 255.0);
  return static_cast<uint8_t>(std::min(255L, sum));
}

TEST(BlendKernel, RoundsExactlyForAllValues) {
  for (int in = 0; in < 256; ++in) {
    for (int alpha = 0; alpha < 256; ++alpha) {
      ASSERT_EQ(blend::over(static_cast<uint8_t>(in), 3, static_cast<uint8_t>(alpha)),
                reference(static_cast<uint8_t>(in), 3, static_cast<uint8_t>(alpha)));
    }
  }
}

// What this processor runs of the vector kernels.
std::vector<blend::Kernels> vector_kernels() {
  std::vector<blend::Kernels> all{blend::kVector};
#ifdef SIGHTLINE_X86_64
  if (cpu_has_avx2()) all.push_back(blend::kAvx2);
#endif
  return all;
}

TEST(BlendKernel, VectorsEqualScalarBitForBit) {
  std::mt19937 random(3);
  for (int n = 0; n < 200; ++n) {
    const auto size = static_cast<size_t>(n);
    Bytes u(size), v(size), alpha(size), frame(2 * size);
    for (auto& b : frame) b = static_cast<uint8_t>(random());
    for (size_t i = 0; i < size; ++i) {
      const bool empty = (i / 40) % 2 == 0;  // long empty stretches, as tiles have
      alpha[i] = empty ? 0 : static_cast<uint8_t>(random());
      u[i] = empty ? 0 : static_cast<uint8_t>(random());
      v[i] = empty ? 0 : static_cast<uint8_t>(random());
    }
    for (const blend::Kernels& kernels : vector_kernels()) {
      Bytes a = frame, b = frame;
      blend::kScalar.plane(a.data(), u.data(), alpha.data(), n);
      kernels.plane(b.data(), u.data(), alpha.data(), n);
      ASSERT_EQ(a, b) << n;
      blend::kScalar.pair(a.data(), u.data(), v.data(), alpha.data(), n);
      kernels.pair(b.data(), u.data(), v.data(), alpha.data(), n);
      ASSERT_EQ(a, b) << n;
    }
  }
}

// A random tile of even size, in memory of exactly its size.
struct Tile {
  Bytes luma, u, v, alpha, chroma_alpha;
  OverlayTileView view;

  Tile(int x, int y, int w, int h, std::mt19937& random) {
    const auto fill = [&random](Bytes& bytes, int n) {
      bytes.resize(static_cast<size_t>(n));
      for (auto& b : bytes) b = static_cast<uint8_t>(random());
    };
    fill(luma, w * h);
    fill(alpha, w * h);
    fill(u, w / 2 * h / 2);
    fill(v, w / 2 * h / 2);
    fill(chroma_alpha, w / 2 * h / 2);
    view = {x,
            y,
            {luma.data(), w, h, w},
            {u.data(), w / 2, h / 2, w / 2},
            {v.data(), w / 2, h / 2, w / 2},
            {alpha.data(), w, h, w},
            {chroma_alpha.data(), w / 2, h / 2, w / 2}};
  }
};

void blend_slowly(int x, int y, const PlaneView& color, const PlaneView& alpha,
                  const MutablePlaneView& frame) {
  for (int row = 0; row < frame.height; ++row) {
    for (int column = 0; column < frame.width; ++column) {
      const int tx = column - x, ty = row - y;
      if (tx < 0 || ty < 0 || tx >= color.width || ty >= color.height) continue;
      uint8_t& pixel = frame.row(row)[column];
      pixel = reference(pixel, color.row(ty)[tx], alpha.row(ty)[tx]);
    }
  }
}

void fill_randomly(const MutablePlaneView& plane, std::mt19937& random) {
  for (int y = 0; y < plane.height; ++y) {
    for (int x = 0; x < plane.width; ++x) plane.row(y)[x] = static_cast<uint8_t>(random());
  }
}

void expect_same(const PlaneView& a, const PlaneView& b) {
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) ASSERT_EQ(a.row(y)[x], b.row(y)[x]) << x << "," << y;
  }
}

TEST(BlendTile, EqualsTheReferenceWhereverTheTileLies) {
  std::mt19937 random(5);
  for (const auto& [w, h] : {std::pair{96, 40}, {97, 41}, {1, 1}}) {
    for (const int x : {-200, -38, -2, 0, 30, 90, 96, 98, 1 << 30, -(1 << 30)}) {
      for (const int y : {-64, -18, 0, 20, 40, 42}) {
        const Tile tile(x, y, 70, 30, random);
        Image frame(w, h), expected(w, h);
        const MutableI420View view = frame.mutable_view(), slow = expected.mutable_view();
        for (const auto& plane : {view.y, view.u, view.v}) fill_randomly(plane, random);
        copy_i420(frame.view(), slow);
        // NV12 with the same content.
        Bytes pairs(static_cast<size_t>(2 * view.u.width * view.u.height));
        Image luma(w, h);
        copy_i420(frame.view(), luma.mutable_view());
        const MutableNv12View nv12{
            luma.mutable_view().y,
            {pairs.data(), 2 * view.u.width, view.u.height, 2 * view.u.width}};
        for (int r = 0; r < view.u.height; ++r) {
          for (int c = 0; c < view.u.width; ++c) {
            nv12.uv.row(r)[2 * c] = view.u.row(r)[c];
            nv12.uv.row(r)[2 * c + 1] = view.v.row(r)[c];
          }
        }
        blend_tile(tile.view, view);
        blend_tile(tile.view, nv12);
        blend_slowly(x, y, tile.view.luma, tile.view.alpha, slow.y);
        blend_slowly(x / 2, y / 2, tile.view.u, tile.view.chroma_alpha, slow.u);
        blend_slowly(x / 2, y / 2, tile.view.v, tile.view.chroma_alpha, slow.v);
        expect_same(as_const(view.y), as_const(slow.y));
        expect_same(as_const(view.u), as_const(slow.u));
        expect_same(as_const(view.v), as_const(slow.v));
        expect_same(as_const(nv12.y), as_const(slow.y));
        for (int r = 0; r < view.u.height; ++r) {
          for (int c = 0; c < view.u.width; ++c) {
            ASSERT_EQ(nv12.uv.row(r)[2 * c], slow.u.row(r)[c]);
            ASSERT_EQ(nv12.uv.row(r)[2 * c + 1], slow.v.row(r)[c]);
          }
        }
      }
    }
  }
}

TEST(BlendTile, TransparentChangesNothingAndOpaqueReplaces) {
  std::mt19937 random(7);
  Tile tile(0, 0, 64, 32, random);
  Image frame(64, 32), before(64, 32);
  fill_randomly(frame.mutable_view().y, random);
  copy_i420(frame.view(), before.mutable_view());
  Tile clear = tile;
  for (Bytes* bytes : {&clear.luma, &clear.u, &clear.v, &clear.alpha, &clear.chroma_alpha}) {
    std::fill(bytes->begin(), bytes->end(), uint8_t{0});
  }
  clear.view.luma.data = clear.luma.data();
  clear.view.u.data = clear.u.data();
  clear.view.v.data = clear.v.data();
  clear.view.alpha.data = clear.alpha.data();
  clear.view.chroma_alpha.data = clear.chroma_alpha.data();
  blend_tile(clear.view, frame.mutable_view());
  expect_same(frame.view().y, before.view().y);
  std::fill(tile.alpha.begin(), tile.alpha.end(), uint8_t{255});
  blend_tile(tile.view, frame.mutable_view());
  expect_same(frame.view().y, tile.view.luma);
}

TEST(BlendTileDeathTest, OddPositionsAreABug) {
  std::mt19937 random(1);
  const Tile tile(1, 0, 2, 2, random);
  Image frame(8, 8);
  EXPECT_DEATH(blend_tile(tile.view, frame.mutable_view()), "even");
}

}  // namespace
}  // namespace sightline
