// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/target_pdf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

namespace sightline {
namespace {

constexpr double kPointsPerMeter = 72 / 0.0254;
constexpr double kMargin = 0.008;  // that printers leave white [m]
constexpr double kFooter = 0.014;  // for ruler and text [m]
constexpr double kRuler = 0.1;     // [m]

double points(double meters) { return meters * kPointsPerMeter; }

/// A rectangle from the page's top-left, in PDF's coordinates from the bottom-left.
std::string rect(const Paper& paper, double left, double top, double width, double height) {
  return fmt::format("{:.4f} {:.4f} {:.4f} {:.4f} re\n", points(left),
                     points(paper.height - top - height), points(width), points(height));
}

std::string text(const Paper& paper, double left, double baseline, double size,
                 const std::string& what) {
  std::string escaped;
  for (const char c : what) {
    if (c == '(' || c == ')' || c == '\\') escaped += '\\';
    escaped += static_cast<unsigned char>(c) < 128 ? c : '?';
  }
  return fmt::format("BT /F1 {:.1f} Tf {:.3f} {:.3f} Td ({}) Tj ET\n", size, points(left),
                     points(paper.height - baseline), escaped);
}

std::string ruler(const Paper& paper) {
  const double left = kMargin, top = paper.height - kMargin - 0.004;
  std::string content = rect(paper, left, top, kRuler, 0.0002);
  for (int mm = 0; mm <= 100; mm += 5) {
    const double height = mm % 50 == 0 ? 0.004 : mm % 10 == 0 ? 0.003 : 0.0018;
    content += rect(paper, left + mm * 1e-3 - 0.0001, top, 0.0002, height);
  }
  return content + "f\n" +
         text(paper, left + kRuler + 0.003, top + 0.003, 7,
              "100 mm: measure it. Print at 100 %, without fitting to the page.");
}

/// Objects, table of their places and trailer.
std::string document(const std::vector<std::string>& objects) {
  std::string pdf = "%PDF-1.4\n";
  std::string table = fmt::format("xref\n0 {}\n0000000000 65535 f \n", objects.size() + 1);
  for (size_t i = 0; i < objects.size(); ++i) {
    table += fmt::format("{:010} 00000 n \n", pdf.size());
    pdf += fmt::format("{} 0 obj\n{}\nendobj\n", i + 1, objects[i]);
  }
  const size_t start = pdf.size();
  return pdf + table +
         fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n",
                     objects.size() + 1, start);
}

}  // namespace

Result<Paper> find_paper(const std::string& name, bool landscape) {
  std::string lower = name;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  Paper paper;
  if (lower == "a4") {
    paper = {"A4", 0.210, 0.297};
  } else if (lower == "a3") {
    paper = {"A3", 0.297, 0.420};
  } else if (lower == "letter") {
    paper = {"letter", 0.2159, 0.2794};
  } else {
    return make_error(ErrorCode::kInvalidInput, "--paper", "'{}' is not known: A4, A3, letter",
                      name);
  }
  if (landscape) std::swap(paper.width, paper.height);
  return paper;
}

double largest_square(const CalibrationTarget& target, const Paper& paper) {
  CalibrationTarget unit = target;
  double& side = target.kind == TargetKind::kTagGrid ? unit.marker : unit.square;
  unit.gap = target.gap / std::max(1e-9, side);
  side = 1;
  const Eigen::Vector2d size = unit.size();
  const double fits = std::min((paper.width - 2 * kMargin) / size.x(),
                               (paper.height - 2 * kMargin - kFooter) / size.y());
  return std::floor(1e3 * fits + 1e-9) * 1e-3;
}

Result<std::string> target_pdf(const CalibrationTarget& target,
                               const std::vector<PrintedRect>& dark, const Paper& paper) {
  const Eigen::Vector2d size = target.size();
  if (size.x() > paper.width - 2 * kMargin + 1e-9 ||
      size.y() > paper.height - 2 * kMargin - kFooter + 1e-9) {
    return make_error(ErrorCode::kInvalidInput, target.name,
                      "the {} is {:.0f} x {:.0f} mm and does not fit {} ({:.0f} x {:.0f} mm less "
                      "margins and ruler): fewer or smaller squares, or larger paper",
                      target.describe(), 1e3 * size.x(), 1e3 * size.y(), paper.name,
                      1e3 * paper.width, 1e3 * paper.height);
  }
  const double left = (paper.width - size.x()) / 2;
  const double top = kMargin + (paper.height - 2 * kMargin - kFooter - size.y()) / 2;
  std::string content = "0 g\n";
  for (const PrintedRect& r : dark) {
    content += rect(paper, left + r.left, top + r.top, r.width, r.height);
  }
  content += "f\n" + ruler(paper) +
             text(paper, kMargin, paper.height - kMargin - 0.007, 7, target.describe());
  return document(
      {"<< /Type /Catalog /Pages 2 0 R >>", "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
       fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.3f} {:.3f}] /Contents 4 0 R "
                   "/Resources << /Font << /F1 5 0 R >> >> >>",
                   points(paper.width), points(paper.height)),
       fmt::format("<< /Length {} >>\nstream\n{}endstream", content.size(), content),
       "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"});
}

}  // namespace sightline
