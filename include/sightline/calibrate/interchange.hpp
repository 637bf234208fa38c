// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/geometry/camera_model.hpp"

namespace sightline {

/// Files of other programs that hold calibrated cameras.
///
///     opencv  NAME.yml         one camera: camera_matrix, distortion_coefficients, image_width,
///                              image_height, rvec and tvec (camera_from_world); XML is read, too
///     kalibr  camchain.yaml    cam0, cam1, ..: T_cn_cnm1 takes points of the camera before into
///                              this one; cam0 is the world. radtan (k1 k2 p1 p2), equidistant
///     ros     NAME.yaml        camera_info: plumb_bob, rational_polynomial, equidistant; no place.
///             static_transforms.yaml  the places: frame_id world, child NAME, which is the optical
///                              frame (x right, y down, z forward), translation and rotation xyzw
///     colmap  cameras.txt      PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV,
///     FULL_OPENCV,
///             images.txt       OPENCV_FISHEYE; camera_from_world, quaternion w x y z; the center
///             of
///                              the top-left pixel is (0.5, 0.5) there and (0, 0) here
///     mrcal   NAME.cameramodel LENSMODEL_PINHOLE, _OPENCV4, _OPENCV5, _OPENCV8; extrinsics is rt
///                              of camera_from_reference; the reference is the world
///     anipose    camera_array_aniposelib.toml  [cam_N]: matrix, distortions, rotation (vector) and
///                              translation (camera_from_world); Pose2Sim and aniposelib read it
///     caliscope  camera_array.toml             the same in tables [cameras.N]; either is read as
///                              the other; a camera without a name is called cam_N
///
/// Lengths are meters here; programs that calibrate in other units (anipose: often millimeters)
/// are scaled by the caller.
enum class InterchangeFormat { kOpencv, kKalibr, kRos, kColmap, kMrcal, kAnipose, kCaliscope };
Result<InterchangeFormat> parse_interchange_format(const std::string& name);

struct NamedText {
  std::string name;  ///< file name without folder
  std::string text;
};

/// The files of a rig. Refused by name: what the format has no room for (k3 in Kalibr's radtan,
/// fisheye in mrcal).
Result<std::vector<NamedText>> export_cameras(const std::vector<CalibratedCamera>& cameras,
                                              InterchangeFormat format);

/// The cameras of such files; a camera of a format without places stands at the origin. Refused by
/// name, with the file: what is missing, not a number, a lens model that is not ours, a matrix that
/// is no rotation, two cameras of one name.
Result<std::vector<CalibratedCamera>> import_cameras(const std::vector<NamedText>& files,
                                                     InterchangeFormat format);

}  // namespace sightline
