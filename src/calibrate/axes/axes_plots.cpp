// SPDX-License-Identifier: Apache-2.0
#include "calibrate/axes/axes_plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/report/plot_parts.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kHeight = 230;
constexpr double kMargin = 16;  // around what is drawn

/// From angles to places in the plot.
class AnglePlane {
 public:
  explicit AnglePlane(const AxesSolution& solution) {
    for (const SolvedSetting& s : solution.settings) {
      pan_[0] = std::min(pan_[0], s.pan_deg);
      pan_[1] = std::max(pan_[1], s.pan_deg);
      tilt_[0] = std::min(tilt_[0], s.tilt_deg);
      tilt_[1] = std::max(tilt_[1], s.tilt_deg);
    }
  }
  double x(double pan) const { return place(pan, pan_, kWidth); }
  double y(double tilt) const { return kHeight - place(tilt, tilt_, kHeight); }
  std::string words() const {
    return fmt::format("pan {:.1f} to {:.1f}, tilt {:.1f} to {:.1f} deg, as read", pan_[0], pan_[1],
                       tilt_[0], tilt_[1]);
  }

 private:
  static double place(double value, const double* range, double size) {
    const double length = std::max(1e-6, range[1] - range[0]);
    return kMargin + (value - range[0]) / length * (size - 2 * kMargin);
  }
  double pan_[2] = {1e9, -1e9}, tilt_[2] = {1e9, -1e9};
};

std::string circle(double x, double y, double radius, const char* color, double opacity) {
  return fmt::format(
      "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"{}\" fill-opacity=\"{:.2f}\"/>", x,
      y, radius, color, opacity);
}

std::string line(double x, double y, double dx, double dy, const char* color, double width) {
  return fmt::format(
      "<path d=\"M{:.1f} {:.1f}l{:.1f} {:.1f}\" stroke=\"{}\" stroke-width=\"{:.1f}\"/>", x, y, dx,
      dy, color, width);
}

}  // namespace

std::string setting_error_plot(const AxesSolution& solution) {
  const AnglePlane plane(solution);
  double largest_px = 1e-9, largest_deg = 1e-9;
  for (const SolvedSetting& s : solution.settings) {
    if (s.moving || !s.used) continue;
    largest_px = std::max(largest_px, s.held_out_px.value_or(0));
    largest_deg = std::max(largest_deg, std::hypot(s.angle_error_deg[0], s.angle_error_deg[1]));
  }
  std::string svg = open_svg(kWidth, kHeight, "Errors by setting") + frame(kWidth, kHeight);
  for (const SolvedSetting& s : solution.settings) {
    if (s.moving || !s.used) continue;
    const double x = plane.x(s.pan_deg), y = plane.y(s.tilt_deg);
    svg += "<g><title>" +
           fmt::format(
               "pan {:.2f}, tilt {:.2f} deg: {:.2f} px held out, readings off by {:.3f}, "
               "{:.3f} deg",
               s.pan_deg, s.tilt_deg, s.held_out_px.value_or(0), s.angle_error_deg[0],
               s.angle_error_deg[1]) +
           "</title>" + circle(x, y, 1.5 + 9 * s.held_out_px.value_or(0) / largest_px, kInk, 0.35) +
           line(x, y, 16 * s.angle_error_deg[0] / largest_deg,
                -16 * s.angle_error_deg[1] / largest_deg, kBad, 1.6) +
           "</g>";
  }
  return svg +
         note(0, kHeight + 14,
              fmt::format("largest circle {:.2f} px held out, longest line {:.3f} deg", largest_px,
                          largest_deg)) +
         "</svg>";
}

std::string setting_coverage_plot(const AxesSolution& solution) {
  const AnglePlane plane(solution);
  std::string moving, rest, out;
  for (const SolvedSetting& s : solution.settings) {
    const double x = plane.x(s.pan_deg), y = plane.y(s.tilt_deg);
    if (s.moving) {
      moving += circle(x, y, 1.4, "#888", 0.7);
    } else {
      (s.used ? rest : out) += circle(x, y, 4, s.used ? kInk : kBad, 0.9);
    }
  }
  return open_svg(kWidth, kHeight, "Where the head was") + frame(kWidth, kHeight) + moving + rest +
         out + note(0, kHeight + 14, plane.words()) + "</svg>";
}

std::string latency_plot(const LatencyCurve& curve, double latency_s) {
  std::string svg = open_svg(kWidth, kHeight, "Seen less read in motion, by latency");
  if (curve.rms_deg.size() < 2) {
    return svg + frame(kWidth, kHeight) +
           note(kMargin, kHeight / 2, "no images in motion: the latency is not known") + "</svg>";
  }
  const double top = std::max(1e-6, std::ranges::max(curve.rms_deg));
  const double first = curve.latency_s.front(), length = curve.latency_s.back() - first;
  const auto x = [&](double latency) { return (latency - first) / length * kWidth; };
  const auto y = [&](double deg) { return kHeight - deg / top * (kHeight - kMargin); };
  std::string path;
  for (size_t i = 0; i < curve.rms_deg.size(); ++i) {
    path += fmt::format("{}{:.1f} {:.1f}", i == 0 ? "M" : "L", x(curve.latency_s[i]),
                        y(curve.rms_deg[i]));
  }
  svg +=
      frame(kWidth, kHeight) +
      fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>", path, kInk) +
      line(x(latency_s), 0, 0, kHeight, kBad, 1.2) +
      note(x(latency_s) + 4, 14, fmt::format("{:.1f} ms", 1e3 * latency_s));
  const double least = std::ranges::min(curve.rms_deg);
  return svg +
         note(0, kHeight + 14,
              fmt::format("{:.0f} to {:.0f} ms; lowest {:.3f}, highest {:.2f} deg", 1e3 * first,
                          1e3 * (first + length), least, top)) +
         "</svg>";
}

}  // namespace sightline::calibrate
