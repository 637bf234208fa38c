// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrate/capture/guide_state.hpp"
#include "calibrate/report/plots.hpp"

namespace sightline::calibrate {
namespace {

constexpr double kWidth = 480;  // of a picture [px]
constexpr int kFull = 6;        // corners in a cell that count as many
constexpr const char* kInk = "#1f5f8b";
constexpr const char* kWanted = "#d9730d";
constexpr const char* kDone = "#1b7a3d";

std::string shade(int corners) {
  if (corners == 0) return "#f3f3f0";
  const double s = std::min(1.0, static_cast<double>(corners) / kFull);
  return fmt::format("rgb({:.0f},{:.0f},{:.0f})", 214 - 90 * s, 234 - 54 * s, 248 - 38 * s);
}

std::string cells(const CameraRecord& record, double height) {
  const double dx = kWidth / kCellColumns, dy = height / kCellRows;
  std::string svg;
  for (int row = 0; row < kCellRows; ++row) {
    for (int column = 0; column < kCellColumns; ++column) {
      svg += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
          "stroke=\"#fff\"/>",
          column * dx, row * dy, dx, dy, shade(record.cell(column, row)));
    }
  }
  return svg;
}

std::string outlines(const CameraRecord& record, double scale) {
  std::string svg;
  for (const TakenView& view : record.views()) {
    if (view.outline.empty()) continue;
    const bool newest = &view == &record.views().back();
    std::string path;
    for (size_t i = 0; i < view.outline.size(); ++i) {
      path += fmt::format("{}{:.1f} {:.1f}", i == 0 ? "M" : "L", view.outline[i].x() * scale,
                          view.outline[i].y() * scale);
    }
    svg += fmt::format(
        "<path d=\"{}Z\" fill=\"none\" stroke=\"{}\" stroke-opacity=\"{}\" stroke-width=\"{}\"/>",
        path, kInk, newest ? "1" : "0.4", newest ? "2.5" : "1");
  }
  return svg;
}

std::string wanted(const ImageRegion& region, double height) {
  const double dx = kWidth / 3, dy = height / 3;
  return fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
      "fill-opacity=\"0.15\" stroke=\"{}\" stroke-width=\"4\" stroke-dasharray=\"10 6\"/>",
      region.column * dx + 3, region.row * dy + 3, dx - 6, dy - 6, kWanted, kWanted);
}

std::string tick(bool done, const std::string& text) {
  return fmt::format("<tspan fill=\"{}\">{} {}</tspan><tspan>   </tspan>", done ? kDone : kWanted,
                     done ? "\xE2\x9C\x93" : "\xE2\x97\x8B", html_text(text));
}

std::string captions(const CameraProgress& p, const CaptureGuideOptions& options, double y) {
  std::string first, second;
  const size_t least = p.lens_known ? options.known_views : options.views;
  first += tick(p.views >= least, fmt::format("{} of {} views", p.views, least));
  if (!p.lens_known) {
    constexpr std::array kSides = {"left", "right", "top", "bottom"};
    first +=
        tick(p.coverage >= options.coverage, fmt::format("{:.0f} % covered", 100 * p.coverage));
    first += tick(p.depth_ratio >= options.depth_ratio,
                  fmt::format("near and far: {:.1f}", p.depth_ratio));
    second = "tilted: ";
    for (size_t side = 0; side < 4; ++side) second += tick(p.tilted[side], kSides[side]);
  }
  return fmt::format(
      "<text x=\"0\" y=\"{0:.0f}\" class=\"n\" xml:space=\"preserve\">{1}</text><text x=\"0\" "
      "y=\"{2:.0f}\" class=\"n\" xml:space=\"preserve\">{3}</text>",
      y + 20, first, y + 40, second);
}

}  // namespace

std::string coverage_svg(const GuideState& guide, size_t camera, const CaptureAdvice& next) {
  const CameraRecord& record = guide.records[camera];
  const double image_width = std::max(1, record.width());
  const double height = kWidth * (record.height() > 0 ? record.height() / image_width : 0.75);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-8 -28 {0:.0f} {1:.0f}\" "
      "width=\"{0:.0f}\"><style>text{{font:600 15px sans-serif;fill:#222}}.n{{font:13px "
      "sans-serif;fill:#444}}</style><rect x=\"-8\" y=\"-28\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" fill=\"#fff\"/><text x=\"0\" y=\"-9\">{2}</text>",
      kWidth + 16, height + 80, html_text(guide.name(camera)));
  svg += cells(record, height) +
         fmt::format("<svg x=\"0\" y=\"0\" width=\"{:.1f}\" height=\"{:.1f}\">", kWidth, height) +
         outlines(record, kWidth / image_width) + "</svg>";
  if (next.kind == CaptureAdvice::Kind::kShow && next.camera == camera && next.region) {
    svg += wanted(*next.region, height);
  }
  svg += fmt::format(
      "<rect x=\"0\" y=\"0\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"#888\"/>",
      kWidth, height);
  return svg + captions(guide.progress[camera], guide.options, height) + "</svg>\n";
}

std::string capture_page(const GuideState& guide, const CaptureAdvice& next, double share,
                         bool over) {
  std::string html =
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Calibration: "
      "capture</title>\n";
  if (!over) html += "<meta http-equiv=\"refresh\" content=\"2\">\n";
  html += fmt::format(
      "<style>body{{font:17px/1.4 system-ui,sans-serif;margin:1rem;color:#222}}"
      ".advice{{font-size:1.7rem;font-weight:600}}.pictures{{display:flex;flex-wrap:wrap;"
      "gap:1rem}}</style></head><body>\n<p class=\"advice\">{}</p>\n<p>{} sets, {:.0f} % of what "
      "is needed.</p>\n<div class=\"pictures\">\n",
      html_text(next.words), guide.views.sets, 100 * share);
  for (size_t c = 0; c < guide.records.size(); ++c) html += coverage_svg(guide, c, next);
  html += "</div>\n<p>";
  for (size_t a = 0; a < guide.records.size(); ++a) {
    for (size_t b = a + 1; b < guide.records.size(); ++b) {
      const size_t sets = guide.pairs.of(a, b);
      if (sets == 0) continue;
      html += fmt::format("{} and {} saw it together {} times.<br>\n", html_text(guide.name(a)),
                          html_text(guide.name(b)), sets);
    }
  }
  return html + "</p></body></html>\n";
}

}  // namespace sightline::calibrate
