// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/capture/camera_record.hpp"
#include "sightline/calibrate/capture_guide.hpp"

namespace sightline::calibrate {

/// In how many sets two cameras saw the target together.
class PairCounts {
 public:
  explicit PairCounts(size_t cameras) : cameras_(cameras), counts_(cameras * cameras, 0) {}
  void add(const std::vector<size_t>& seen_by);
  size_t of(size_t a, size_t b) const { return counts_[a * cameras_ + b]; }
  /// Cameras that hang together by links of so many sets: by camera, the smallest of its group.
  std::vector<size_t> groups(size_t links) const;
  /// Sets that are missing to join all of them, along the strongest links there are.
  size_t missing(size_t links) const;

 private:
  size_t cameras_;
  std::vector<size_t> counts_;
};

/// What one camera lacks; nothing if all members are empty.
struct CameraNeeds {
  size_t views = 0;
  std::optional<ImageRegion> region;  ///< covered least
  CaptureAdvice::Distance distance = CaptureAdvice::Distance::kAny;
  std::optional<TiltSide> tilt;
  double share = 0;  ///< 0..1 of all that it needs is there

  bool none() const {
    return views == 0 && !region && distance == CaptureAdvice::Distance::kAny && !tilt;
  }
};
CameraNeeds needs_of(const CameraRecord& record, const CaptureGuideOptions& options);

/// Two groups of cameras to be joined next: the pair that saw it together most often. Only if there
/// is more than one group.
struct MissingLink {
  size_t a = 0, b = 0, sets = 0;
};
std::optional<MissingLink> missing_link(const PairCounts& pairs, size_t links, size_t near);

/// Words for a person at the rig. `names` by camera.
std::string show_words(const std::string& camera, const CaptureAdvice& advice, bool first);
std::string link_words(const std::string& a, const std::string& b, size_t sets, size_t needed);
std::string region_words(const ImageRegion& region);

}  // namespace sightline::calibrate
