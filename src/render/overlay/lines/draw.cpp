// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/lines/draw.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "render/overlay/lines/bar_kernels.hpp"
#include "sightline/base/cpu.hpp"

namespace sightline::draw {
namespace {

/// One or two planes of one geometry, and the value each is drawn with.
template <int Planes>
struct Target {
  std::array<uint8_t*, Planes> data;
  std::array<ptrdiff_t, Planes> stride;
  std::array<int, Planes> value;
  int width;
  int height;
  int step;

  void blend(int x, int y, int alpha) const {
    for (size_t i = 0; i < Planes; ++i) {
      uint8_t& byte = data[i][y * stride[i] + x * step];
      byte = static_cast<uint8_t>(byte + (((value[i] - byte) * alpha + 64) >> 7));
    }
  }
};

Target<1> luma_of(const Canvas& c, Yuv color) {
  return {{c.y.data}, {c.y.stride}, {color.y}, c.y.width, c.y.height, 1};
}

Target<2> chroma_of(const Canvas& c, Yuv color) {
  return {{c.u, c.v},       {c.u_stride, c.v_stride}, {color.u, color.v},
          c.chroma_width(), c.chroma_height(),        c.chroma_step};
}

/// Chroma sample i covers luma pixels 2i and 2i+1.
Point to_chroma(Point p) { return (p - Point(0.5f, 0.5f)) * 0.5f; }

/// Chroma is drawn half a luma pixel wider, so that a thin line that falls between two samples does
/// not turn gray.
float chroma_half_width(float width) { return 0.25f * width + 0.25f; }

float clamp01(float value) { return std::clamp(value, 0.0f, 1.0f); }

/// Alpha is 0..128, so that products fit 16 bits.
int to_alpha(float coverage, float opacity) {
  return static_cast<int>(coverage * opacity * 128.0f + 0.5f);
}

/// Rounding without a call into the mathematics library, which is what std::ceil is below SSE4.1.
int ceil_of(float value) {
  const int whole = static_cast<int>(value);
  return whole + (static_cast<float>(whole) < value ? 1 : 0);
}

int floor_of(float value) {
  const int whole = static_cast<int>(value);
  return whole - (static_cast<float>(whole) > value ? 1 : 0);
}

/// Integers x with low <= x <= high, within 0..limit-1.
struct Span {
  int first;
  int last;
  Span(float low, float high, int limit)
      : first(ceil_of(std::clamp(low, 0.0f, static_cast<float>(limit)))),
        last(floor_of(std::clamp(high, -1.0f, static_cast<float>(limit - 1)))) {}
};

using DrawBar = void (*)(const bars::Bar&);
DrawBar choose_bars() {
#ifdef SIGHTLINE_X86_64
  if (cpu_has_avx2()) return bars::draw_avx2;
#endif
  return bars::draw_scalar;
}

template <int Planes>
void draw_bar(const Target<Planes>& target, Point a, Point b, float half_width, float opacity) {
  static const DrawBar draw = choose_bars();
  const Point delta = b - a;
  const float length = delta.norm();
  const Point along = length > 1e-6f ? Point(delta / length) : Point(1, 0);
  const Point middle = 0.5f * (a + b);
  bars::Bar bar{};
  for (size_t i = 0; i < Planes; ++i) {
    bar.plane[i] = target.data[i];
    bar.stride[i] = target.stride[i];
    bar.value[i] = target.value[i];
  }
  bar.planes = Planes;
  bar.width = target.width;
  bar.height = target.height;
  bar.step = target.step;
  bar.along_x = along.x();
  bar.along_y = along.y();
  bar.middle_x = middle.x();
  bar.middle_y = middle.y();
  bar.reach_across = half_width + 0.5f;
  bar.reach_along = 0.5f * length + 0.5f;
  bar.max = std::min(1.0f, 2 * half_width);
  bar.opacity = opacity;
  draw(bar);
}

template <int Planes>
void ring(const Target<Planes>& target, Point center, float radius, float half_width,
          float opacity) {
  const float outer = radius + half_width + 0.5f;
  const float inner = std::max(radius - half_width - 0.5f, 0.0f);
  const float max = std::min(1.0f, 2 * half_width);
  const auto run = [&](int y, float dy, float low, float high) {
    const Span columns(low + center.x(), high + center.x(), target.width);
    for (int x = columns.first; x <= columns.last; ++x) {
      const float dx = static_cast<float>(x) - center.x();
      const float off = std::abs(std::sqrt(dx * dx + dy * dy) - radius);
      target.blend(x, y, to_alpha(std::clamp(half_width + 0.5f - off, 0.0f, max), opacity));
    }
  };
  const Span rows(center.y() - outer, center.y() + outer, target.height);
  for (int y = rows.first; y <= rows.last; ++y) {
    const float dy = static_cast<float>(y) - center.y();
    const float out = std::sqrt(std::max(outer * outer - dy * dy, 0.0f));
    const float in2 = inner * inner - dy * dy;
    if (in2 <= 1.0f) {
      run(y, dy, -out, out);
    } else {
      const float in = std::sqrt(in2);
      run(y, dy, -out, -in);
      run(y, dy, in, out);
    }
  }
}

template <int Planes>
void fill_convex(const Target<Planes>& target, std::span<const Point> corners, float opacity) {
  Point low = corners[0];
  Point high = corners[0];
  float area = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Point& p = corners[i];
    const Point& q = corners[(i + 1) % corners.size()];
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    area += p.x() * q.y() - p.y() * q.x();
  }
  const float turn = area < 0 ? -1.0f : 1.0f;
  const Span rows(low.y() - 0.5f, high.y() + 0.5f, target.height);
  const Span columns(low.x() - 0.5f, high.x() + 0.5f, target.width);
  for (int y = rows.first; y <= rows.last; ++y) {
    for (int x = columns.first; x <= columns.last; ++x) {
      const Point at(static_cast<float>(x), static_cast<float>(y));
      float inside = 1e9f;
      for (size_t i = 0; i < corners.size(); ++i) {
        const Point edge = corners[(i + 1) % corners.size()] - corners[i];
        const Point to = at - corners[i];
        inside = std::min(
            inside, turn * (edge.x() * to.y() - edge.y() * to.x()) / std::max(edge.norm(), 1e-6f));
      }
      target.blend(x, y, to_alpha(clamp01(inside + 0.5f), opacity));
    }
  }
}

/// Cuts a..b to the part near the canvas (Liang and Barsky, 1984); false if nothing is left.
/// `skipped` is the length cut off at a's end.
bool clip(const Canvas& canvas, float margin, Point& a, Point& b, float& skipped) {
  skipped = 0;
  if (!a.allFinite() || !b.allFinite()) return false;
  const Point delta = b - a;
  float enter = 0;
  float leave = 1;
  const std::array<float, 2> high = {static_cast<float>(canvas.y.width) + margin,
                                     static_cast<float>(canvas.y.height) + margin};
  for (int axis = 0; axis < 2; ++axis) {
    const float low_edge = -margin - a[axis];
    const float high_edge = high[static_cast<size_t>(axis)] - a[axis];
    if (delta[axis] == 0) {
      if (low_edge > 0 || high_edge < 0) return false;
      continue;
    }
    const float s = low_edge / delta[axis];
    const float t = high_edge / delta[axis];
    enter = std::max(enter, std::min(s, t));
    leave = std::min(leave, std::max(s, t));
  }
  if (enter > leave) return false;
  skipped = enter * delta.norm();
  const Point start = a;
  a = start + enter * delta;
  b = start + leave * delta;
  return true;
}

void clipped_line(const Canvas& canvas, Point a, Point b, const Stroke& stroke) {
  const float half = 0.5f * stroke.width;
  draw_bar(luma_of(canvas, stroke.color), a, b, half, stroke.opacity);
  if (stroke.luma_only) return;
  draw_bar(chroma_of(canvas, stroke.color), to_chroma(a), to_chroma(b),
           chroma_half_width(stroke.width), stroke.opacity);
}

/// Draws the dashes of one segment, `phase` px into the pattern at its start.
void dashed_line(const Canvas& canvas, Point a, Point b, const Stroke& stroke, Dash dash,
                 float phase) {
  const float period = dash.on + dash.off;
  const float length = (b - a).norm();
  if (length < 1e-6f) return;
  const Point along = (b - a) / length;
  for (float start = -std::fmod(phase, period); start < length; start += period) {
    const float from = std::max(start, 0.0f);
    const float to = std::min(start + dash.on, length);
    if (to > from) clipped_line(canvas, a + from * along, a + to * along, stroke);
  }
}

}  // namespace

Canvas canvas_of(const MutableI420View& image) {
  return {image.y, image.u.data, image.v.data, image.u.stride, image.v.stride, 1};
}

Canvas canvas_of(const MutableNv12View& image) {
  return {image.y, image.uv.data, image.uv.data + 1, image.uv.stride, image.uv.stride, 2};
}

void line(const Canvas& canvas, Point a, Point b, const Stroke& stroke) {
  float skipped = 0;
  if (clip(canvas, stroke.width + 2, a, b, skipped)) clipped_line(canvas, a, b, stroke);
}

void polyline(const Canvas& canvas, std::span<const Point> points, const Stroke& stroke,
              Dash dash) {
  // Bars end with half coverage. An opaque line is drawn over itself at its joints, so that they
  // show no notches, and half its width further at its ends, so that corners are filled.
  const float joint = stroke.opacity >= 0.99f ? 0.5f : 0.0f;
  float phase = 0;
  for (size_t i = 0; i + 1 < points.size(); ++i) {
    Point a = points[i];
    Point b = points[i + 1];
    const float length = (b - a).norm();
    if (dash.off <= 0 && length > 0) {
      const Point along = (b - a) / length;
      a -= (i == 0 ? 0.5f * stroke.width : joint) * along;
      b += (i + 2 == points.size() ? 0.5f * stroke.width : joint) * along;
    }
    float skipped = 0;
    if (clip(canvas, stroke.width + 2, a, b, skipped)) {
      if (dash.off > 0) {
        dashed_line(canvas, a, b, stroke, dash, phase + skipped);
      } else {
        clipped_line(canvas, a, b, stroke);
      }
    }
    if (std::isfinite(length)) phase += length;
  }
}

void circle(const Canvas& canvas, Point center, float radius, const Stroke& stroke) {
  if (!center.allFinite() || !std::isfinite(radius) || radius < 0) return;
  const float half = 0.5f * stroke.width;
  ring(luma_of(canvas, stroke.color), center, radius, half, stroke.opacity);
  if (stroke.luma_only) return;
  ring(chroma_of(canvas, stroke.color), to_chroma(center), 0.5f * radius,
       chroma_half_width(stroke.width), stroke.opacity);
}

void dashed_circle(const Canvas& canvas, Point center, float radius, const Stroke& stroke,
                   Dash dash) {
  if (!center.allFinite() || !std::isfinite(radius) || radius < 1) return;
  constexpr float kTurn = 2 * std::numbers::pi_v<float>;
  const int dashes =
      std::clamp(static_cast<int>(kTurn * radius / (dash.on + dash.off) + 0.5f), 6, 2000);
  const float step = kTurn / static_cast<float>(dashes);
  const float share = dash.on / (dash.on + dash.off);
  const auto at = [&](float angle) {
    return Point(center + radius * Point(std::cos(angle), std::sin(angle)));
  };
  for (int i = 0; i < dashes; ++i) {
    const float from = static_cast<float>(i) * step;
    // Two chords a dash: 10 px of arc stay within 0.1 px of the circle from a radius of 30 px on.
    line(canvas, at(from), at(from + 0.5f * share * step), stroke);
    line(canvas, at(from + 0.5f * share * step), at(from + share * step), stroke);
  }
}

void polygon(const Canvas& canvas, std::span<const Point> corners, Yuv color, float opacity) {
  constexpr size_t kMax = 8;
  if (corners.size() < 3 || corners.size() > kMax) return;
  std::array<Point, kMax> half;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (!corners[i].allFinite()) return;
    half[i] = to_chroma(corners[i]);
  }
  fill_convex(luma_of(canvas, color), corners, opacity);
  fill_convex(chroma_of(canvas, color), std::span(half.data(), corners.size()), opacity);
}

}  // namespace sightline::draw
