// SPDX-License-Identifier: Apache-2.0
#include "calibrate/report/plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "calibrate/report/plot_parts.hpp"

namespace sightline::calibrate {
namespace {

/// White to dark blue, 0 to 1.
std::string shade(double share) {
  const double s = std::clamp(share, 0.0, 1.0);
  return fmt::format("rgb({:.0f},{:.0f},{:.0f})", 247 - 217 * s, 251 - 174 * s, 255 - 104 * s);
}

/// Values all over the image, white to dark blue, the largest darkest; gray where there is none.
std::string grid_plot(const std::string& title, int columns, int rows,
                      const std::vector<double>& values, double height, const std::string& text) {
  double top = 1e-6;
  for (const double value : values) top = std::isfinite(value) ? std::max(top, value) : top;
  std::string svg = open_svg(kWidth, height, title);
  const double dx = kWidth / columns, dy = height / rows;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double value = values[static_cast<size_t>(row * columns + column)];
      const bool shown = std::isfinite(value);
      svg += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\">"
          "<title>{}</title></rect>",
          column * dx, row * dy, dx + 0.2, dy + 0.2, shown ? shade(std::sqrt(value / top)) : "#ddd",
          shown ? fmt::format("{:.3f} px", value) : "the lens shows nothing here");
    }
  }
  return svg + frame(kWidth, height) + note(0, height + 14, text) + "</svg>";
}

}  // namespace

std::string open_svg(double width, double height, const std::string& title) {
  return fmt::format(
      "<svg viewBox=\"-6 -22 {:.0f} {:.0f}\" width=\"{:.0f}\" role=\"img\" aria-label=\"{}\">"
      "<text x=\"0\" y=\"-8\" class=\"t\">{}</text>",
      width + 12, height + 44, width + 12, html_text(title), html_text(title));
}

std::string frame(double width, double height) {
  return fmt::format(
      "<rect x=\"0\" y=\"0\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"#999\"/>",
      width, height);
}

std::string note(double x, double y, const std::string& text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"n\">{}</text>", x, y,
                     html_text(text));
}

std::string html_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '"') {
      out += "&quot;";
    } else {
      out += c;
    }
  }
  return out;
}

std::string coverage_plot(const PlottedErrors& data) {
  const double scale = kWidth / data.width, height = data.height * scale;
  std::string svg = open_svg(kWidth, height, "Corners in the image");
  svg += frame(kWidth, height);
  const auto dots = [&](const std::vector<Eigen::Vector2d>& at, const char* color) {
    const size_t stride = 1 + at.size() / 4000;
    std::string path;
    for (size_t i = 0; i < at.size(); i += stride) {
      path += fmt::format("M{:.1f} {:.1f}h0", at[i].x() * scale, at[i].y() * scale);
    }
    return fmt::format(
        "<path d=\"{}\" stroke=\"{}\" stroke-width=\"2.4\" stroke-linecap=\"round\"/>", path,
        color);
  };
  svg += dots(data.pixels, kInk) + dots(data.rejected, kBad);
  svg += note(0, height + 14,
              fmt::format("{} used, {} left out (red)", data.pixels.size(), data.rejected.size()));
  return svg + "</svg>";
}

std::string residual_field_plot(const PlottedErrors& data) {
  constexpr int kColumns = 12, kRows = 9;
  std::array<Eigen::Vector2d, kColumns * kRows> sums;
  sums.fill(Eigen::Vector2d::Zero());
  std::array<int, kColumns * kRows> counts{};
  for (size_t i = 0; i < data.pixels.size(); ++i) {
    const int column =
        std::clamp(static_cast<int>(data.pixels[i].x() / data.width * kColumns), 0, kColumns - 1);
    const int row =
        std::clamp(static_cast<int>(data.pixels[i].y() / data.height * kRows), 0, kRows - 1);
    sums[static_cast<size_t>(row * kColumns + column)] += data.errors[i];
    ++counts[static_cast<size_t>(row * kColumns + column)];
  }
  double longest = 1e-9;
  for (size_t i = 0; i < sums.size(); ++i) {
    if (counts[i] == 0) continue;
    sums[i] /= counts[i];
    longest = std::max(longest, sums[i].norm());
  }
  const double scale = kWidth / data.width, height = data.height * scale;
  const double cell = kWidth / kColumns;
  std::string svg = open_svg(kWidth, height, "Mean error by place");
  svg += frame(kWidth, height);
  for (size_t i = 0; i < sums.size(); ++i) {
    if (counts[i] == 0) continue;
    const size_t column = i % kColumns, row = i / kColumns;
    const double x = (static_cast<double>(column) + 0.5) * cell;
    const double y = (static_cast<double>(row) + 0.5) * height / kRows;
    const Eigen::Vector2d to = sums[i] / longest * cell * 0.9;
    svg += fmt::format(
        "<path d=\"M{:.1f} {:.1f}l{:.1f} {:.1f}\" stroke=\"{}\" stroke-width=\"1.4\"/>"
        "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.7\" fill=\"{}\"/>",
        x, y, to.x(), to.y(), kInk, x, y, kInk);
  }
  svg += note(0, height + 14, fmt::format("longest: {:.2f} px (projected less measured)", longest));
  return svg + "</svg>";
}

std::string histogram_plot(const PlottedErrors& data) {
  constexpr size_t kBins = 24;
  constexpr double kHeight = 150;
  std::vector<double> norms;
  for (const auto& error : data.errors) norms.push_back(error.norm());
  std::sort(norms.begin(), norms.end());
  const double end =
      norms.empty() ? 1 : std::max(1e-6, norms[(norms.size() - 1) * 995 / 1000] * 1.05);
  std::array<int, kBins> bins{};
  for (const double norm : norms) {
    ++bins[std::min(kBins - 1, static_cast<size_t>(norm / end * kBins))];
  }
  const int highest = std::max(1, *std::max_element(bins.begin(), bins.end()));
  std::string svg = open_svg(kWidth, kHeight, "Errors of corners");
  const double step = kWidth / kBins;
  for (size_t i = 0; i < kBins; ++i) {
    const double bar = kHeight * bins[i] / highest;
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>",
        static_cast<double>(i) * step + 0.5, kHeight - bar, step - 1, bar, kInk);
  }
  svg += fmt::format("<path d=\"M0 {0}H{1}\" stroke=\"#999\"/>", kHeight, kWidth);
  svg += note(0, kHeight + 14, "0");
  svg += note(kWidth - 52, kHeight + 14, fmt::format("{:.2f} px", end));
  if (!norms.empty()) {
    svg += note(kWidth / 2 - 60, kHeight + 14,
                fmt::format("median {:.3f} px", norms[norms.size() / 2]));
  }
  return svg + "</svg>";
}

std::string sigma_plot(const ProjectionSigma& sigma, int width, int height) {
  return grid_plot("One sigma of projection", sigma.columns, sigma.rows, sigma.values,
                   kWidth * height / width,
                   fmt::format("center {:.3f}, edge {:.2f}, worst {:.2f} px (dark)", sigma.center,
                               sigma.edge, sigma.worst));
}

std::string half_plot(const SplitHalf& half, int width, int height) {
  double worst = 0;
  for (const double px : half.px) worst = std::isfinite(px) ? std::max(worst, px) : worst;
  return grid_plot("Difference of the halves", half.columns, half.rows, half.px,
                   kWidth * height / width,
                   fmt::format("median {:.2f} px where corners were, worst {:.2f} px (dark)",
                               half.median_px, worst));
}

std::string link_plot(const std::vector<CameraReport>& cameras,
                      const std::vector<LinkReport>& links) {
  constexpr double kSize = 340, kMiddle = kSize / 2, kRadius = 140;
  size_t strongest = 1;
  for (const LinkReport& link : links) strongest = std::max(strongest, link.sets);
  const auto at = [&](size_t camera) {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(camera) / static_cast<double>(cameras.size());
    return Eigen::Vector2d(kMiddle - kRadius * std::cos(angle),
                           kMiddle - kRadius * std::sin(angle));
  };
  std::string svg = open_svg(kSize, kSize, "Links: sets in which both saw the target");
  for (const LinkReport& link : links) {
    const Eigen::Vector2d a = at(link.a), b = at(link.b), middle = a + (b - a) * 0.32;
    svg += fmt::format(
        "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\" stroke-opacity=\"0.55\" "
        "stroke-width=\"{:.1f}\"/>",
        a.x(), a.y(), b.x(), b.y(), link.sets < 5 ? kBad : kInk,
        1 + 5.0 * static_cast<double>(link.sets) / static_cast<double>(strongest));
    if (links.size() <= 40) svg += note(middle.x(), middle.y(), fmt::format("{}", link.sets));
  }
  for (size_t c = 0; c < cameras.size(); ++c) {
    const Eigen::Vector2d p = at(c);
    svg += fmt::format(
        "<circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"6\" fill=\"{2}\"/>"
        "<text x=\"{0:.1f}\" y=\"{3:.1f}\" class=\"c\" text-anchor=\"middle\">{4}</text>",
        p.x(), p.y(), cameras[c].grade == CalibrationGrade::kNotGood ? kBad : kInk, p.y() - 11,
        html_text(cameras[c].name));
  }
  return svg + "</svg>";
}

const char* css_class(CalibrationGrade grade) {
  return grade == CalibrationGrade::kGood     ? "good"
         : grade == CalibrationGrade::kUsable ? "usable"
                                              : "notgood";
}

std::string number(const std::optional<double>& value, int digits, const char* unit) {
  return value ? fmt::format("{:.{}f} {}", *value, digits, unit) : "-";
}

}  // namespace sightline::calibrate
