// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/tile/tile_compositor.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "sightline/render/raster/surface_shader.hpp"

namespace sightline {
namespace {

uint8_t to_byte(float share) {
  return static_cast<uint8_t>(std::lround(255.0f * std::clamp(share, 0.0f, 1.0f)));
}

/// Blurred value at a signed distance outside a straight edge: the seven-tap binomial is close to a
/// Gaussian of variance 6/4.
float blurred_at(float distance_px) {
  return 0.5f * tile::kInside * std::erfc(distance_px / std::numbers::sqrt3_v<float>);
}

/// Alpha 0 at `far_px` from the edge, 255 at `near_px`.
tile::Ramp ramp_between(float near_px, float far_px) {
  const float low = blurred_at(far_px);
  const float high = blurred_at(near_px);
  // Up to 270 the kernel's 16-bit product (at most 240 * gain) does not overflow.
  const float gain = std::clamp(255.0f * 16.0f / std::max(high - low, 1e-3f), 1.0f, 270.0f);
  return {static_cast<uint16_t>(low), static_cast<uint16_t>(gain)};
}

constexpr int kHatchPeriod = 8;
constexpr int kHatchLine = 3;
constexpr float kDashPeriod = 12;

/// Rows are computed in whole steps, so that kernels have nothing left over. What lies past their
/// ends has no meaning, and is overwritten by the next row or not looked at.
constexpr int kStep = 32;
constexpr size_t kSlack = RasterTile::kSlack;
constexpr int whole_steps(int count, int step = kStep) { return (count + step - 1) / step * step; }

}  // namespace

float hide_factor(double tolerance, double sigmas, double sigma_translation, double depth) {
  return static_cast<float>(1 + tolerance + sigmas * sigma_translation / std::max(depth, 1e-3));
}

TileCompositor::TileCompositor(int frame_width, int frame_height)
    : frame_width_(frame_width), frame_height_(frame_height), kernels_(&tile::kernels()) {}

void TileCompositor::reserve(const TileRect& rect) {
  rect_ = rect;
  stride_ = (static_cast<size_t>(rect.width) + 31) & ~size_t{31};
  const auto grow = [](auto& plane, size_t size) {
    if (plane.size() < size) plane.resize(size);
  };
  const size_t pixels = stride_ * static_cast<size_t>(rect.height) + kSlack;
  for (auto* plane : {&mask_, &hidden_, &luma_, &alpha_}) grow(*plane, pixels);
  for (auto* plane : {&u_, &v_, &chroma_alpha_}) grow(*plane, pixels / 4 + stride_ + kSlack);
  for (auto* row : {&columns_, &blurred_, &blurred_hidden_}) grow(*row, stride_ + kSlack);
  for (auto* rows : {&visible_ink_, &xray_ink_, &own_ink_}) {
    for (auto& row : *rows) grow(row, stride_ + kSlack);
  }
  grow(column_sums_, stride_ + 2 * kSlack);
  grow(covered_, static_cast<size_t>(rect.height));
  grow(hatch_, stride_ + kHatchPeriod + kSlack);
}

TileCoverage TileCompositor::classify(const RasterTile& tile, const StaticDepth* scene,
                                      float factor) {
  const bool any = scene != nullptr && !scene->empty();
  return classify_rows(tile, factor, [&](int y) {
    return any ? scene->row(tile.rect().y + y) + tile.rect().x : nullptr;
  });
}

TileCoverage TileCompositor::classify(const RasterTile& tile, const RasterTile& occluders,
                                      float factor) {
  SL_CHECK(occluders.rect() == tile.rect(), "occluders of the same tile");
  return classify_rows(tile, factor, [&](int y) { return occluders.inverse_depth(y); });
}

/// `occluder_row(y)` is the 1/z of what hides the object in a row of the tile; null: nothing.
template <typename OccluderRow>
TileCoverage TileCompositor::classify_rows(const RasterTile& tile, float factor,
                                           const OccluderRow& occluder_row) {
  reserve(tile.rect());
  coverage_ = {};
  inner_ = {};
  std::fill(columns_.begin(), columns_.end(), uint8_t{0});
  // Of a frame of odd size the tile's last column and row lie outside.
  const int width = std::min(rect_.width, frame_width_ - rect_.x);
  const int height = std::min(rect_.height, frame_height_ - rect_.y);
  int first = -1;
  int last = -1;
  for (int y = 0; y < height; ++y) {
    const tile::CoveredSpan found =
        kernels_->classify(tile.inverse_depth(y), occluder_row(y), factor, mask_.data() + at(0, y),
                           hidden_.data() + at(0, y), columns_.data(), width);
    covered_[static_cast<size_t>(y)] = found;
    if (found.hidden) coverage_.hidden = true;
    if (found.count() == 0) continue;
    if (first < 0) first = y;
    last = y;
  }
  if (first < 0) return coverage_;
  if (width < rect_.width || height < rect_.height) {
    repeat_frame_edge();
    for (int y = 0; y < rect_.height; ++y) covered_[static_cast<size_t>(y)] = covered_columns(y);
  }
  const auto covered = [](uint8_t column) { return column != 0; };
  const auto end = columns_.begin() + width;
  const auto left = std::find_if(columns_.begin(), end, covered);
  const auto right = std::find_if(std::make_reverse_iterator(end), columns_.rend(), covered).base();
  inner_ = {static_cast<int>(left - columns_.begin()), first, static_cast<int>(right - left),
            last + 1 - first};
  coverage_.bounds = {rect_.x + inner_.x, rect_.y + inner_.y, inner_.width, inner_.height};
  return coverage_;
}

/// So that no outline is drawn along the border of a frame of odd size.
void TileCompositor::repeat_frame_edge() {
  const int width = frame_width_ - rect_.x;
  const int height = frame_height_ - rect_.y;
  for (auto* plane : {&mask_, &hidden_}) {
    if (width < rect_.width) {
      for (int y = 0; y < std::min(height, rect_.height); ++y) {
        (*plane)[at(width, y)] = (*plane)[at(width - 1, y)];
      }
    }
    if (height < rect_.height) {
      std::copy_n(plane->begin() + static_cast<ptrdiff_t>(at(0, height - 1)), rect_.width,
                  plane->begin() + static_cast<ptrdiff_t>(at(0, height)));
    }
  }
}

/// The covered part grown by the margin, even, inside the tile; in tile coordinates.
TileRect TileCompositor::painted_part() const {
  const auto grow = [](int first, int size, int limit, int& from, int& count) {
    from = std::max(first - kMargin, 0) & ~1;
    count = std::min((first + size + kMargin + 1) & ~1, limit) - from;
  };
  TileRect part;
  grow(inner_.x, inner_.width, rect_.width, part.x, part.width);
  grow(inner_.y, inner_.height, rect_.height, part.y, part.height);
  return part;
}

/// What classify() tells of a row, from its mask.
tile::CoveredSpan TileCompositor::covered_columns(int y) const {
  const uint8_t* const row = mask_.data() + at(0, y);
  tile::CoveredSpan found{rect_.width, 0, 0, 0, false};
  for (int x = 0; x < rect_.width; ++x) {
    if (row[x] == 0) continue;
    if (found.end == 0) found.first = x;
    if (x == found.first || x == found.gap) found.gap = x + 1;
    if (x != found.end || found.end == 0) found.last_run = x;
    found.end = x + 1;
  }
  return found.end == 0 ? tile::CoveredSpan{} : found;
}

/// Columns of a row from where no pixel of the silhouette's edge is in reach of the blur: the
/// shared part of the runs that begin, and of those that end, the rows around it.
std::array<TileCompositor::Columns, 2> TileCompositor::deep_inside(int y) const {
  constexpr int kReach = 3;
  constexpr int kWorthwhile = 32;
  Columns left{0, rect_.width}, right{0, rect_.width};
  for (int row = std::max(y - kReach, 0); row <= std::min(y + kReach, rect_.height - 1); ++row) {
    const tile::CoveredSpan& covered = covered_[static_cast<size_t>(row)];
    left = {std::max(left.first, covered.first), std::min(left.end, covered.gap)};
    right = {std::max(right.first, covered.last_run), std::min(right.end, covered.end)};
  }
  const auto worthwhile = [](const Columns& run) {
    const Columns deep{run.first + kReach, run.end - kReach};
    return deep.count() < kWorthwhile ? Columns{} : deep;
  };
  left = worthwhile(left);
  right = worthwhile(right);
  if (left.count() <= 0) return {right, {}};
  // Of rows without a gap both are the same run.
  if (right.count() <= 0 || right.first < left.end) return {left, {}};
  return {left, right};
}

/// What the pair of rows with row `y` shows: the covered part of all rows that blur into it, grown
/// by the margin, even.
TileCompositor::Columns TileCompositor::painted_columns(int y, const TileRect& part) const {
  const int top = std::max((y & ~1) - kMargin, 0);
  const int bottom = std::min((y | 1) + kMargin, rect_.height - 1);
  Columns all{rect_.width, 0};
  for (int row = top; row <= bottom; ++row) {
    const tile::CoveredSpan& one = covered_[static_cast<size_t>(row)];
    if (one.count() <= 0) continue;
    all = {std::min(all.first, one.first), std::max(all.end, one.end)};
  }
  if (all.count() <= 0) return {part.x, part.x};
  return {std::max((all.first - kMargin) & ~1, part.x),
          std::min((all.end + kMargin + 1) & ~1, part.x + part.width)};
}

/// Empties what is left of the part's row, and of its chroma's if the row ends a pair.
void TileCompositor::clear_beside(int y, const TileRect& part, const Columns& painted) {
  const auto clear = [](std::vector<uint8_t>& plane, size_t row, int first, int end) {
    std::memset(plane.data() + row + static_cast<size_t>(first), 0,
                static_cast<size_t>(std::max(end - first, 0)));
  };
  const int end = part.x + part.width;
  for (auto* plane : {&luma_, &alpha_}) {
    clear(*plane, at(0, y), part.x, painted.first);
    clear(*plane, at(0, y), painted.end, end);
  }
  if ((y & 1) == 0) return;
  const size_t half = static_cast<size_t>(y / 2) * (stride_ / 2);
  for (auto* plane : {&u_, &v_, &chroma_alpha_}) {
    clear(*plane, half, part.x / 2, painted.first / 2);
    clear(*plane, half, painted.end / 2, end / 2);
  }
}

void TileCompositor::blur(const std::vector<uint8_t>& plane, const std::array<size_t, 7>& rows,
                          const Columns& columns, const std::array<Columns, 2>& inside,
                          std::vector<uint8_t>& out) {
  constexpr int kReach = 3;
  constexpr int kBefore = 16;  // whole steps of sums on either side of a piece
  uint16_t* const sums = column_sums_.data() + kBefore;  // counted from columns.first
  const int count = columns.count();
  const auto blur_piece = [&](int first, int end) {
    const int from = first == 0 ? 0 : first - kBefore;
    const int to = end == count ? count : end + kBefore;
    const uint8_t* const start = plane.data() + columns.first + from;
    kernels_->blur_down({start + rows[0], start + rows[1], start + rows[2], start + rows[3],
                         start + rows[4], start + rows[5], start + rows[6]},
                        sums + from, whole_steps(to - from, kBefore));
    // Beyond the margin there is nothing; beyond the frame's edge the object goes on.
    if (first == 0) std::fill_n(sums - kReach, kReach, sums[0]);
    if (end == count) std::fill_n(sums + count, kReach, sums[count - 1]);
    kernels_->blur_along(sums + first - kReach, out.data() + first,
                         whole_steps(end - first, kBefore));
  };
  int done = 0;
  for (const Columns& deep : inside) {
    const int first = whole_steps(deep.first - columns.first);
    const int end = (deep.end - columns.first) / kStep * kStep;
    if (deep.count() <= 0 || end <= first) continue;
    if (first > done) blur_piece(done, first);
    std::memset(out.data() + first, tile::kInside, static_cast<size_t>(end - first));
    done = end;
  }
  if (done < count) blur_piece(done, count);
  std::memset(out.data() + count, 0, static_cast<size_t>(whole_steps(count) - count));
}

tile::InkStyle TileCompositor::ink_style_of(const TilePaint& paint) const {
  tile::InkStyle ink_style;
  ink_style.luma = paint.color.y;
  ink_style.xray_luma = paint.xray_color.y;
  ink_style.fill_alpha = to_byte(paint.fill_opacity);
  ink_style.dash_visible = paint.dashed;
  // Blurred as it is, it needs a little more to look as dark as beside lines.
  ink_style.halo_alpha = to_byte(1.18f * paint.halo_opacity);
  if (paint.outline_px > 0) {
    const float half = 0.5f * paint.outline_px;
    ink_style.outline = ramp_between(half - 0.5f, half + 0.5f);
    ink_style.halo = ramp_between(half + 1, half + 2);
  }
  return ink_style;
}

/// Diagonal lines, fixed to the frame so that they do not swim with the object.
void TileCompositor::fill_hatch(float fill_opacity) {
  const float line = fill_opacity > 0 ? std::clamp(0.8f * fill_opacity, 0.3f, 0.6f) : 0.0f;
  for (size_t i = 0; i < hatch_.size(); ++i) {
    hatch_[i] = to_byte(i % kHatchPeriod < kHatchLine ? line : 0.25f * line);
  }
}

OverlayTileView TileCompositor::compose(const RasterTile& tile, const TilePaint& paint,
                                        const SurfaceShader* own) {
  if (inner_.empty()) return {};
  const TileRect part = painted_part();
  const tile::InkStyle ink_style = ink_style_of(paint);
  fill_hatch(paint.fill_opacity);
  const bool dashes = paint.dashed || coverage_.hidden;
  std::fill(blurred_hidden_.begin(), blurred_hidden_.end(), uint8_t{0});
  const float middle_x = static_cast<float>(inner_.x) + 0.5f * static_cast<float>(inner_.width);
  const float middle_y = static_cast<float>(inner_.y) + 0.5f * static_cast<float>(inner_.height);
  const float dash_count =
      std::clamp(std::round(1.7f * static_cast<float>(inner_.width + inner_.height) / kDashPeriod),
                 8.0f, 400.0f);
  for (int y = part.y; y < part.y + part.height; ++y) {
    const Columns columns = painted_columns(y, part);
    clear_beside(y, part, columns);
    const int count = columns.count();
    if (count == 0) continue;
    const std::array<Columns, 2> inside = deep_inside(y);
    std::array<size_t, 7> rows;
    for (int k = 0; k < 7; ++k)
      rows[static_cast<size_t>(k)] = at(0, std::clamp(y + k - 3, 0, rect_.height - 1));
    blur(mask_, rows, columns, inside, blurred_);
    // Deep inside no outline asks for it.
    if (coverage_.hidden) blur(hidden_, rows, columns, inside, blurred_hidden_);
    const size_t here = at(columns.first, y);
    const size_t odd = static_cast<size_t>(y & 1);
    const int phase = (rect_.x + columns.first + rect_.y + y) % kHatchPeriod;
    const tile::RowIn in{mask_.data() + here,
                         hidden_.data() + here,
                         blurred_.data(),
                         blurred_hidden_.data(),
                         tile.shade(y) + columns.first,
                         hatch_.data() + phase,
                         dashes ? dash_count : 0.0f,
                         static_cast<float>(columns.first) - middle_x,
                         static_cast<float>(y) - middle_y,
                         own != nullptr ? own->luma(y) + columns.first : nullptr};
    const tile::RowOut out{luma_.data() + here, alpha_.data() + here, visible_ink_[odd].data(),
                           xray_ink_[odd].data(), own_ink_[odd].data()};
    kernels_->compose(ink_style, in, out, whole_steps(count));
    if (odd == 0) continue;
    compose_chroma(y, columns, paint, own);
  }
  return view_of(part);
}

// Of the row pair that ends with `y`, which is odd.
void TileCompositor::compose_chroma(int y, const Columns& columns, const TilePaint& paint,
                                    const SurfaceShader* own) {
  const size_t here = at(columns.first, y);
  const size_t half =
      static_cast<size_t>(y / 2) * (stride_ / 2) + static_cast<size_t>(columns.first / 2);
  tile::ChromaIn chroma{{alpha_.data() + here - stride_, alpha_.data() + here},
                        {visible_ink_[0].data(), visible_ink_[1].data()},
                        {xray_ink_[0].data(), xray_ink_[1].data()},
                        paint.color.u,
                        paint.color.v,
                        paint.xray_color.u,
                        paint.xray_color.v};
  if (own != nullptr) {
    for (size_t k = 0; k < 2; ++k) {
      const int pair_row = y - 1 + static_cast<int>(k);
      chroma.own_ink[k] = own_ink_[k].data();
      chroma.own_u[k] = own->u(pair_row) + columns.first;
      chroma.own_v[k] = own->v(pair_row) + columns.first;
    }
  }
  kernels_->chroma(chroma, u_.data() + half, v_.data() + half, chroma_alpha_.data() + half,
                   whole_steps(columns.count()) / 2);
}

OverlayTileView TileCompositor::view_of(const TileRect& part) const {
  const size_t half_stride = stride_ / 2;
  const auto full = [&](const std::vector<uint8_t>& plane) {
    return PlaneView{plane.data() + at(part.x, part.y), part.width, part.height,
                     static_cast<ptrdiff_t>(stride_)};
  };
  const auto quarter = [&](const std::vector<uint8_t>& plane) {
    return PlaneView{plane.data() + static_cast<size_t>(part.y / 2) * half_stride + part.x / 2,
                     part.width / 2, part.height / 2, static_cast<ptrdiff_t>(half_stride)};
  };
  return {rect_.x + part.x, rect_.y + part.y, full(luma_),           quarter(u_),
          quarter(v_),      full(alpha_),     quarter(chroma_alpha_)};
}

TileCompositor::PixelClass TileCompositor::pixel_class(int x, int y) const {
  if (inner_.empty() || !rect_.contains(x, y)) return PixelClass::kEmpty;
  const size_t i = at(x - rect_.x, y - rect_.y);
  if (mask_[i] == 0) return PixelClass::kEmpty;
  return hidden_[i] != 0 ? PixelClass::kHidden : PixelClass::kVisible;
}

bool TileCompositor::hidden_near(int x, int y) const {
  if (!coverage_.hidden) return false;
  for (int row = y - 1; row <= y + 1; ++row) {
    for (int column = x - 1; column <= x + 1; ++column) {
      if (rect_.contains(column, row) && hidden_[at(column - rect_.x, row - rect_.y)] != 0) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace sightline
