// SPDX-License-Identifier: Apache-2.0
#include "observe/track/symmetry/color_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline::observe {
namespace {

constexpr double kLargestRadius = 60;   // [cells] of the object; larger ones are looked at coarser
constexpr double kSmallestRadius = 12;  // [px]
constexpr int kBorder = 3;              // [cells] left out beside what hides and the outline
constexpr int kPoseError = 2;           // [cells] over which the mesh's colors are averaged
constexpr float kDifferent = 12;        // [levels] between two poses
constexpr float kSameMaterial = 10;     // [levels] of the mesh
constexpr double kFewestPixels = 40;    // that differ
constexpr size_t kFewestOfSide = 30;    // cells that a side is learned from
constexpr std::array<float, 3> kLeastSpread = {4, 2, 2};  // [levels] of Y, U, V
constexpr double kToSigma = 1.5;                          // of a median absolute deviation
constexpr double kMostOfCell = 25;                        // squares of what no pose explains
// Of the contrast in the image to that of the mesh: what is far less or more is something else.
constexpr double kLeastGain = 0.15, kMostGain = 2;
constexpr double kLeastShown = 0.05;   // of the spread, squared: a pose that shows its part
constexpr double kMinAgreement = 0.6;  // of the best pose
constexpr double kMaxAgreement = 0.975;
// Pixels of a label err together, and go on to do so from frame to frame.
constexpr double kPixelsPerIndependent = 25, kMostIndependent = 6;

float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

CameraModel coarser(const CameraModel& model, int scale) {
  CameraModel::Parameters p = model.parameters();
  p.width = std::max(1, p.width / scale);
  p.height = std::max(1, p.height / scale);
  p.fx /= scale;
  p.fy /= scale;
  p.cx = (p.cx + 0.5) / scale - 0.5;
  p.cy = (p.cy + 0.5) / scale - 0.5;
  return CameraModel::create(p, "coarser image").value();
}

// Means of 2 `reach` + 1 entries along lines of `count`; near their ends of fewer.
void smooth_lines(const std::vector<float>& from, int lines, int count, size_t between_lines,
                  size_t step, int reach, std::vector<float>& to) {
  for (int line = 0; line < lines; ++line) {
    const size_t start = static_cast<size_t>(line) * between_lines;
    for (int i = 0; i < count; ++i) {
      const int first = std::max(0, i - reach), last = std::min(count - 1, i + reach);
      float sum = 0;
      for (int k = first; k <= last; ++k) sum += from[start + static_cast<size_t>(k) * step];
      to[start + static_cast<size_t>(i) * step] = sum / static_cast<float>(last - first + 1);
    }
  }
}

float mean_of(const PlaneView& plane, int x, int y, int size) {
  int sum = 0, count = 0;
  for (int v = y; v < std::min(y + size, plane.height); ++v) {
    for (int u = x; u < std::min(x + size, plane.width); ++u, ++count) sum += plane.row(v)[u];
  }
  return count > 0 ? static_cast<float>(sum) / static_cast<float>(count) : 0.0f;
}

}  // namespace

ColorComparison::ColorComparison(const TrackerCamera& camera, const TrackedObject& object)
    : camera_(camera), object_(object) {}

bool ColorComparison::aim(const Rigid3& camera_from_object) {
  const Eigen::Vector3d center = camera_from_object * object_.views->center();
  if (!(center.z() > object_.views->radius())) return false;
  const CameraModel& own = camera_.camera->model;
  const double radius = own.parameters().fx * object_.views->radius() / center.norm();
  if (radius < kSmallestRadius) return false;
  size_t k = 0;
  while (k + 1 < levels_.size() && radius > kLargestRadius * (1 << k)) ++k;
  scale_ = 1 << k;
  level_ = &levels_[k];
  if (!level_->renderer) {
    level_->model = std::make_unique<CameraModel>(k == 0 ? own : coarser(own, scale_));
    level_->renderer = object_.colors(*level_->model);
  }
  return true;
}

// The first pose's tile is the part of the image that is looked at.
void ColorComparison::begin(const ColorTile& tile) {
  x_ = tile.depth.x;
  y_ = tile.depth.y;
  width_ = tile.depth.width;
  height_ = tile.depth.height;
  const size_t cells = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  free_.assign(cells, 0);
  side_.resize(cells);
  depth_.resize(cells);
  for (int y = 0; y < height_; ++y) {
    std::copy_n(tile.side + y * tile.stride, width_, side_.begin() + y * width_);
    std::copy_n(tile.depth.row(y), width_, depth_.begin() + y * width_);
  }
}

void ColorComparison::take(const ColorTile& tile, Planes& painted) {
  for (auto& plane : painted) plane.assign(free_.size(), 0);
  for (int y = 0; y < height_; ++y) {
    const int from_y = y + y_ - tile.depth.y;
    if (from_y < 0 || from_y >= tile.depth.height) continue;
    const float* const depth = tile.depth.row(from_y);
    for (int x = 0; x < width_; ++x) {
      const int from_x = x + x_ - tile.depth.x;
      if (from_x < 0 || from_x >= tile.depth.width || !(depth[from_x] > 0)) continue;
      const auto cell = static_cast<size_t>(y * width_ + x);
      ++free_[cell];
      const ptrdiff_t at = from_y * tile.stride + from_x;
      for (size_t c = 0; c < 3; ++c) painted[c][cell] = tile.color[c][at];
    }
  }
}

void ColorComparison::smooth(int reach, Planes& planes) {
  const auto w = static_cast<size_t>(width_);
  for (std::vector<float>& plane : planes) {
    scratch_.resize(plane.size());
    smooth_lines(plane, height_, width_, w, 1, reach, scratch_);
    smooth_lines(scratch_, width_, height_, 1, w, reach, plane);
  }
}

bool ColorComparison::draw_all(std::span<const Rigid3> poses) {
  painted_.resize(std::max(painted_.size(), poses.size()));
  for (size_t k = 0; k < poses.size(); ++k) {
    const ColorTile tile = level_->renderer->render(camera_.camera_from_world * poses[k]);
    if (k == 0) {
      if (tile.depth.width < 4 * kBorder || tile.depth.height < 4 * kBorder) return false;
      begin(tile);
    }
    take(tile, painted_[k]);
    smooth(kPoseError, painted_[k]);
  }
  const auto all = static_cast<uint16_t>(poses.size());
  for (uint16_t& cell : free_) cell = cell == all ? std::numeric_limits<uint16_t>::max() : 0;
  return true;
}

void ColorComparison::leave_out_hidden(const Occluders& occluders) {
  if (occluders.scene.width <= 0 && occluders.spheres.empty()) return;
  constexpr int kBlock = 4;
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);
  for (int y = 0; y < height_; y += kBlock) {
    for (int x = 0; x < width_; x += kBlock) {
      const int mx = std::min(x + kBlock / 2, width_ - 1);
      const int my = std::min(y + kBlock / 2, height_ - 1);
      const double inverse = depth_[static_cast<size_t>(my * width_ + mx)];
      if (!(inverse > 0)) continue;
      const Eigen::Vector2d cell(x_ + mx, y_ + my);
      const auto ray = level_->model->unproject(cell);
      const Eigen::Vector2d pixel = (cell + half) * scale_ - half;
      if (ray && !occluders.hide(pixel, *ray / (ray->z() * inverse))) continue;
      for (int v = y; v < std::min(y + kBlock, height_); ++v) {
        std::fill_n(free_.begin() + v * width_ + x, std::min(kBlock, width_ - x), 0);
      }
    }
  }
}

// Steps to the next cell that is not free, in two passes.
void ColorComparison::measure_borders() {
  const auto at = [&](int x, int y) -> int {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return 0;
    return free_[static_cast<size_t>(y * width_ + x)];
  };
  const auto relax = [&](int x, int y, int sign) {
    uint16_t& own = free_[static_cast<size_t>(y * width_ + x)];
    const int next = std::min(
        {at(x - sign, y), at(x, y - sign), at(x - sign, y - sign), at(x + sign, y - sign)});
    own = static_cast<uint16_t>(std::min<int>(own, next + 1));
  };
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) relax(x, y, 1);
  }
  for (int y = height_ - 1; y >= 0; --y) {
    for (int x = width_ - 1; x >= 0; --x) relax(x, y, -1);
  }
}

void ColorComparison::read(const I420View& image) {
  for (auto& plane : shown_) plane.assign(free_.size(), 0);
  const int half = std::max(1, scale_ / 2);
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const auto cell = static_cast<size_t>(y * width_ + x);
      const int px = (x_ + x) * scale_, py = (y_ + y) * scale_;
      shown_[0][cell] = mean_of(image.y, px, py, scale_);
      shown_[1][cell] = mean_of(image.u, px / 2, py / 2, half);
      shown_[2][cell] = mean_of(image.v, px / 2, py / 2, half);
    }
  }
  smooth(1, shown_);
}

void ColorComparison::sort_cells(size_t poses) {
  differ_.clear();
  for (std::vector<uint32_t>& cells : agree_) cells.clear();
  for (uint32_t cell = 0; cell < free_.size(); ++cell) {
    if (free_[cell] <= kBorder) continue;
    float most = 0;
    for (size_t c = 0; c < 3; ++c) {
      float low = painted_[0][c][cell], high = low;
      for (size_t k = 1; k < poses; ++k) {
        low = std::min(low, painted_[k][c][cell]);
        high = std::max(high, painted_[k][c][cell]);
      }
      most = std::max(most, high - low);
    }
    (most > kDifferent ? differ_ : agree_[side_[cell]]).push_back(cell);
  }
}

// Of the most frequent material of a side: its color in the mesh, in the image, and how much that
// varies. Medians, because a hand may lie on it.
ColorComparison::Side ColorComparison::learn(std::vector<uint32_t>& cells) {
  Side out;
  if (cells.size() < kFewestOfSide) return out;
  const auto median_of = [&](const std::vector<float>& plane) {
    scratch_.clear();
    for (const uint32_t cell : cells) scratch_.push_back(plane[cell]);
    return median(scratch_);
  };
  for (size_t c = 0; c < 3; ++c) out.painted[c] = median_of(painted_[0][c]);
  std::erase_if(cells, [&](uint32_t cell) {
    float off = 0;
    for (size_t c = 0; c < 3; ++c) {
      off = std::max(off, std::abs(painted_[0][c][cell] - out.painted[c]));
    }
    return off >= kSameMaterial;
  });
  if (cells.size() < kFewestOfSide) return out;
  for (size_t c = 0; c < 3; ++c) {
    out.shown[c] = median_of(shown_[c]);
    for (float& level : scratch_) level = std::abs(level - out.shown[c]);
    out.spread[c] = std::max(kLeastSpread[c], static_cast<float>(kToSigma) * median(scratch_));
  }
  double sum = 0;
  for (const uint32_t cell : cells) {
    for (size_t c = 0; c < 3; ++c) {
      const double off = double{shown_[c][cell] - out.shown[c]} / double{out.spread[c]};
      sum += std::min(kMostOfCell, off * off);
    }
  }
  out.rest = std::max(3.0, sum / static_cast<double>(cells.size()));
  out.known = true;
  return out;
}

// With z the contrast in the image to the rest of the side, q that of a pose's colors, both in
// standard deviations: the share of z that q explains, r = z.q / |q| sqrt(z^2 + rest), where `rest`
// is what the places at which the poses agree vary by.
void ColorComparison::add_costs(size_t poses) {
  double energy = 0, cells = 0;
  along_.assign(poses, 0.0);
  expected_.assign(poses, 0.0);
  for (const uint32_t cell : differ_) {
    const Side& side = sides_[side_[cell]];
    if (!side.known) continue;
    ++cells;
    energy += side.rest;
    for (size_t c = 0; c < 3; ++c) {
      const double z = double{shown_[c][cell] - side.shown[c]} / double{side.spread[c]};
      energy += z * z;
      for (size_t k = 0; k < poses; ++k) {
        const double q = double{painted_[k][c][cell] - side.painted[c]} / double{side.spread[c]};
        along_[k] += z * q;
        expected_[k] += q * q;
      }
    }
  }
  const double pixels = cells * scale_ * scale_;
  if (pixels < kFewestPixels) return;
  const double independent = std::min(kMostIndependent, pixels / kPixelsPerIndependent);
  double best = 0;
  for (size_t k = 0; k < poses; ++k) {
    const double gain = along_[k] / std::max(expected_[k], 1e-9);
    const bool shows = expected_[k] > kLeastShown * cells && gain > kLeastGain && gain < kMostGain;
    const double r = shows ? along_[k] / std::sqrt(expected_[k] * energy) : 0;
    best = std::max(best, r);
    const double bounded = std::min(r, kMaxAgreement);
    costs_.push_back(0.5 * independent * std::log1p(-bounded * bounded));
  }
  if (best < kMinAgreement) costs_.clear();
}

const std::vector<double>& ColorComparison::compare(const I420View& image,
                                                    std::span<const Rigid3> poses,
                                                    const Occluders& occluders) {
  costs_.clear();
  if (poses.size() < 2 || !aim(camera_.camera_from_world * poses[0]) || !draw_all(poses)) {
    return costs_;
  }
  leave_out_hidden(occluders);
  measure_borders();
  sort_cells(poses.size());
  if (static_cast<double>(differ_.size()) * scale_ * scale_ < kFewestPixels) return costs_;
  read(image);
  for (size_t side = 0; side < agree_.size(); ++side) sides_[side] = learn(agree_[side]);
  add_costs(poses.size());
  return costs_;
}

}  // namespace sightline::observe
