// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <numbers>

#include "calibrate/axes/axes_plots.hpp"
#include "calibrate/report/plot_parts.hpp"
#include "calibrate/report/plots.hpp"
#include "sightline/calibrate/axes_report.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr double kDegree = std::numbers::pi / 180;

std::string summary(const AxesSolution& s, const AxesReport& r, const std::string& epoch) {
  std::string html = fmt::format("<h1>Axes of camera {}: <span class=\"{}\">{}</span></h1>\n<ul>",
                                 html_text(s.camera.name), css_class(r.grade), to_string(r.grade));
  for (const std::string& remark : r.remarks) {
    html += fmt::format("<li>{}</li>", html_text(remark));
  }
  html += fmt::format(
      "</ul>\n<p>{} settings at rest ({} left out), {} images in motion; {} corners at rest ({} "
      "left out). World: {}. Calibration epoch <code>{}</code>.</p>\n<table>"
      "<tr><td>RMS of the fit, settings at rest (says little of accuracy)</td><td>{:.3f} "
      "px</td></tr>"
      "<tr><td>Settings that were left out, predicted by their readings</td><td>{}, {}, "
      "{}</td></tr>"
      "<tr><td>Readings from setting to setting, one sigma</td><td>{:.4f} &deg;</td></tr>"
      "<tr><td>Direction of the camera, one sigma (median; worst setting)</td>"
      "<td>{:.4f}; {:.4f} &deg;</td></tr>"
      "<tr><td>Place of the camera, one sigma (median; worst setting)</td>"
      "<td>{:.2f}; {:.2f} mm</td></tr>",
      r.at_rest, s.settings_left_out, r.in_motion, s.corners, s.rejected, html_text(s.world), epoch,
      s.rms_px, number(r.held_out_px, 3, "px"), number(r.held_out_deg, 4, "&deg;"),
      number(r.held_out_mm, 2, "mm"), s.reading_sigma / kDegree, r.direction_deg,
      r.direction_worst_deg, r.place_mm, r.place_worst_mm);
  if (r.in_motion > 0) {
    html += fmt::format(
        "<tr><td>Seen less read in motion, latency taken into account</td><td>{:.3f} "
        "&deg;</td></tr>"
        "<tr><td>Scatter of the latency from image to image, one sigma</td><td>{:.2f} ms</td></tr>",
        r.motion_deg, 1e3 * s.jitter_s);
  }
  return html + "</table>\n";
}

std::string estimates(const AxesSolution& s) {
  std::string html =
      "<h2>Parameters</h2>\n<table><tr><th>parameter</th><th>value</th><th>one sigma</th>"
      "<th></th></tr>\n";
  for (const AxesEstimate& e : s.estimates) {
    // Directions and places have no value of their own worth reading: calibration.toml has them.
    const bool valued = e.value != 0 || !e.held.empty();
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td style=\"text-align:left\">{}</td>"
        "</tr>\n",
        html_text(e.name), valued ? fmt::format("{:.6g} {}", e.value, e.unit) : "",
        e.sigma > 0 ? fmt::format("{:.2g} {}", e.sigma, e.unit) : "held", html_text(e.held));
  }
  return html + "</table>\n";
}

std::string zoom_table(const AxesSolution& s) {
  if (s.camera.axes->zoom.empty()) return {};
  std::string html =
      "<h2>Zoom</h2>\n<table><tr><th>setting</th><th>fx</th><th>fy</th><th>cx</th><th>cy</th>"
      "<th>sigma of the focal length</th></tr>\n";
  for (const ZoomLens& lens : s.camera.axes->zoom) {
    html += fmt::format(
        "<tr><td>{:g}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f}</td>"
        "<td>{:.3f} %</td></tr>\n",
        lens.setting, lens.fx, lens.fy, lens.cx, lens.cy, 100 * lens.sigma);
  }
  return html + "</table>\n";
}

std::string setting_table(const AxesSolution& s) {
  std::string html =
      "<h2>Settings at rest</h2>\n<div class=\"wide\"><table><tr><th>recording</th><th>time</th>"
      "<th>pan</th><th>tilt</th><th>zoom</th><th>images</th><th>corners</th><th>fit</th>"
      "<th>held out</th><th>readings off by</th></tr>\n";
  for (const SolvedSetting& at : s.settings) {
    if (at.moving) continue;
    html += fmt::format(
        "<tr{}><td>{}</td><td>{:.2f} s</td><td>{:.3f}&deg;</td><td>{:.3f}&deg;</td><td>{:g}</td>"
        "<td>{}</td><td>{}</td><td>{:.3f} px</td><td>{}, {}</td><td>{:.3f}&deg;, {:.3f}&deg;</td>"
        "</tr>\n",
        at.used ? "" : " class=\"notgood\"", html_text(at.recording), at.time_s, at.pan_deg,
        at.tilt_deg, at.zoom, at.images, at.corners, at.rms_px, number(at.held_out_px, 2, "px"),
        number(at.held_out_mm, 2, "mm"), at.angle_error_deg[0], at.angle_error_deg[1]);
  }
  return html + "</table></div>\n";
}

}  // namespace

std::string axes_report_html(const AxesSolution& s, const AxesReport& report,
                             const std::string& epoch) {
  PlottedErrors plotted;
  plotted.width = s.camera.model.width();
  plotted.height = s.camera.model.height();
  plotted.pixels = s.pixels;
  plotted.errors = s.errors;
  return report_head("Calibration of axes") + summary(s, report, epoch) + "<div class=\"plots\">" +
         setting_error_plot(s) + setting_coverage_plot(s) +
         latency_plot(s.latency, s.camera.axes->latency_s) + coverage_plot(plotted) +
         residual_field_plot(plotted) + histogram_plot(plotted) + "</div>\n" + estimates(s) +
         zoom_table(s) + setting_table(s) +
         "<p class=\"small\">Held out: solved with three quarters of the settings at rest, the "
         "others "
         "predicted by what is read there alone. Sigmas are of the fit's own noise: errors that "
         "all settings share (a wrong lens, a bent target) are not in them.</p>\n</body></html>\n";
}

}  // namespace sightline
