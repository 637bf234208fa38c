// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "edge_maps.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/viewpoint_model.hpp"

namespace sightline {

/// A few well spread edges of one view, flat in the axes of its camera: places relative to the
/// mesh's centre [m] (x right, y down) and directions of the normals [rad].
struct ViewFeatures {
  static constexpr size_t kMost = 31;  ///< their responses fit into a byte
  size_t count = 0;
  std::array<float, kMost> x{}, y{}, angle{};
};

/// The same object seen through weak perspective: which view, turned how far in the picture
/// (towards y, [rad]), how large [px/m], where its centre is [px].
struct FlatPose {
  size_t view = 0;
  float turn = 0;
  float scale = 0;
  float x = 0, y = 0;
};

class TemplateBank {
 public:
  explicit TemplateBank(std::shared_ptr<const ViewpointModel> model);

  const ViewpointModel& model() const { return *model_; }
  const ViewFeatures& features(size_t view) const { return features_[view]; }

  /// Mean response of the view's features, 0..1, in maps of `pixels_per_map_pixel` picture pixels.
  float score(const FlatPose& pose, const ResponseMaps& maps) const;

  /// Between flat and full poses; `shrink`: picture pixels per pixel of the flat pose.
  std::optional<FlatPose> flatten(const CameraModel& camera, const Rigid3& camera_from_object,
                                  double shrink) const;
  std::optional<Rigid3> unflatten(const CameraModel& camera, const FlatPose& pose,
                                  double shrink) const;

 private:
  std::shared_ptr<const ViewpointModel> model_;
  std::vector<ViewFeatures> features_;
  std::vector<Eigen::Matrix3d> camera_from_object_;
};

/// Something that looks like the object in one camera.
struct ScanHit {
  uint8_t score = 0;
  uint16_t view = 0, turn = 0, scale = 0;
  int16_t x = 0, y = 0;
};

struct ScanRange {
  size_t views = 162;         ///< the first ones of the model: a coarser sphere
  int turns = 24;             ///< of the picture plane
  std::vector<float> scales;  ///< [px/m] of the maps
  size_t most = 4000;         ///< hits that are returned
  /// For every row of the maps the columns [first, end) where the object may be; empty: everywhere.
  std::vector<std::array<int, 2>> rows;
};

/// Tries every view, turn, scale and place. Best first.
std::vector<ScanHit> scan(const TemplateBank& bank, const ResponseMaps& maps,
                          const ScanRange& range);
FlatPose flat_pose(const ScanHit& hit, const ScanRange& range);

}  // namespace sightline
