// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/base/time.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline {

/// What one search says of its best pose.
struct SearchEvidence {
  double edge_share = 0;    ///< of its lines that have an edge of their direction close by, mean
                            ///< over the cameras that have the object's middle in their image
  double score = 0;         ///< by contours, 0..1
  double rival_share = 0;   ///< score of the best pose at another place, of its own
  double second_share = 0;  ///< rank of the best other pose at its place, of its own; poses that
                            ///< the shape hardly tells from it are not another one
  double colors = 0;        ///< correlation of the mesh's colors with the images; 0: it has none
};

/// What each stage of one search has left, for those who want to know where the truth was lost.
struct DetectionTrace {
  struct Candidate {
    Rigid3 world_from_object;
    double score = 0;  ///< of this stage
  };
  struct Stage {
    std::string name;
    std::vector<Candidate> candidates;  ///< best first
    double at_ms = 0;                   ///< by `clock`, when the stage was done
    bool fitted = false;  ///< moved onto the edges; before, as far off as a scan steps
  };
  double (*clock)() = nullptr;  ///< null: nobody asks for times
  Time time{};                  ///< that the poses refer to
  bool moving = false;          ///< asked: where something moves only, if anything does
  std::vector<Stage> stages;
  SearchEvidence best;
  double log_odds = 0;  ///< that the best pose is right; of two cameras and more
};

/// What the images say of one pose, stage by stage; means over the cameras that have the middle of
/// the object in their image.
struct PoseAssessment {
  double spread_response = 0;  ///< of edge directions, maps spread as for the scan, 0..1
  double sharp_response = 0;   ///< the same, hardly spread
  double edge_share = 0;       ///< of the lines that have an edge of their direction close by
  double contrast = 0;         ///< outline_contrast()
  double contour = 0;          ///< the score of the search by contours
  double evidence = 0;         ///< as the search would judge it
};

}  // namespace sightline
