// SPDX-License-Identifier: Apache-2.0
#include "render/overlay/lines/bounding_marks.hpp"

namespace sightline::render {
namespace {

/// Three to four pixels off, so that the line does not lie on the outline, and in the middle of a
/// chroma sample, so that all four edges have the same color.
Extent extent_of(const TileRect& bounds) {
  const auto low = [](int first) { return static_cast<float>((first - 2) & ~1) - 1.5f; };
  const auto high = [](int end) { return static_cast<float>((end + 3) & ~1) + 0.5f; };
  return {low(bounds.x), low(bounds.y), high(bounds.x + bounds.width),
          high(bounds.y + bounds.height)};
}

}  // namespace

Extent extent_of(const marks::Circle& circle) {
  return {circle.center.x() - circle.radius, circle.center.y() - circle.radius,
          circle.center.x() + circle.radius, circle.center.y() + circle.radius};
}

Extent draw_bounding_marks(const FrameTarget& target, const Subject& subject,
                           const TileCoverage& coverage,
                           const std::optional<marks::Circle>& circle) {
  const OverlayStyle& style = subject.style();
  if (style.circle && circle) marks::draw_circle(target.canvas, *circle, subject.line_style);
  std::optional<Extent> extent;
  if (!coverage.bounds.empty()) {
    extent = extent_of(coverage.bounds);
  } else if (circle) {
    extent = extent_of(*circle);
  }
  if (style.box2d && extent) {
    marks::draw_box2d(target.canvas, {extent->left, extent->top}, {extent->right, extent->bottom},
                      subject.line_style);
  }
  if (circle && (style.circle || !extent)) extent = extent_of(*circle);
  return extent.value_or(Extent{0, 0, 0, 0});
}

}  // namespace sightline::render
