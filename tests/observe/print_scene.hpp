// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sightline/geometry/camera_model.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/object.hpp"

namespace sightline::test {

/// A flat print: cells of black and white on a plane with z = 0. The plane's frame has x right and
/// y down as seen from the front, its origin at the print's top-left corner.
struct Print {
  int columns = 0, rows = 0;   ///< cells
  double cell = 0;             ///< [m]
  std::vector<uint8_t> white;  ///< row by row
  bool at(int column, int row) const {
    return white[static_cast<size_t>(row * columns + column)] != 0;
  }
  void set(int column, int row, bool is_white) {
    white[static_cast<size_t>(row * columns + column)] = is_white ? 1 : 0;
  }
};
Print blank_print(int columns, int rows, double cell);

/// A print of one marker (the classic AprilTags as OpenCV draws them) with its white surroundings,
/// `size` from corner to corner as detectors mean it, and where its center frame (x right, y up, z
/// out) stands in the print's plane.
struct MarkerPrint {
  Print print;
  Rigid3 plane_from_fiducial;
};
MarkerPrint apriltag_print(const std::string& family, int id, double size);
MarkerPrint aruco_print(const std::string& dictionary, int id, double size);

/// A ChArUco board, its plane being the board's frame. `marker_first`: the older layout. The
/// print has a margin of one square of its own light color around it, hence the offset.
struct BoardPrint {
  Print print;
  Rigid3 plane_from_board;
};
BoardPrint charuco_print(const CharucoBoard& board, bool marker_first);

/// How an image is taken.
struct Exposure {
  double blur_px = 0.6;  ///< of the lens, one sigma
  double noise = 2.0;    ///< gray levels, one sigma
  double gamma = 2.2;    ///< of the camera
  int samples = 4;       ///< rays per pixel and axis
  uint32_t seed = 1;
};

/// One camera's image of prints on a mid-gray background, by rays through the lens model.
class PrintScene {
 public:
  explicit PrintScene(CalibratedCamera camera) : camera_(std::move(camera)) {}
  void add(const Print& print, const Rigid3& world_from_plane);
  FramePtr shoot(Time capture, const Exposure& exposure) const;

 private:
  struct Placed {
    Print print;
    Rigid3 world_from_plane;
  };
  void expose(const Placed& placed, int samples, std::vector<float>& light) const;

  CalibratedCamera camera_;
  std::vector<Placed> prints_;
};

/// A frame of any gray image (row by row, width x height).
FramePtr frame_of(const std::vector<uint8_t>& gray, int width, int height, Time capture);

/// 640x480, f about 610 px, at the world's origin looking along z.
CalibratedCamera test_camera(LensModel lens = LensModel::kBrownConrady);

}  // namespace sightline::test
