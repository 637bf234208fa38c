// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "observe/detect/colors/mesh_colors.hpp"
#include "observe/detect/detector_frames.hpp"
#include "observe/detect/plan/search_distances.hpp"
#include "observe/detect/template_bank.hpp"
#include "sightline/observe/detect/detection_trace.hpp"

namespace sightline::observe {

/// Templates that fit in one camera.
struct ScanResult {
  size_t camera = 0;  ///< of those that take part
  ScanRange range;    ///< what was tried
  std::vector<ScanHit> hits;
};

/// A disk of an image [px].
struct ImagePlace {
  size_t camera = 0;  ///< of those that take part
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double radius_px = 0;
};

/// First stage of a detection: every view, rotation, distance and position of the object in one
/// camera, by directions of edges.
class PoseScan {
 public:
  PoseScan(const TemplateBank& bank, const SearchDistances& distances, size_t max_hits,
           Executor executor = run_serially)
      : bank_(bank), distances_(distances), max_hits_(max_hits), executor_(std::move(executor)) {}

  /// The camera to be scanned: the next one each time; of those that show what is looked for, if
  /// any does.
  size_t next_camera(const DetectorFrames& frames, DetectorFrames::Where where);
  /// Where the object's middle may be that was at `place` [m, world] at `time`, in the next camera
  /// that sees it; nothing: none does.
  std::optional<ImagePlace> next_place(const DetectorFrames& frames, DetectorFrames::Where where,
                                       const Eigen::Vector3d& place, Time time);
  /// Needs the response maps of the frames, selected with the same `where`. With `colors` of the
  /// mesh half of the hits are those of many more that they agree best with; null: it has none.
  ScanResult scan(const DetectorFrames& frames, size_t camera, DetectorFrames::Where where,
                  const MeshColors* colors = nullptr) const;
  /// The same with the object's middle in a part of the image only.
  ScanResult scan_about(const DetectorFrames& frames, const ImagePlace& place) const;
  /// Where the object is by each hit.
  std::vector<DetectionTrace::Candidate> poses(const DetectorFrames& frames,
                                               const ScanResult& hits) const;

 private:
  void scan_range(const DetectorFrames& frames, const MeshColors* colors, ScanResult& out) const;

  const TemplateBank& bank_;
  const SearchDistances& distances_;
  const size_t max_hits_;
  const Executor executor_;
  size_t next_ = 0;
};

/// Columns [first, end) of every row of the response maps where the middle of an object that
/// reaches so far [px of the maps] may be, if it is to touch the mask of the half-size image.
std::vector<std::array<int, 2>> columns_near(const std::vector<uint8_t>& mask, int width,
                                             int height, int reach);

/// Of these columns (empty: all) those that lie in a part of the image [px]; `shrink`: pixels of
/// the image per pixel of the maps.
std::vector<std::array<int, 2>> columns_within(std::vector<std::array<int, 2>> rows,
                                               const Eigen::AlignedBox2d& image, double shrink,
                                               int width, int height);

/// The same about a place of the maps [px].
std::vector<std::array<int, 2>> columns_about(const Eigen::Vector2d& place, double radius,
                                              int width, int height);

}  // namespace sightline::observe
