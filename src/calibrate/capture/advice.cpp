// SPDX-License-Identifier: Apache-2.0
#include "calibrate/capture/advice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace sightline::calibrate {
namespace {

constexpr double kLargeEnough = 0.55;  // of the width: nearer, the target leaves the image
constexpr std::array kSides = {TiltSide::kLeft, TiltSide::kRight, TiltSide::kTop,
                               TiltSide::kBottom};

/// The region that is covered least, of those that are covered too little; the middle first.
std::optional<ImageRegion> least_covered(const CameraRecord& record,
                                         const CaptureGuideOptions& options) {
  const bool enough = record.coverage() >= options.coverage;
  std::optional<ImageRegion> least;
  double share = 1;
  for (const int row : {1, 0, 2}) {
    for (const int column : {1, 0, 2}) {
      const double covered = record.coverage(ImageRegion{column, row});
      if (covered >= share || (enough && covered >= options.region_coverage)) continue;
      share = covered;
      least = ImageRegion{column, row};
    }
  }
  return least;
}

double region_share(const CameraRecord& record, const CaptureGuideOptions& options) {
  double sum = 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      sum += std::min(1.0, record.coverage(ImageRegion{column, row}) / options.region_coverage);
    }
  }
  return 0.5 * sum / 9 + 0.5 * std::min(1.0, record.coverage() / options.coverage);
}

}  // namespace

void PairCounts::add(const std::vector<size_t>& seen_by) {
  for (const size_t a : seen_by) {
    for (const size_t b : seen_by) counts_[a * cameras_ + b] += a != b;
  }
}

std::vector<size_t> PairCounts::groups(size_t links) const {
  std::vector<size_t> group(cameras_);
  std::iota(group.begin(), group.end(), size_t{0});
  for (size_t a = 0; a < cameras_; ++a) {
    for (size_t b = a + 1; b < cameras_; ++b) {
      if (of(a, b) < links || group[a] == group[b]) continue;
      const auto [low, high] = std::minmax(group[a], group[b]);
      std::ranges::replace(group, size_t{high}, size_t{low});
    }
  }
  return group;
}

size_t PairCounts::missing(size_t links) const {
  PairCounts copy = *this;
  size_t sum = 0;
  while (const auto link = missing_link(copy, links, 0)) {
    sum += links - link->sets;
    copy.counts_[link->a * cameras_ + link->b] = links;
    copy.counts_[link->b * cameras_ + link->a] = links;
  }
  return sum;
}

std::optional<MissingLink> missing_link(const PairCounts& pairs, size_t links, size_t near) {
  const std::vector<size_t> group = pairs.groups(links);
  std::optional<MissingLink> best;
  const auto rank = [&](const MissingLink& link) {
    return 2 * link.sets + (link.a == near || link.b == near);
  };
  for (size_t a = 0; a < group.size(); ++a) {
    for (size_t b = a + 1; b < group.size(); ++b) {
      if (group[a] == group[b]) continue;
      const MissingLink link{a, b, pairs.of(a, b)};
      if (!best || rank(link) > rank(*best)) best = link;
    }
  }
  return best;
}

CameraNeeds needs_of(const CameraRecord& record, const CaptureGuideOptions& options) {
  CameraNeeds needs;
  const size_t views = record.views().size();
  const size_t least = record.lens_known() ? options.known_views : options.views;
  if (views < least) needs.views = least - views;
  const double view_share = std::min(1.0, static_cast<double>(views) / static_cast<double>(least));
  needs.share = view_share;
  if (record.lens_known()) return needs;
  needs.region = least_covered(record, options);
  const double ratio = record.depth_ratio();
  if (views > 0 && ratio < options.depth_ratio) {
    needs.distance = record.largest_share() < kLargeEnough ? CaptureAdvice::Distance::kNearer
                                                           : CaptureAdvice::Distance::kFarther;
  }
  double tilts = 0;
  for (const TiltSide side : kSides) {
    const double deg = record.tilt_deg(side);
    tilts += std::min(1.0, deg / options.tilt_deg);
    if (views > 0 && deg < options.tilt_deg && !needs.tilt) needs.tilt = side;
  }
  const double depth = views == 0 ? 0 : std::min(1.0, (ratio - 1) / (options.depth_ratio - 1));
  needs.share =
      0.3 * view_share + 0.35 * region_share(record, options) + 0.15 * depth + 0.2 * tilts / 4;
  return needs;
}

std::string region_words(const ImageRegion& region) {
  constexpr std::array kRows = {"upper", "middle", "lower"};
  constexpr std::array kColumns = {"left", "middle", "right"};
  if (region == ImageRegion{1, 1}) return "in the middle of its picture";
  const auto row = static_cast<size_t>(region.row), column = static_cast<size_t>(region.column);
  if (region.row == 1) return fmt::format("at the {} edge of its picture", kColumns[column]);
  if (region.column == 1) return fmt::format("at the {} edge of its picture", kRows[row]);
  return fmt::format("in the {} {} corner of its picture", kRows[row], kColumns[column]);
}

std::string show_words(const std::string& camera, const CaptureAdvice& advice, bool first) {
  constexpr std::array kTilts = {"left", "right", "top", "bottom"};
  std::string words = fmt::format("{}: show {}the board", camera, first ? "it " : "");
  if (advice.region) words += fmt::format(" {}", region_words(*advice.region));
  if (advice.distance == CaptureAdvice::Distance::kNearer) words += ", nearer";
  if (advice.distance == CaptureAdvice::Distance::kFarther) words += ", farther away";
  if (advice.tilt) {
    words += fmt::format(", tilted: its {} edge (in the picture) towards the camera",
                         kTilts[static_cast<size_t>(*advice.tilt)]);
  }
  const bool nothing =
      !advice.region && !advice.tilt && advice.distance == CaptureAdvice::Distance::kAny;
  return nothing ? words + " in another pose, tilted" : words;
}

std::string link_words(const std::string& a, const std::string& b, size_t sets, size_t needed) {
  if (sets == 0) {
    return fmt::format("{} and {} have never seen it together: show the board where both see it", a,
                       b);
  }
  return fmt::format("{} and {} have seen it together {} time{}, {} are needed", a, b, sets,
                     sets == 1 ? "" : "s", needed);
}

}  // namespace sightline::calibrate
