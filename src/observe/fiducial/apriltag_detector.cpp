// SPDX-License-Identifier: Apache-2.0
#include "observe/fiducial/apriltag_detector.hpp"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <algorithm>
#include <array>

namespace sightline::observe {
namespace {

/// The classic families exist in OpenCV too, which draws them half a turn from the library's own
/// images (until OpenCV 5). Their upright is OpenCV's here, as in the recordings' object files.
struct FamilyMaker {
  const char* name;
  bool half_turn;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};
constexpr std::array kFamilies = {
    FamilyMaker{"tag36h11", true, tag36h11_create, tag36h11_destroy},
    FamilyMaker{"tag25h9", true, tag25h9_create, tag25h9_destroy},
    FamilyMaker{"tag16h5", true, tag16h5_create, tag16h5_destroy},
    FamilyMaker{"tag36h10", true, tag36h10_create, tag36h10_destroy},
    FamilyMaker{"tagCircle21h7", false, tagCircle21h7_create, tagCircle21h7_destroy},
    FamilyMaker{"tagCircle49h12", false, tagCircle49h12_create, tagCircle49h12_destroy},
    FamilyMaker{"tagStandard41h12", false, tagStandard41h12_create, tagStandard41h12_destroy},
    FamilyMaker{"tagStandard52h13", false, tagStandard52h13_create, tagStandard52h13_destroy},
    FamilyMaker{"tagCustom48h12", false, tagCustom48h12_create, tagCustom48h12_destroy},
};

const FamilyMaker* find_family(const std::string& name) {
  for (const FamilyMaker& maker : kFamilies) {
    if (name == maker.name) return &maker;
  }
  return nullptr;
}

/// Gives the family its own table of codes back, whoever frees that.
struct DestroyFamily {
  void (*destroy)(apriltag_family_t*);
  uint64_t* codes;
  void operator()(apriltag_family_t* family) const {
    family->codes = codes;
    destroy(family);
  }
};
using FamilyPtr = std::unique_ptr<apriltag_family_t, DestroyFamily>;

FamilyPtr make_family(const FamilyMaker& maker) {
  apriltag_family_t* const family = maker.create();
  return FamilyPtr(family, DestroyFamily{maker.destroy, family->codes});
}

/// A family reduced to the codes in use. The library's families of one name share one table of
/// codes, so that this has its own.
struct UsedFamily {
  FamilyPtr family;
  bool half_turn;
  std::vector<int> codes;       ///< of the detector, by index in the reduced family
  std::vector<uint64_t> table;  ///< by the same index
};

/// How many wrong bits are safe: short codes collide with clutter when bits are forgiven.
int safe_hamming(const apriltag_family_t& family, int wanted) {
  return std::clamp(wanted, 0, family.h >= 9 ? 2 : family.h >= 7 ? 1 : 0);
}

class AprilTagDetector : public SquareDetector {
 public:
  AprilTagDetector(std::vector<UsedFamily> families, size_t codes, const AprilTagLimits& limits)
      : families_(std::move(families)), borders_(codes), limits_(limits) {
    detector_.reset(apriltag_detector_create());
    detector_->nthreads = limits.threads;
    detector_->refine_edges = true;
    // The library's 5 makes thousands of clusters out of sensor noise and costs half of its time.
    detector_->qtp.min_white_black_diff = 20;
    for (UsedFamily& used : families_) {
      apriltag_family_t* family = used.family.get();
      apriltag_detector_add_family_bits(detector_.get(), family,
                                        safe_hamming(*family, limits.max_hamming));
      for (int code : used.codes) {
        borders_[static_cast<size_t>(code)] = {family->width_at_border, family->reversed_border};
      }
    }
  }

  void detect(const Frame& frame, const Region& region, double scale,
              std::vector<SquareDetection>& out) override {
    const PlaneView gray = frame.gray();
    // The library reads the pixels and never writes them when no blur is asked for.
    image_u8_t image{region.width(), region.height(), static_cast<int32_t>(gray.stride),
                     const_cast<uint8_t*>(gray.row(region.top) + region.left)};
    detector_->quad_decimate = static_cast<float>(1.0 / scale);
    zarray_t* found = apriltag_detector_detect(detector_.get(), &image);
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* tag = nullptr;
      zarray_get(found, i, &tag);
      if (tag->decision_margin < limits_.min_decision_margin) {
        ++refused_;
        continue;
      }
      out.push_back(to_detection(*tag, region));
    }
    apriltag_detections_destroy(found);
  }

  Border border(int code) const override { return borders_[static_cast<size_t>(code)]; }
  // Decodes at full size whatever the scale of the search.
  double min_side_px() const override { return 10; }
  uint64_t refused() const override { return refused_; }

 private:
  struct Destroy {
    void operator()(apriltag_detector_t* d) const { apriltag_detector_destroy(d); }
  };

  SquareDetection to_detection(const apriltag_detection_t& tag, const Region& region) const {
    SquareDetection out;
    // The library's corners run from bottom-left anticlockwise, with pixel centers at halves.
    size_t top_left = 3;
    for (const UsedFamily& used : families_) {
      if (used.family.get() != tag.family) continue;
      out.code = used.codes[static_cast<size_t>(tag.id)];
      if (used.half_turn) top_left = 1;
    }
    for (size_t k = 0; k < 4; ++k) {
      const double* p = tag.p[(top_left + 4 - k) % 4];
      out.corners[k] = {p[0] - 0.5 + region.left, p[1] - 0.5 + region.top};
    }
    return out;
  }

  std::vector<UsedFamily> families_;  // outlive the detector, which borrows them
  std::vector<Border> borders_;
  AprilTagLimits limits_;
  std::unique_ptr<apriltag_detector_t, Destroy> detector_;
  uint64_t refused_ = 0;
};

}  // namespace

bool is_apriltag_family(const std::string& family) { return find_family(family) != nullptr; }

std::vector<std::string> apriltag_families() {
  std::vector<std::string> names;
  for (const FamilyMaker& maker : kFamilies) names.emplace_back(maker.name);
  return names;
}

Result<std::unique_ptr<SquareDetector>> make_apriltag_detector(const std::vector<SquareCode>& codes,
                                                               const AprilTagLimits& limits,
                                                               const std::string& where) {
  std::vector<UsedFamily> families;
  for (const FamilyMaker& maker : kFamilies) {
    UsedFamily used{FamilyPtr(nullptr, DestroyFamily{}), maker.half_turn, {}, {}};
    for (size_t i = 0; i < codes.size(); ++i) {
      if (codes[i].family != maker.name) continue;
      if (!used.family) used.family = make_family(maker);
      const uint32_t count = used.family->ncodes;
      if (codes[i].id < 0 || static_cast<uint32_t>(codes[i].id) >= count) {
        return make_error(ErrorCode::kInvalidInput, where, "{} has no id {}: it has 0 to {}",
                          maker.name, codes[i].id, count - 1);
      }
      used.table.push_back(used.family->codes[codes[i].id]);
      used.codes.push_back(static_cast<int>(i));
    }
    if (!used.family) continue;
    // Only our own codes: foreign tags cost nothing, and the look-up table of the large families
    // (tens of thousands of codes, each with its one-bit neighbors) stays small.
    used.family->codes = used.table.data();
    used.family->ncodes = static_cast<uint32_t>(used.table.size());
    families.push_back(std::move(used));
  }
  return std::unique_ptr<SquareDetector>(
      std::make_unique<AprilTagDetector>(std::move(families), codes.size(), limits));
}

std::vector<bool> apriltag_modules(const std::string& name, int id) {
  const FamilyMaker* maker = find_family(name);
  if (maker == nullptr) return {};
  const FamilyPtr family = make_family(*maker);
  const bool data_inside = family->total_width == family->width_at_border + 2;
  if (id < 0 || id >= static_cast<int>(family->ncodes) || !data_inside || family->reversed_border) {
    return {};
  }
  image_u8_t* image = apriltag_to_image(family.get(), id);
  std::vector<bool> dark;
  for (int row = 1; row <= family->width_at_border; ++row) {
    for (int column = 1; column <= family->width_at_border; ++column) {
      dark.push_back(image->buf[row * image->stride + column] < 128);
    }
  }
  image_u8_destroy(image);
  if (maker->half_turn) std::reverse(dark.begin(), dark.end());
  return dark;
}

}  // namespace sightline::observe
