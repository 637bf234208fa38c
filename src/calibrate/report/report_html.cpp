// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "calibrate/report/correlations.hpp"
#include "calibrate/report/plot_parts.hpp"
#include "calibrate/report/plots.hpp"
#include "sightline/calibrate/assess.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr size_t kMostListed = 6;  // correlations, links: the rest is in report.json

constexpr const char* kHead = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body{font:15px/1.45 system-ui,sans-serif;margin:1.5rem auto;max-width:1120px;padding:0 1rem;
color:#222}
h1{font-size:1.5rem}h2{font-size:1.2rem;margin-top:2rem;border-top:1px solid #ccc;padding-top:1rem}
table{border-collapse:collapse;margin:.6rem 0}
td,th{padding:.2rem .7rem;text-align:right;border-bottom:1px solid #e3e3e3}
td:first-child,th:first-child{text-align:left}
.plots{display:flex;flex-wrap:wrap;gap:1rem}
.good{color:#1b7a3d}.usable{color:#a86500}.notgood{color:#c0392b}
.wide{overflow-x:auto}.wide td,.wide th{white-space:nowrap}svg{max-width:100%;height:auto}
svg .t,svg .c{font:600 12px sans-serif}svg .n{font:11px sans-serif;fill:#555}
p.small{color:#555;font-size:13px}
</style>)";

std::string summary(const CalibrationViews& views, const RigSolution& solution,
                    const RigReport& report, const std::string& epoch) {
  std::string html = fmt::format(
      "<h1>Calibration report: <span class=\"{}\">{}</span></h1>\n<p>{} cameras, {} sets, {} "
      "corners ({} left out) of a {}. Calibration epoch <code>{}</code>.</p>\n<table>"
      "<tr><td>RMS of the fit (says little of accuracy)</td><td>{:.4f} px</td></tr>"
      "<tr><td>RMS of views that were left out (held out)</td><td>{}</td></tr>",
      css_class(report.grade), to_string(report.grade), views.cameras.size(), views.sets,
      solution.corners, solution.rejected, html_text(views.target.describe()), epoch,
      solution.rms_px, number(report.held_out_px, 3, "px"));
  if (report.rigidity) {
    html += fmt::format(
        "<tr><td>Lengths on the target, against the print (RMS; neighbors)</td>"
        "<td>{:.3f} mm; {:.3f} mm</td></tr><tr><td>Scale, measured over printed</td>"
        "<td>{:.5f}</td></tr>",
        report.rigidity->rms_mm, report.rigidity->adjacent_mm, report.rigidity->scale);
  }
  if (!solution.bend.isZero()) {
    html += fmt::format(
        "<tr><td>Bend of the target along x and y</td><td>{:.2f} &plusmn; {:.2f} mm, {:.2f} "
        "&plusmn; {:.2f} mm</td></tr>",
        1e3 * solution.bend.x(), 1e3 * solution.bend_sigma.x(), 1e3 * solution.bend.y(),
        1e3 * solution.bend_sigma.y());
  }
  return html + "</table>\n";
}

std::string camera_table(const RigSolution& solution, const RigReport& report) {
  std::string html =
      "<div class=\"wide\"><table><tr><th>camera</th><th>verdict</th><th>views</th><th>fit</th>"
      "<th>held out</th><th>halves differ: place</th><th>turn</th><th>image (median)</th>"
      "<th>at the target (median; worst)</th><th>sigma of place</th><th>time offset</th>"
      "<th>read-out</th></tr>\n";
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    const CameraReport& r = report.cameras[c];
    const SolvedCamera& s = solution.cameras[c];
    const auto half = [&](double SplitHalf::*member) {
      return r.split_half ? std::optional<double>((*r.split_half).*member) : std::nullopt;
    };
    html += fmt::format(
        "<tr><td><b>{}</b></td><td class=\"{}\">{}</td><td>{}</td><td>{:.3f} px</td><td>{}</td>"
        "<td>{}</td><td>{}</td><td>{}</td><td>{}; {}</td><td>{:.2f} mm, {:.3f}&deg;</td>"
        "<td>{:.1f} ms</td><td>{:.1f} ms</td></tr>\n",
        html_text(r.name), css_class(r.grade), to_string(r.grade), s.views, s.camera.rms_px,
        number(r.held_out_px, 3, "px"), number(half(&SplitHalf::center_mm), 2, "mm"),
        number(half(&SplitHalf::rotation_deg), 3, "&deg;"),
        number(half(&SplitHalf::median_px), 3, "px"), number(half(&SplitHalf::median_mm), 2, "mm"),
        number(half(&SplitHalf::worst_mm), 2, "mm"), r.place_sigma_mm, r.place_sigma_deg,
        1e3 * s.time_offset_s, 1e3 * s.camera.readout_s);
  }
  return html + "</table></div>\n";
}

std::string weakest_links(const RigReport& report) {
  std::string html =
      "<p>Where the rig comes apart first (the links that tie each camera to the "
      "others best, weakest first): ";
  for (size_t i = 0; i < std::min(kMostListed, report.weakest.size()); ++i) {
    const LinkReport& link = report.links[report.weakest[i]];
    html += fmt::format(
        "{}{} and {}: {} set{}{}", i > 0 ? "; " : "", html_text(report.cameras[link.a].name),
        html_text(report.cameras[link.b].name), link.sets, link.sets == 1 ? "" : "s",
        link.sets < 5 ? " <b class=\"notgood\">(show both the target again)</b>" : "");
  }
  return html + ".</p>\n";
}

/// What an error of the lens does, near, at the working distance and far.
std::string sigma_table(const CameraReport& r, double focal_px) {
  std::string html =
      "<div class=\"wide\"><table><tr><th>one sigma of projection</th><th>center</th>"
      "<th>edge (median)</th><th>worst</th></tr>";
  const auto cell = [&](double px, double distance) {
    return fmt::format("<td>{:.3f} px, {:.2f} mm</td>", px, 1e3 * px * distance / focal_px);
  };
  const auto row = [&](const char* name, const std::optional<ProjectionSigma>& s) {
    if (!s) return;
    html += fmt::format("<tr><td>{}, {:.2f} m</td>", name, s->distance) +
            cell(s->center, s->distance) + cell(s->edge, s->distance) +
            cell(s->worst, s->distance) + "</tr>";
  };
  row("nearest corner", r.sigma_near);
  row("working distance", r.sigma);
  row("farthest corner", r.sigma_far);
  return html + "</table></div>\n";
}

std::string parameter_table(const SolvedCamera& s) {
  std::string html = "<table><tr><th>parameter</th><th>value</th><th>one sigma</th></tr>";
  for (const ParameterEstimate& e : s.estimates) {
    html +=
        fmt::format("<tr><td>{}</td><td>{:.6g}</td><td>{:.2g}</td></tr>", e.name, e.value, e.sigma);
  }
  html += "</table>\n";
  const std::vector<Correlation> pairs = telling_correlations(s);
  if (pairs.empty()) return html;
  html += "<p class=\"small\">Hardly told apart by these views (correlation): ";
  for (size_t i = 0; i < std::min(kMostListed, pairs.size()); ++i) {
    html += fmt::format("{}{} and {} ({:.3f})", i > 0 ? ", " : "", pairs[i].a, pairs[i].b,
                        pairs[i].value);
  }
  if (pairs.size() > kMostListed) html += fmt::format(", {} more", pairs.size() - kMostListed);
  return html + ". Tilted views, near and far and at the edge of the image, tell them apart.</p>\n";
}

std::string camera_section(const CalibrationViews& views, const RigSolution& solution,
                           const RigReport& report, size_t c,
                           const std::vector<std::vector<Eigen::Vector2d>>& errors) {
  const CameraReport& r = report.cameras[c];
  const SolvedCamera& s = solution.cameras[c];
  std::string html = fmt::format("<h2>{}: <span class=\"{}\">{}</span></h2>\n<ul>",
                                 html_text(r.name), css_class(r.grade), to_string(r.grade));
  for (const std::string& remark : r.remarks) {
    html += fmt::format("<li>{}</li>", html_text(remark));
  }
  html += fmt::format(
      "</ul>\n<p class=\"small\">Corners cover {:.0f} % of the image; planes of the target differ "
      "by "
      "up to {:.0f}&deg;, distances by a factor of {:.2f}; median distance {:.3f} m.</p>\n",
      100 * r.coverage, r.tilt_deg, r.depth_ratio, r.working_distance);
  PlottedErrors plotted;
  plotted.width = views.cameras[c].width;
  plotted.height = views.cameras[c].height;
  for (size_t v = 0; v < views.views.size(); ++v) {
    if (views.views[v].camera != c) continue;
    for (size_t i = 0; i < views.views[v].corners.size(); ++i) {
      const Eigen::Vector2d& pixel = views.views[v].corners[i].pixel;
      if (solution.used[v][i] && errors[v][i].allFinite()) {
        plotted.pixels.push_back(pixel);
        plotted.errors.push_back(errors[v][i]);
      } else {
        plotted.rejected.push_back(pixel);
      }
    }
  }
  html += "<div class=\"plots\">" + coverage_plot(plotted) + residual_field_plot(plotted);
  if (r.sigma) html += sigma_plot(*r.sigma, plotted.width, plotted.height);
  if (r.split_half && !r.split_half->px.empty()) {
    html += half_plot(*r.split_half, plotted.width, plotted.height);
  }
  html += histogram_plot(plotted) + "</div>\n";
  if (s.lens_known) html += "<p class=\"small\">The lens was given.</p>\n";
  if (r.sigma) html += sigma_table(r, s.camera.model.parameters().fx);
  return s.estimates.empty() ? html : html + parameter_table(s);
}

}  // namespace

std::string calibrate::report_head(const std::string& title) {
  return fmt::format("{}<title>{}</title></head><body>\n", kHead, html_text(title));
}

std::string report_html(const CalibrationViews& views, const RigSolution& solution,
                        const RigReport& report, const std::string& epoch) {
  std::string html = report_head("Calibration report") + summary(views, solution, report, epoch);
  html += camera_table(solution, report);
  if (report.cameras.size() > 1) {
    html += link_plot(report.cameras, report.links) + weakest_links(report);
  }
  const auto errors = corner_errors(views, solution);
  for (size_t c = 0; c < report.cameras.size(); ++c) {
    html += camera_section(views, solution, report, c, errors);
  }
  html +=
      "<p class=\"small\">Held out: calibrated with every other set, the others predicted from the "
      "target's pose in the other cameras. Halves: two calibrations, from every other set each, "
      "compared. Sigma of projection: what the lens's uncertainty does to a point at the working "
      "distance that no pose of the camera makes good.</p>\n</body></html>\n";
  return html;
}

}  // namespace sightline
