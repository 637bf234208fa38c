// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/frame.hpp"

namespace sightline::observe {

/// Part of the image in full-size pixels; right and bottom are exclusive.
struct Region {
  int left = 0, top = 0, right = 0, bottom = 0;
  int width() const { return right - left; }
  int height() const { return bottom - top; }
  bool empty() const { return right <= left || bottom <= top; }
  bool overlaps(const Region& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
  Region united(const Region& other) const;
};

/// A marker that was decoded. Corners are those of the print: top-left, top-right, bottom-right,
/// bottom-left, in full-size pixels (pixel centers at whole numbers).
struct SquareDetection {
  int code = 0;  ///< index into the detector's list of codes
  std::array<Eigen::Vector2d, 4> corners;
};

/// Length of a quadrilateral's shortest side.
double shortest_side(const std::array<Eigen::Vector2d, 4>& corners);

/// A marker to look for.
struct SquareCode {
  std::string family;
  int id = 0;
};

/// One library behind one interface: finds the markers of its list of codes.
class SquareDetector {
 public:
  virtual ~SquareDetector() = default;
  /// Appends what it finds in `region` of the frame, at `scale` of full size (1, 0.5, 0.25). Every
  /// detection has passed the library's own checks and the limits of the options.
  virtual void detect(const Frame& frame, const Region& region, double scale,
                      std::vector<SquareDetection>& out) = 0;
  /// How many modules the side of a code has between its corners, and whether the inside of the
  /// border is bright (the black-to-white edge is seen from the other side).
  struct Border {
    int modules = 8;
    bool bright_inside = false;
  };
  virtual Border border(int code) const = 0;
  /// Side of a marker in the searched image (at its scale) from which on it is found reliably.
  virtual double min_side_px() const = 0;
  /// Detections that the limits refused, since the start.
  virtual uint64_t refused() const { return 0; }
};

}  // namespace sightline::observe
