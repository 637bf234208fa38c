// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/turn/panorama.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "observe/terms/opencv_threads.hpp"
#include "observe/terms/opencv_view.hpp"
#include "observe/turn/panorama_parts.hpp"
#include "sightline/base/check.hpp"

namespace sightline {

using namespace observe;

namespace {

constexpr double kReachShare = 0.45;    // of the narrower angle of view
constexpr double kSpacingShare = 0.16;  // of the wider one
constexpr size_t kWarm = 3;             // keyframes whose slopes are kept

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

class Panorama::Impl {
 public:
  struct Keyframe {
    cv::Mat image;
    std::vector<PanoramaPoint> points;
    std::vector<cv::Mat> pyramid;  // with slopes, while it is in use
    uint64_t used = 0;
  };
  struct Track {
    PanoramaPoint* point = nullptr;
    Eigen::Vector2d pixel, error;     // found; less where it should be [px]
    Eigen::Matrix2d by_angles;        // [px/rad]
    Eigen::Vector2d by_depth;         // [px m]
    double variance = 0, weight = 0;  // of the error [px^2]; Tukey's, 0 .. 1
  };

  Impl(const CameraModel& model, const CameraAxes& axes);
  void look_at(const PlaneView& gray, const PlaneView& half, std::span<const MaskPolygon> masked);
  std::optional<PictureAngles> measure(size_t index, const KeyframeView& view,
                                       const Eigen::Vector2d& start);
  bool add(size_t index);

  std::vector<Keyframe> keyframes;
  double reach = 0, spacing = 0;

 private:
  Eigen::Vector2d pixel_of(const cv::Point2f& at) const {
    return scale_ * Eigen::Vector2d(at.x + 0.5, at.y + 0.5) - Eigen::Vector2d(0.5, 0.5);
  }
  cv::Point2f looked_at(const Eigen::Vector2d& pixel) const {
    return cv::Point2f(static_cast<float>((pixel.x() + 0.5) / scale_ - 0.5),
                       static_cast<float>((pixel.y() + 0.5) / scale_ - 0.5));
  }
  bool is_inside(const cv::Point2f& at) const;
  bool is_masked(const cv::Point2f& at) const;
  void warm_up(Keyframe& keyframe);
  bool find(Keyframe& keyframe, const PanoramaGeometry& geometry);
  Eigen::Vector2d majority(const PanoramaGeometry& geometry);
  bool linearize(const PanoramaGeometry& geometry);
  double weigh();
  Eigen::Matrix2d normal(Eigen::Vector2d* right) const;
  std::optional<PictureAngles> conclude(const PanoramaGeometry& geometry,
                                        const Eigen::Vector2d& angles, double noise);
  bool agree() const;
  void learn(double noise);

  const CameraModel model_;
  const CameraAxes axes_;
  double scale_ = 1;  // pixels of the picture per pixel that is looked at
  cv::Mat picture_;
  std::vector<cv::Mat> pyramid_;
  std::vector<std::vector<cv::Point2f>> hulls_;
  uint64_t uses_ = 0;
  std::vector<Track> tracks_;
  std::vector<cv::Point2f> from_, to_;
  std::vector<uint8_t> found_;
  std::vector<float> errors_;
  std::vector<double> sorted_;
};

Panorama::Impl::Impl(const CameraModel& model, const CameraAxes& axes)
    : model_(model), axes_(axes), scale_(Panorama::wants_half(model) ? 2 : 1) {
  keep_opencv_in_one_thread();
  const auto& lens = model.parameters();
  const double across = 2 * std::atan(0.5 * lens.width / lens.fx);
  const double down = 2 * std::atan(0.5 * lens.height / lens.fy);
  reach = kReachShare * std::min(across, down);
  spacing = kSpacingShare * std::max(across, down);
  spacing = std::min(spacing, 0.6 * reach);
}

void Panorama::Impl::look_at(const PlaneView& gray, const PlaneView& half,
                             std::span<const MaskPolygon> masked) {
  picture_ = opencv_view(scale_ > 1 ? half : gray);
  cv::buildOpticalFlowPyramid(picture_, pyramid_, cv::Size(kWindow, kWindow), kLevels, false);
  hulls_.clear();
  for (const MaskPolygon& corners : masked) {
    if (corners.empty()) continue;
    std::vector<cv::Point2f> points;
    for (const Eigen::Vector2d& corner : corners) points.push_back(looked_at(corner));
    cv::convexHull(points, hulls_.emplace_back());
  }
}

bool Panorama::Impl::is_inside(const cv::Point2f& at) const {
  return at.x >= kBorder && at.y >= kBorder && at.x < static_cast<float>(picture_.cols - kBorder) &&
         at.y < static_cast<float>(picture_.rows - kBorder);
}

// Half a window beside an outline still sees it.
bool Panorama::Impl::is_masked(const cv::Point2f& at) const {
  return std::any_of(hulls_.begin(), hulls_.end(), [&](const auto& hull) {
    return cv::pointPolygonTest(hull, at, true) > -0.5 * kWindow;
  });
}

// Slopes cost more than the pixels: they are kept of the few keyframes that are in use.
void Panorama::Impl::warm_up(Keyframe& keyframe) {
  keyframe.used = ++uses_;
  if (!keyframe.pyramid.empty()) return;
  cv::buildOpticalFlowPyramid(keyframe.image, keyframe.pyramid, cv::Size(kWindow, kWindow), kLevels,
                              true);
  size_t warm = 0;
  Keyframe* oldest = nullptr;
  for (Keyframe& other : keyframes) {
    if (other.pyramid.empty()) continue;
    ++warm;
    if (oldest == nullptr || other.used < oldest->used) oldest = &other;
  }
  if (warm > kWarm) oldest->pyramid.clear();
}

// False: too few of its points should be in the picture.
bool Panorama::Impl::find(Keyframe& keyframe, const PanoramaGeometry& geometry) {
  from_.clear();
  to_.clear();
  tracks_.clear();
  for (PanoramaPoint& point : keyframe.points) {
    if (point.misses >= kMaxMisses) continue;
    const auto pixel = geometry.project(point);
    if (!pixel) continue;
    const cv::Point2f at = looked_at(*pixel);
    if (!is_inside(at) || is_masked(at)) continue;
    from_.push_back(point.at);
    to_.push_back(at);
    tracks_.emplace_back().point = &point;
  }
  if (tracks_.size() < static_cast<size_t>(kMinPoints)) return false;
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 20, 0.01);
  cv::calcOpticalFlowPyrLK(keyframe.pyramid, pyramid_, from_, to_, found_, errors_,
                           cv::Size(kWindow, kWindow), kLevels, stop, cv::OPTFLOW_USE_INITIAL_FLOW,
                           1e-4);
  for (size_t i = 0; i < tracks_.size(); ++i) {
    if (found_[i] == 0 || !is_inside(to_[i]) || is_masked(to_[i])) tracks_[i].point = nullptr;
    tracks_[i].pixel = pixel_of(to_[i]);
  }
  return true;
}

// What most points say where each is asked alone: the two medians stand nearly half of liars.
Eigen::Vector2d Panorama::Impl::majority(const PanoramaGeometry& geometry) {
  Eigen::Vector2d out = Eigen::Vector2d::Zero();
  if (!linearize(geometry)) return out;
  for (int axis = 0; axis < 2; ++axis) {
    sorted_.clear();
    for (const Track& track : tracks_) {
      if (track.point == nullptr) continue;
      sorted_.push_back((track.by_angles.inverse() * track.error)(axis));
    }
    out(axis) = median(sorted_);
  }
  return out;
}

// Errors and slopes of all that was found; false: too little was.
bool Panorama::Impl::linearize(const PanoramaGeometry& geometry) {
  int found = 0;
  for (Track& track : tracks_) {
    if (track.point == nullptr) continue;
    const auto pixel = geometry.project(*track.point);
    const auto by_angles = pixel ? geometry.by_angles(*track.point, *pixel) : std::nullopt;
    const auto by_depth = pixel ? geometry.by_depth(*track.point, *pixel) : std::nullopt;
    if (!by_angles || !by_depth || std::abs(by_angles->determinant()) < 1) {
      track.point = nullptr;
      continue;
    }
    track.error = track.pixel - *pixel;
    track.by_angles = *by_angles;
    track.by_depth = *by_depth;
    ++found;
  }
  return found >= kMinPoints;
}

// Tukey's weights; returns the noise of a point [px], by the median of all.
double Panorama::Impl::weigh() {
  sorted_.clear();
  for (const Track& track : tracks_) {
    if (track.point != nullptr) sorted_.push_back(track.error.norm());
  }
  constexpr double kRayleighMedian = 1.1774;  // of a length whose parts have a sigma of 1
  const double noise = std::max(median(sorted_) / kRayleighMedian, kLeastNoise * scale_);
  for (Track& track : tracks_) {
    if (track.point == nullptr) continue;
    track.variance = noise * noise + 0.5 * track.by_depth.squaredNorm() * track.point->variance;
    const double share = track.error.squaredNorm() / (kTukey * kTukey * track.variance);
    track.weight = share < 1 ? (1 - share) * (1 - share) : 0;
  }
  return noise;
}

Eigen::Matrix2d Panorama::Impl::normal(Eigen::Vector2d* right) const {
  Eigen::Matrix2d out = Eigen::Matrix2d::Zero();
  for (const Track& track : tracks_) {
    if (track.point == nullptr || track.weight == 0) continue;
    const double weight = track.weight / track.variance;
    out += weight * track.by_angles.transpose() * track.by_angles;
    if (right != nullptr) *right += weight * track.by_angles.transpose() * track.error;
  }
  return out;
}

// Enough of the points, all over the picture.
bool Panorama::Impl::agree() const {
  int agreeing = 0, cells = 0;
  std::array<bool, kCellsX * kCellsY> seen{};
  for (const Track& track : tracks_) {
    if (track.point == nullptr || track.weight < 0.1) continue;
    ++agreeing;
    const int x = static_cast<int>(track.pixel.x() * kCellsX / model_.width());
    const int y = static_cast<int>(track.pixel.y() * kCellsY / model_.height());
    bool& cell = seen.at(static_cast<size_t>(std::clamp(y, 0, kCellsY - 1) * kCellsX +
                                             std::clamp(x, 0, kCellsX - 1)));
    cells += cell ? 0 : 1;
    cell = true;
  }
  return agreeing >= kMinPoints && cells >= kMinCells &&
         agreeing >= kMinShare * static_cast<double>(tracks_.size());
}

// Points close together are wrong together (light, blur): no cell counts for more than one.
std::optional<PictureAngles> Panorama::Impl::conclude(const PanoramaGeometry& geometry,
                                                      const Eigen::Vector2d& angles, double noise) {
  if (noise > kMostNoise * scale_ || !agree()) return std::nullopt;
  PictureAngles out;
  out.angles = angles;
  const Eigen::Matrix2d inverse = normal(nullptr).inverse();
  if (!inverse.allFinite()) return std::nullopt;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero(), by_keyframe = Eigen::Matrix2d::Zero();
  Eigen::Vector2d by_depth = Eigen::Vector2d::Zero();
  for (const Track& track : tracks_) {
    if (track.point == nullptr || track.weight == 0) continue;
    const double weight = track.weight / track.variance;
    const Eigen::Matrix2d gain = weight * track.by_angles.transpose();
    Eigen::Matrix2d error = noise * noise * Eigen::Matrix2d::Identity();
    error += track.point->variance * track.by_depth * track.by_depth.transpose();
    scatter += gain * error * gain.transpose();
    by_depth -= gain * track.by_depth;
    const Eigen::Vector2d pixel = track.pixel - track.error;
    const auto moved = geometry.by_keyframe(*track.point, pixel);
    if (moved) by_keyframe -= gain * *moved;
    out.points += track.weight > 0.1 ? 1 : 0;
  }
  const double crowded = std::max(1.0, out.points / static_cast<double>(kCellsX * kCellsY));
  const double floor = kFloor * scale_ / model_.parameters().fx;
  out.covariance = crowded * inverse * scatter * inverse;
  out.covariance.diagonal().array() += floor * floor;
  out.by_depth = inverse * by_depth;
  out.by_keyframe = inverse * by_keyframe;
  return out;
}

// One Kalman step for each point's inverse distance. What is the same of all of them has gone into
// the angles.
void Panorama::Impl::learn(double noise) {
  for (Track& track : tracks_) {
    if (track.point == nullptr) continue;
    PanoramaPoint& point = *track.point;
    if (track.weight < 0.1) {
      ++point.misses;
      continue;
    }
    point.misses = 0;
    const double slope = track.by_depth.norm();
    if (slope * kSpread < 0.2 * noise) continue;
    const double error = track.error.dot(track.by_depth) / slope;
    const double gain =
        point.variance * slope / (slope * slope * point.variance + 2 * noise * noise);
    point.depth += gain * error;
    point.variance = std::max((1 - gain * slope) * point.variance, kLeastSpread * kLeastSpread);
  }
}

std::optional<PictureAngles> Panorama::Impl::measure(size_t index, const KeyframeView& view,
                                                     const Eigen::Vector2d& start) {
  Keyframe& keyframe = keyframes.at(index);
  warm_up(keyframe);
  constexpr int kTurns = 6;
  constexpr double kEnough = 1e-7;  // [rad]
  const PanoramaGeometry first(model_, axes_, view, start);
  if (!find(keyframe, first) || !linearize(first)) return std::nullopt;
  Eigen::Vector2d angles = start + majority(first);
  for (int turn = 0;; ++turn) {
    const PanoramaGeometry geometry(model_, axes_, view, angles);
    if (!linearize(geometry)) return std::nullopt;
    const double noise = weigh();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    const Eigen::Vector2d step = normal(&right).ldlt().solve(right);
    if (!step.allFinite()) return std::nullopt;
    if (turn < kTurns && step.norm() > kEnough) {
      angles += step;
      continue;
    }
    auto out = conclude(geometry, angles, noise);
    if (out) learn(noise);
    return out;
  }
}

// Corners at least some pixels apart, strongest first; below kMinTexture it would be noise.
bool Panorama::Impl::add(size_t index) {
  cv::Mat texture;
  constexpr int kBlock = 5;
  cv::cornerMinEigenVal(picture_, texture, kBlock);
  double strongest = 0;
  cv::minMaxLoc(texture, nullptr, &strongest);
  if (strongest < kMinTexture) return false;
  const double quality = std::clamp(kMinTexture / strongest, 0.003, 0.99);
  const double apart = std::sqrt(static_cast<double>(picture_.total()) / (2.5 * kMaxPoints));
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(picture_, corners, 2 * kMaxPoints, quality, apart, cv::noArray(), kBlock);
  Keyframe keyframe;
  for (const cv::Point2f& corner : corners) {
    if (!is_inside(corner) || is_masked(corner)) continue;
    const auto ray = model_.unproject(pixel_of(corner));
    if (!ray) continue;
    PanoramaPoint& point = keyframe.points.emplace_back();
    point.at = corner;
    point.ray = *ray;
    if (keyframe.points.size() >= static_cast<size_t>(kMaxPoints)) break;
  }
  if (keyframe.points.size() < static_cast<size_t>(2 * kMinPoints)) return false;
  keyframe.image = picture_.clone();
  keyframe.used = ++uses_;
  if (index == keyframes.size()) {
    keyframes.push_back(std::move(keyframe));
  } else {
    keyframes.at(index) = std::move(keyframe);
  }
  return true;
}

Panorama::Panorama(const CameraModel& model, const CameraAxes& axes)
    : impl_(std::make_unique<Impl>(model, axes)) {}
Panorama::~Panorama() = default;

void Panorama::look_at(const PlaneView& gray, const PlaneView& half_gray,
                       std::span<const MaskPolygon> masked) {
  impl_->look_at(gray, half_gray, masked);
}
std::optional<PictureAngles> Panorama::measure(size_t index, const KeyframeView& view,
                                               const Eigen::Vector2d& start) {
  return impl_->measure(index, view, start);
}
bool Panorama::add(size_t index) { return impl_->add(index); }
size_t Panorama::size() const { return impl_->keyframes.size(); }
void Panorama::clear() { impl_->keyframes.clear(); }
double Panorama::reach() const { return impl_->reach; }
double Panorama::spacing() const { return impl_->spacing; }

}  // namespace sightline
