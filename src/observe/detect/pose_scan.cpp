// SPDX-License-Identifier: Apache-2.0
#include "observe/detect/pose_scan.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "observe/detect/colors/pose_pool.hpp"
#include "observe/detect/detect_constants.hpp"

namespace sightline::observe {
namespace {

void keep_best(std::vector<ScanHit>& hits, const ScanRange& range, const MeshColors& colors,
               size_t camera, size_t max) {
  if (hits.size() <= max) return;
  std::vector<float> colored(hits.size());
  for (size_t i = max / 2; i < hits.size(); ++i) {
    const float agreement = colors.agreement(camera, template_pose(hits[i], range));
    colored[i] = static_cast<float>(hits[i].score) * std::max(0.0f, agreement);
  }
  std::vector<ScanHit> kept;
  for (const size_t i : best_halves(colored, max)) kept.push_back(hits[i]);
  hits = std::move(kept);
}

size_t hits_divisor(DetectorFrames::Where where) {
  switch (where) {
    case DetectorFrames::Where::kForeground:
      return kFocusedHitsDivisor;
    case DetectorFrames::Where::kMotion:
      return kMovingHitsDivisor;
    default:
      return 1;
  }
}

}  // namespace

size_t PoseScan::next_camera(const DetectorFrames& frames, DetectorFrames::Where where) {
  for (size_t i = 0; i < frames.size() && !frames.shows(next_ % frames.size(), where); ++i) ++next_;
  return next_++ % frames.size();
}

std::optional<ImagePlace> PoseScan::next_place(const DetectorFrames& frames,
                                               DetectorFrames::Where where,
                                               const Eigen::Vector3d& place, Time time) {
  for (size_t i = 0; i < frames.size(); ++i) {
    const size_t index = next_camera(frames, where);
    const SearchCamera& camera = frames.search_cameras()[index];
    const Eigen::Vector3d there = camera.camera_from_world * place;
    const CameraModel& lens = camera.camera->model;
    const auto pixel = lens.project(there);
    if (!pixel || !lens.contains(*pixel)) continue;
    const double seconds = std::abs(to_seconds(frames.info(index).capture - time));
    const double reach = kOtherPlace * bank_.model().radius() / 2 + kAgainSpeed * seconds;
    return ImagePlace{index, *pixel, reach * lens.parameters().fx / there.norm()};
  }
  return std::nullopt;
}

ScanResult PoseScan::scan(const DetectorFrames& frames, size_t camera, DetectorFrames::Where where,
                          const MeshColors* colors) const {
  ScanResult out;
  out.camera = camera;
  out.range.max = max_hits_ / hits_divisor(where);
  if (!frames.mask(camera).empty()) {
    const EdgeImage& edges = frames.edges(camera);
    const float scale = distances_.cameras[frames.camera_index(camera)].scales.front();
    const auto reach = static_cast<int>(0.5 * bank_.model().radius() * static_cast<double>(scale));
    out.range.rows = columns_near(frames.mask(camera), edges.width(), edges.height(), reach);
  }
  const Eigen::AlignedBox2d& image = distances_.cameras[frames.camera_index(camera)].image;
  if (!image.isEmpty()) {
    const EdgeImage& edges = frames.edges(camera);
    out.range.rows =
        columns_within(std::move(out.range.rows), image, frames.search_cameras()[camera].shrink,
                       edges.width() / 2, edges.height() / 2);
  }
  scan_range(frames, colors, out);
  return out;
}

ScanResult PoseScan::scan_about(const DetectorFrames& frames, const ImagePlace& place) const {
  ScanResult out;
  out.camera = place.camera;
  out.range.max = max_hits_ / kFocusedHitsDivisor;
  const SearchCamera& search = frames.search_cameras()[place.camera];
  const EdgeImage& edges = frames.edges(place.camera);
  out.range.rows =
      columns_about((place.pixel.array() + 0.5).matrix() / search.shrink,
                    place.radius_px / search.shrink, edges.width() / 2, edges.height() / 2);
  scan_range(frames, nullptr, out);
  return out;
}

std::vector<DetectionTrace::Candidate> PoseScan::poses(const DetectorFrames& frames,
                                                       const ScanResult& hits) const {
  const SearchCamera& camera = frames.search_cameras()[hits.camera];
  const Rigid3 world_from_camera = camera.camera_from_world.inverse();
  std::vector<DetectionTrace::Candidate> out;
  for (const ScanHit& hit : hits.hits) {
    const auto pose =
        bank_.full_pose(camera.camera->model, template_pose(hit, hits.range), camera.shrink);
    if (pose) out.push_back({world_from_camera * *pose, static_cast<double>(hit.score)});
  }
  return out;
}

void PoseScan::scan_range(const DetectorFrames& frames, const MeshColors* colors,
                          ScanResult& out) const {
  const std::vector<float>& scales = distances_.cameras[frames.camera_index(out.camera)].scales;
  const double radius = bank_.model().radius();
  // Each distance gets as many hits as any other, and maps spread for its scale.
  const SearchCamera& search = frames.search_cameras()[out.camera];
  std::vector<std::vector<ScanHit>> hits(scales.size());
  executor_(scales.size(), [&](size_t i) {
    ScanRange one = out.range;
    one.max /= scales.size();
    one.scales = {scales[i]};
    const size_t max = one.max;
    if (colors != nullptr) one.max *= kColoredHits;
    hits[i] = observe::scan(bank_, search.far(static_cast<double>(scales[i]), radius), one);
    if (colors != nullptr) keep_best(hits[i], one, *colors, out.camera, max);
    for (ScanHit& hit : hits[i]) hit.scale = static_cast<uint16_t>(i);
  });
  for (const auto& some : hits) out.hits.insert(out.hits.end(), some.begin(), some.end());
  out.range.scales = scales;
}

std::vector<std::array<int, 2>> columns_about(const Eigen::Vector2d& place, double radius,
                                              int width, int height) {
  // Half a row more than the rows that are scanned are apart, so that there is one.
  const double reach = std::max(radius, kScanRowStep + 0.5);
  std::vector<std::array<int, 2>> rows(static_cast<size_t>(height), {0, 0});
  for (int y = 0; y < height; ++y) {
    const double away = y + 0.5 - place.y();
    if (std::abs(away) > reach) continue;
    const double half = std::sqrt(reach * reach - away * away);
    rows[static_cast<size_t>(y)] = {
        std::clamp(static_cast<int>(std::floor(place.x() - half)), 0, width),
        std::clamp(static_cast<int>(std::ceil(place.x() + half)), 0, width)};
  }
  return rows;
}

std::vector<std::array<int, 2>> columns_within(std::vector<std::array<int, 2>> rows,
                                               const Eigen::AlignedBox2d& image, double shrink,
                                               int width, int height) {
  if (rows.empty()) rows.assign(static_cast<size_t>(height), {0, width});
  const auto cell = [&](double pixel, int end) {
    return static_cast<int>(std::clamp(pixel / shrink, 0.0, static_cast<double>(end)));
  };
  const int left = cell(image.min().x(), width), right = cell(image.max().x() + shrink, width);
  const int top = cell(image.min().y(), height), bottom = cell(image.max().y() + shrink, height);
  for (int y = 0; y < height; ++y) {
    auto& row = rows[static_cast<size_t>(y)];
    row = {std::max(row[0], left), std::min(row[1], right)};
    // Every second row is scanned: one more on either side.
    if (y + kScanRowStep < top || y >= bottom + kScanRowStep) row[1] = row[0];
  }
  return rows;
}

std::vector<std::array<int, 2>> columns_near(const std::vector<uint8_t>& mask, int width,
                                             int height, int reach) {
  std::vector<std::array<int, 2>> rows(static_cast<size_t>(height / 2), {width / 2, 0});
  for (int y = 0; y + 1 < height; ++y) {
    const auto row = mask.begin() + static_cast<ptrdiff_t>(y) * width;
    const auto first = std::find(row, row + width, 1);
    if (first == row + width) continue;
    const auto last =
        std::find(std::make_reverse_iterator(row + width), std::make_reverse_iterator(row), 1);
    const int left = static_cast<int>(first - row) / 2 - reach;
    const int right = static_cast<int>(last.base() - row) / 2 + reach + 1;
    for (int v = std::max(0, y / 2 - reach); v <= std::min(height / 2 - 1, y / 2 + reach); ++v) {
      auto& to = rows[static_cast<size_t>(v)];
      to = {std::max(0, std::min(to[0], left)), std::min(width / 2, std::max(to[1], right))};
    }
  }
  return rows;
}

}  // namespace sightline::observe
