// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "observe/detect/pixels/edge_maps.hpp"
#include "sightline/geometry/camera_model.hpp"
#include "sightline/observe/detect/search_work.hpp"
#include "sightline/observe/shape/viewpoint_model.hpp"

namespace sightline::observe {

/// A few well spread edges of one view, flat in the axes of its camera: places relative to the
/// mesh's center [m] (x right, y down) and directions of the normals [rad].
struct ViewFeatures {
  static constexpr size_t kMax = 31;  ///< their responses fit into a byte
  size_t count = 0;
  std::array<float, kMax> x{}, y{}, angle{};
};

/// A pose under weak perspective: which view, rotated how far in the image (towards y, [rad]), how
/// large [px/m], where its center is [px].
struct WeakPerspectivePose {
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

  /// Mean response of the view's features, 0..1, in maps of `pixels_per_map_pixel` image pixels.
  float score(const WeakPerspectivePose& pose, const ResponseMaps& maps) const;

  /// Between weak perspective and full poses; `shrink`: image pixels per pixel of the former.
  std::optional<WeakPerspectivePose> weak_perspective(const CameraModel& camera,
                                                      const Rigid3& camera_from_object,
                                                      double shrink) const;
  std::optional<Rigid3> full_pose(const CameraModel& camera, const WeakPerspectivePose& pose,
                                  double shrink) const;

  /// Counted here because every stage that tries poses has the bank. One thread at a time.
  WorkMeter& work() const { return work_; }

 private:
  std::shared_ptr<const ViewpointModel> model_;
  std::vector<ViewFeatures> features_;
  std::vector<Eigen::Matrix3d> camera_from_object_;
  mutable WorkMeter work_;
};

/// A template that fits in one camera.
struct ScanHit {
  uint8_t score = 0;
  uint16_t view = 0, turn = 0, scale = 0;
  int16_t x = 0, y = 0;
};

struct ScanRange {
  size_t views = 162;         ///< the first ones of the model: a coarser sphere
  int turns = 24;             ///< of the image plane
  std::vector<float> scales;  ///< [px/m] of the maps
  size_t max = 4000;          ///< hits that are returned
  /// For every row of the maps the columns [first, end) where the object may be; empty: everywhere.
  std::vector<std::array<int, 2>> rows;
};

/// Tries every view, rotation in the image, scale and position. Best first.
std::vector<ScanHit> scan(const TemplateBank& bank, const ResponseMaps& maps,
                          const ScanRange& range);
WeakPerspectivePose template_pose(const ScanHit& hit, const ScanRange& range);

}  // namespace sightline::observe
