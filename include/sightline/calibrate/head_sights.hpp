// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "sightline/calibrate/views.hpp"
#include "sightline/geometry/axis_history.hpp"
#include "sightline/geometry/rigid3.hpp"
#include "sightline/model/calibration_target.hpp"

namespace sightline {

/// Points that keep their places to one another while a head looks at them: a board, or the tags of
/// a room. Each part is flat, and its points are the corners of its target.
struct SightedBody {
  struct Part {
    CalibrationTarget target;  ///< without others
    Rigid3 body_from_target;
    int first_point = 0;  ///< its corner 0
  };
  std::string name;  ///< for messages: "board", "board of recording a"
  std::vector<Part> parts;
  std::optional<Rigid3> world_from_body = {};  ///< where that is known

  const Part& part(int point) const;
  Eigen::Vector3d point(int id) const;  ///< in the body's frame [m]
  int point_count() const;
};

/// Points of one body in one image; TargetCorner::id is the body's point.
struct BodySight {
  size_t body = 0;
  std::vector<TargetCorner> corners;
};

struct HeadImage {
  size_t camera = 0;  ///< index in HeadSights::cameras; 0: the one on the head
  Time capture{};     ///< middle of exposure, with the camera's time offset
  std::vector<BodySight> sights;
};

/// What one recording shows: bodies that stand still, and what the head said of its angles.
struct HeadRecording {
  std::string name;
  std::vector<AxisReading> readings;  ///< in order of time
  std::vector<HeadImage> images;      ///< in order of time
};

/// All that the axes of a head are calibrated from. A board has a body for each recording, since it
/// may be carried elsewhere between two; what is fixed has one for all.
struct HeadSights {
  std::vector<ViewedCamera> cameras;  ///< the one on the head first, then others that stand still
  std::vector<SightedBody> bodies;
  std::vector<HeadRecording> recordings;
};

}  // namespace sightline
