// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/template_bank.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "observe/detect/detect_constants.hpp"
#include "observe/detect/kernels/scan_kernel.hpp"
#include "sightline/geometry/rotation_between.hpp"

namespace sightline::observe {
namespace {

// Turns the camera's axis into the ray.
Eigen::Quaterniond ray_turn(const Eigen::Vector3d& ray) {
  return rotation_between(Eigen::Vector3d::UnitZ(), ray);
}

class FeaturePicker {
 public:
  FeaturePicker(const View& view, const Eigen::Vector3d& center)
      : rotation_(view.camera_from_object.rotation_matrix().cast<float>()),
        center_((view.camera_from_object * center).cast<float>()),
        translation_(view.camera_from_object.translation.cast<float>()) {}

  void add(const Eigen::Vector3f& point, const Eigen::Vector3f& normal, ViewFeatures& out) const {
    if (out.count == ViewFeatures::kMax) return;
    const Eigen::Vector3f p = rotation_ * point + translation_;
    const Eigen::Vector3f n = rotation_ * normal;
    const float to_center = center_.z() / p.z();
    out.x[out.count] = p.x() * to_center;
    out.y[out.count] = p.y() * to_center;
    out.angle[out.count] = std::atan2(n.y(), n.x());
    ++out.count;
  }
  // In the image, across the tangent.
  Eigen::Vector3f normal_of(const InnerEdgeSample& edge) const {
    const Eigen::Vector3f t = rotation_ * edge.tangent;
    return rotation_.transpose() * Eigen::Vector3f(-t.y(), t.x(), 0.0f);
  }

 private:
  Eigen::Matrix3f rotation_;
  Eigen::Vector3f center_, translation_;
};

float turn_angle(int turn, const ScanRange& range) {
  return static_cast<float>(2 * std::numbers::pi * turn / range.turns);
}

ViewFeatures pick_features(const View& view, const Eigen::Vector3d& center) {
  const FeaturePicker picker(view, center);
  ViewFeatures out;
  const size_t inner = std::min(view.edges.size() / 4, ViewFeatures::kMax - kOutlineFeatures);
  const size_t outer = std::min(view.contour.size(), ViewFeatures::kMax - inner);
  for (size_t i = 0; i < outer; ++i) {
    const ContourSample& sample = view.contour[(2 * i + 1) * view.contour.size() / (2 * outer)];
    picker.add(sample.point, sample.normal, out);
  }
  for (size_t i = 0; i < inner; ++i) {
    const InnerEdgeSample& edge = view.edges[(2 * i + 1) * view.edges.size() / (2 * inner)];
    picker.add(edge.point, picker.normal_of(edge), out);
  }
  return out;
}

// Keeps the best hits of a stream of unknown length and quality.
class HitList {
 public:
  explicit HitList(size_t max) : max_(max) {}
  uint8_t threshold() const { return threshold_; }
  void add(const ScanHit& hit) {
    hits_.push_back(hit);
    if (hits_.size() >= 4 * max_) shrink(2 * max_);
  }
  // Best first; what scores the same in the order in which it came.
  std::vector<ScanHit> take() const {
    std::array<size_t, 256> next{};  // place of the next one of each score
    const std::array<size_t, 256> counts = count_scores();
    for (size_t score = 255; score > 0; --score) next[score - 1] = next[score] + counts[score];
    std::vector<ScanHit> out(hits_.size());
    for (const ScanHit& hit : hits_) out[next[hit.score]++] = hit;
    return out;
  }

 private:
  std::array<size_t, 256> count_scores() const {
    std::array<size_t, 256> counts{};
    for (const ScanHit& hit : hits_) ++counts[hit.score];
    return counts;
  }
  // Keeps the best, of the lowest score those that came first.
  void shrink(size_t size) {
    const std::array<size_t, 256> counts = count_scores();
    size_t lowest = 255, better = 0;
    while (better + counts[lowest] < size) better += counts[lowest--];
    size_t left = size - better;
    std::erase_if(hits_, [&](const ScanHit& hit) {
      if (hit.score != lowest) return hit.score < lowest;
      if (left == 0) return true;
      --left;
      return false;
    });
    threshold_ =
        static_cast<uint8_t>(std::max<size_t>(threshold_, std::min<size_t>(lowest + 1, 255)));
  }

  const size_t max_;
  uint8_t threshold_ = 90;
  std::vector<ScanHit> hits_;
};

}  // namespace

TemplateBank::TemplateBank(std::shared_ptr<const ViewpointModel> model) : model_(std::move(model)) {
  for (size_t i = 0; i < model_->size(); ++i) {
    const View view = model_->view(i);
    features_.push_back(pick_features(view, model_->center()));
    camera_from_object_.push_back(view.camera_from_object.rotation_matrix());
  }
}

float TemplateBank::score(const WeakPerspectivePose& pose, const ResponseMaps& maps) const {
  const ViewFeatures& f = features_[pose.view];
  if (f.count == 0) return 0;
  const float c = std::cos(pose.turn) * pose.scale, s = std::sin(pose.turn) * pose.scale;
  PlacedFeatures placed;
  placed.count = f.count;
  for (size_t i = 0; i < ViewFeatures::kMax; ++i) {
    placed.bins[i] = angle_bin(f.angle[i] + pose.turn);
    placed.x[i] = pose.x + c * f.x[i] - s * f.y[i] + 0.5f;
    placed.y[i] = pose.y + s * f.x[i] + c * f.y[i] + 0.5f;
  }
  const int sum = sum_responses(maps.planes(), placed, 0, 0, 1);
  return static_cast<float>(sum) /
         static_cast<float>(ResponseMaps::kFullResponse * static_cast<int>(f.count));
}

std::optional<WeakPerspectivePose> TemplateBank::weak_perspective(const CameraModel& camera,
                                                                  const Rigid3& camera_from_object,
                                                                  double shrink) const {
  const Eigen::Vector3d center = camera_from_object * model_->center();
  const double distance = center.norm();
  if (center.z() < 0.01 * distance || distance < 1.01 * model_->radius()) return std::nullopt;
  const auto pixel = camera.project(center);
  if (!pixel) return std::nullopt;
  WeakPerspectivePose out;
  out.view = model_->nearest(camera_from_object);
  const Eigen::Matrix3d along_ray = ray_turn(center / distance).toRotationMatrix().transpose() *
                                    camera_from_object.rotation_matrix();
  const Eigen::Matrix3d turn = along_ray * camera_from_object_[out.view].transpose();
  out.turn = static_cast<float>(std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1)));
  out.scale = static_cast<float>(camera.parameters().fx / (distance * shrink));
  // Pixel centers of the small image lie between those of the large one.
  out.x = static_cast<float>((pixel->x() + 0.5) / shrink - 0.5);
  out.y = static_cast<float>((pixel->y() + 0.5) / shrink - 0.5);
  return out;
}

std::optional<Rigid3> TemplateBank::full_pose(const CameraModel& camera,
                                              const WeakPerspectivePose& pose,
                                              double shrink) const {
  const Eigen::Vector2d pixel((static_cast<double>(pose.x) + 0.5) * shrink - 0.5,
                              (static_cast<double>(pose.y) + 0.5) * shrink - 0.5);
  const auto ray = camera.unproject(pixel);
  if (!ray || !(pose.scale > 0)) return std::nullopt;
  const double distance = camera.parameters().fx / (static_cast<double>(pose.scale) * shrink);
  const Eigen::Quaterniond rotation =
      ray_turn(*ray) * Eigen::AngleAxisd(static_cast<double>(pose.turn), Eigen::Vector3d::UnitZ()) *
      Eigen::Quaterniond(camera_from_object_[pose.view]);
  return Rigid3(rotation, distance * *ray - rotation * model_->center());
}

WeakPerspectivePose template_pose(const ScanHit& hit, const ScanRange& range) {
  WeakPerspectivePose pose;
  pose.view = hit.view;
  pose.turn = turn_angle(hit.turn, range);
  pose.scale = range.scales[hit.scale];
  pose.x = hit.x;
  pose.y = hit.y;
  return pose;
}

namespace {

constexpr int kColumnStep = ResponseMaps::kColumnStep;

// A view in all turns, row by row: what one turn has read of the maps is near for the next one.
class TemplateScan {
 public:
  TemplateScan(const ResponseMaps& maps, const ScanRange& range)
      : maps_(maps),
        range_(range),
        turned_(static_cast<size_t>(range.turns)),
        sums_(static_cast<size_t>(maps.stride() / kColumnStep) + 64),
        hits_(range.max) {}

  void scan(const ViewFeatures& f, ScanHit at) {
    count_ = f.count;
    for (int turn = 0; turn < range_.turns; ++turn) {
      place(f, turn_angle(turn, range_), range_.scales[at.scale],
            turned_[static_cast<size_t>(turn)]);
    }
    for (int y = 0; y < maps_.height(); y += kScanRowStep) {
      const auto [left, end] =
          range_.rows.empty() ? std::array{0, maps_.width()} : range_.rows[static_cast<size_t>(y)];
      const int first = left / kColumnStep;
      const int columns = std::max(0, (end - kColumnStep * first + kColumnStep - 1) / kColumnStep);
      places_ += static_cast<uint64_t>(columns) * turned_.size();
      for (size_t turn = 0; columns > 0 && turn < turned_.size(); ++turn) {
        at.turn = static_cast<uint16_t>(turn);
        scan_row({turned_[turn].data(), count_}, at, first, columns, y);
      }
    }
  }

  uint64_t places() const { return places_; }
  std::vector<ScanHit> take() const {
    std::vector<ScanHit> best = hits_.take();
    if (best.size() > range_.max) best.resize(range_.max);
    return best;
  }

 private:
  using Features = std::array<const uint8_t*, ViewFeatures::kMax>;  // of the first place

  void place(const ViewFeatures& f, float angle, float scale, Features& to) const {
    const auto reach = static_cast<float>(maps_.margin());
    const float c = std::cos(angle) * scale, s = std::sin(angle) * scale;
    for (size_t i = 0; i < f.count; ++i) {
      const float x = std::clamp(c * f.x[i] - s * f.y[i], -reach, reach);
      const float y = std::clamp(s * f.x[i] + c * f.y[i], -reach, reach);
      to[i] = maps_.place(angle_bin(f.angle[i] + angle), static_cast<int>(std::floor(x + 0.5f)),
                          static_cast<int>(std::floor(y + 0.5f)));
    }
  }

  void scan_row(std::span<const uint8_t* const> features, const ScanHit& at, int first, int columns,
                int y) {
    const uint8_t threshold = hits_.threshold();
    const ptrdiff_t offset = y * maps_.stride() + first;
    if (!sum_features(features, offset, columns, threshold, sums_.data())) return;
    const auto end = static_cast<size_t>(columns);
    for (size_t x = next_reaching(sums_, 0, end, threshold); x < end;
         x = next_reaching(sums_, x + 1, end, threshold)) {
      const uint8_t sum = sums_[x];
      // Of a plateau its first place.
      if ((x > 0 && sums_[x - 1] >= sum) || (x + 1 < end && sums_[x + 1] > sum)) continue;
      ScanHit hit = at;
      hit.score = sum;
      hit.x = static_cast<int16_t>(kColumnStep * (first + static_cast<int>(x)));
      hit.y = static_cast<int16_t>(y);
      hits_.add(hit);
    }
  }

  const ResponseMaps& maps_;
  const ScanRange& range_;
  std::vector<Features> turned_;
  size_t count_ = 0;
  std::vector<uint8_t> sums_;
  HitList hits_;
  uint64_t places_ = 0;
};

}  // namespace

std::vector<ScanHit> scan(const TemplateBank& bank, const ResponseMaps& maps,
                          const ScanRange& range) {
  TemplateScan scan(maps, range);
  const size_t views = std::min(range.views, bank.model().size());
  for (size_t scale = 0; scale < range.scales.size(); ++scale) {
    for (size_t view = 0; view < views; ++view) {
      scan.scan(bank.features(view),
                {0, static_cast<uint16_t>(view), 0, static_cast<uint16_t>(scale), 0, 0});
    }
  }
  bank.work().places += scan.places();
  return scan.take();
}

}  // namespace sightline::observe
