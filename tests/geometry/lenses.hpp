// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/geometry/camera_model.hpp"

namespace sightline::test {

struct NamedLens {
  std::string name;
  CameraModel::Parameters parameters;
};

/// Lenses of every family: none, mild, strong barrel and cushion, and real calibrations.
inline std::vector<NamedLens> lenses() {
  using P = CameraModel::Parameters;
  const auto brown = LensModel::kBrownConrady;
  const auto rational = LensModel::kRational;
  const auto fisheye = LensModel::kFisheye;
  return {
      {"pinhole", P{brown, 640, 480, 600, 600, 319.5, 239.5, {}}},
      {"bench left",
       P{brown, 640, 480, 612.4, 611.7, 322.8, 236.1, {-0.091, 0.062, 0.0006, -0.0004, -0.011}}},
      {"bench side",
       P{brown, 640, 480, 588.3, 587.6, 325.1, 241.9, {-0.112, 0.083, 0.0004, 0.0005, -0.018}}},
      {"webcam barrel", P{brown,
                          1280,
                          720,
                          903.55,
                          907.88,
                          618.31,
                          394.21,
                          {-0.3320993, 0.0464197, -0.0042958, 0.0041132, 0.0665682}}},
      {"webcam cushion", P{brown,
                           1280,
                           720,
                           650.80,
                           654.47,
                           647.34,
                           392.19,
                           {0.1803983, -0.2560381, 0.0032098, 0.0022377, 0.1240233}}},
      {"rational wide", P{rational,
                          1920,
                          1080,
                          900,
                          905,
                          961,
                          537,
                          {5.2, 2.1, 0.0002, -0.0003, 0.11, 5.55, 3.9, 0.62}}},
      {"rational mild", P{rational,
                          1280,
                          960,
                          1100,
                          1098,
                          640,
                          470,
                          {0.4, -0.2, 0.0005, 0.0002, 0.01, 0.55, -0.1, 0.02}}},
      {"fisheye ideal", P{fisheye, 1280, 1024, 380, 380, 640, 512, {}}},
      {"fisheye real",
       P{fisheye, 1280, 1024, 388.2, 387.9, 641.5, 510.7, {-0.0132, 0.0101, -0.0083, 0.0018}}},
  };
}

}  // namespace sightline::test
