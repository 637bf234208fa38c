// SPDX-License-Identifier: Apache-2.0
#include "observe/track/contour_lines.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "observe/track/line_posterior.hpp"
#include "observe/track/track_constants.hpp"

namespace sightline::observe {

using namespace tuning;

namespace {

constexpr double kSeenAlong = 0.2;  // of a meter beside it: seen end-on, a tangent has no direction
constexpr int kOffsets = 16;        // tried per line: -7.5 .. 7.5 segments
constexpr int kSegments = LineSamples::kSegments;
constexpr int kPhases = 8;  // of a sample between two offsets

// Factors 1 - 2 T(r - d) w need 2 T for every sample position and offset. Row `phase`, column q
// holds 2 T((phase + 0.5) / kPhases + q_max - q), so that the offsets of one sample are contiguous.
class StepTable {
 public:
  static constexpr int kReach = kSegments / 2 + kOffsets;
  static constexpr int kRow = 2 * kReach + 1;
  StepTable() {
    for (int phase = 0; phase < kPhases; ++phase) {
      for (int q = 0; q < kRow; ++q) {
        const double x = (phase + 0.5) / kPhases + kReach - q;
        values_[static_cast<size_t>(phase * kRow + q)] =
            static_cast<float>(2 * kStepAmplitude * std::tanh(x / (2 * kStepSlope)));
      }
    }
  }
  // For a sample at r segments: entry j belongs to offset j - 7.5.
  const float* row(float r) const {
    const float u = r + 0.5f * (kOffsets - 1);
    const float whole = std::floor(u);
    const int phase = std::min(kPhases - 1, static_cast<int>((u - whole) * kPhases));
    const int at = std::clamp(kReach - static_cast<int>(whole), 0, kRow - kOffsets);
    return &values_[static_cast<size_t>(phase * kRow + at)];
  }

 private:
  std::array<float, static_cast<size_t>(kPhases* kRow)> values_{};
};

const StepTable& step_table() {
  static const StepTable table;
  return table;
}

void posterior(const LineSamples& samples, ContourLine& line, int scale) {
  const StepTable& table = step_table();
  std::array<float, kOffsets> p;
  p.fill(1.0f);
  for (int i = 0; i < samples.count; ++i) {
    const float* step = table.row(samples.position[static_cast<size_t>(i)]);
    const float w = samples.evidence[static_cast<size_t>(i)];
    for (size_t j = 0; j < kOffsets; ++j) p[j] *= 1.0f - step[j] * w;
  }
  float sum = 0, first = 0, second = 0;
  for (size_t j = 0; j < kOffsets; ++j) {
    const float d = static_cast<float>(j) - 0.5f * (kOffsets - 1);
    sum += p[j];
    first += p[j] * d;
    second += p[j] * d * d;
  }
  if (!(sum > 0)) return;
  const float mean = first / sum;
  const float variance = std::max(0.0f, second / sum - mean * mean) + 1.0f / 12.0f;
  line.mean = static_cast<double>(mean) * scale;
  line.variance = static_cast<double>(variance) * scale * scale;
  line.measured = true;
}

void evidence_beside(const LineSamples& samples, ContourLine& line) {
  float inside = 0, outside = 0, in_level = 0, out_level = 0;
  int inner = 0, outer = 0;
  for (size_t i = 0; i < static_cast<size_t>(samples.count); ++i) {
    const float r = samples.position[i];
    if (std::abs(r) < static_cast<float>(kEvidenceGap) ||
        std::abs(r) > static_cast<float>(kEvidenceReach)) {
      continue;
    }
    if (r < 0) {
      inside += samples.evidence[i];
      in_level += samples.level[i];
      ++inner;
    } else {
      outside += samples.evidence[i];
      out_level += samples.level[i];
      ++outer;
    }
  }
  line.inside_evidence = inner > 0 ? inside / static_cast<float>(inner) : 0.0f;
  line.outside_evidence = outer > 0 ? outside / static_cast<float>(outer) : 0.0f;
  line.inside_level = inner > 0 ? in_level / static_cast<float>(inner) : 0.0f;
  line.outside_level = outer > 0 ? out_level / static_cast<float>(outer) : 0.0f;
}

bool inside_image(const CameraModel& camera, const Eigen::Vector2d& pixel, double margin) {
  return pixel.x() >= margin && pixel.y() >= margin && pixel.x() <= camera.width() - 1 - margin &&
         pixel.y() <= camera.height() - 1 - margin;
}

}  // namespace

bool Occluders::hide(const Eigen::Vector2d& pixel, const Eigen::Vector3d& point_in_camera) const {
  if (scene.width > 0) {
    const double limit = (1 + kFrontTolerance) / point_in_camera.z();
    for (const double dx : {-kOccluderMarginPx, 0.0, kOccluderMarginPx}) {
      for (const double dy : {-kOccluderMarginPx, 0.0, kOccluderMarginPx}) {
        const int x = static_cast<int>(std::lround(pixel.x() + dx));
        const int y = static_cast<int>(std::lround(pixel.y() + dy));
        if (static_cast<double>(scene.at(x, y)) > limit) return true;
      }
    }
  }
  const double range = point_in_camera.norm();
  for (const OccludingSphere& sphere : spheres) {
    const double distance = sphere.center_in_camera.norm();
    if (distance - sphere.radius > range || distance <= sphere.radius) continue;
    const double cosine = sphere.center_in_camera.dot(point_in_camera) / (distance * range);
    if (std::acos(std::clamp(cosine, -1.0, 1.0)) < std::asin(sphere.radius / distance)) return true;
  }
  return false;
}

double Occluders::free_way(const ContourLine& line, double range, int sign, double reach_px) const {
  if (scene.width <= 0) return reach_px;
  constexpr double kStep = 3, kFarthest = 24;  // [px]
  const double limit = (1 + kFrontTolerance) / range;
  for (double r = kStep; r < std::min(reach_px, kFarthest) + kStep; r += kStep) {
    const Eigen::Vector2d at = line.center + sign * r * line.normal;
    const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
    if (static_cast<double>(scene.at(x, y)) > limit) return std::min(reach_px, r - kStep);
  }
  return reach_px;
}

// Turns a normal (unit) until it is perpendicular to a direction along the outline.
void turn_across(const Eigen::Vector2d& along, Eigen::Vector2d& normal) {
  const Eigen::Vector2d across = Eigen::Vector2d(-along.y(), along.x()).normalized();
  normal = across.dot(normal) < 0 ? Eigen::Vector2d(-across) : across;
}

// Of a surface of revolution only what a turn does not move: body points of it would seem to
// measure turns that nobody can see.
void place_lines(const View& view, const CameraModel& camera, const Rigid3& camera_from_object,
                 const Occluders& occluders, double margin_px, const RevolvedSurface* revolved,
                 std::vector<ContourLine>& out) {
  const LineProjector projector(camera, camera_from_object);
  const Eigen::Vector3d camera_in_object = camera_from_object.inverse().translation;
  out.clear();
  for (const ContourSample& sample : view.contour) {
    const Eigen::Vector3d normal = sample.normal.cast<double>();
    const Eigen::Vector3d sampled = sample.point.cast<double>();
    const bool turns = revolved != nullptr && revolved->contains(sampled);
    const auto limb = turns && sample.crease == 0
                          ? revolved->limb(sampled, limb_normal(view, sample), camera_in_object)
                          : std::nullopt;
    const Eigen::Vector3d point = limb ? limb->point : sampled;
    const Eigen::Vector3d in_camera = projector.in_camera(point);
    Eigen::Matrix<double, 2, 3> pixel_by_point;
    const auto pixel = camera.project(in_camera, &pixel_by_point);
    if (!pixel || !inside_image(camera, *pixel, margin_px)) continue;
    const Eigen::Vector2d across = pixel_by_point * (projector.rotation() * normal);
    const double px_per_meter = across.norm();
    if (!(px_per_meter > 1e-9) || occluders.hide(*pixel, in_camera)) continue;
    ContourLine& line = out.emplace_back();
    line.point_in_object = point;
    line.center = *pixel;
    line.normal = across / px_per_meter;
    if (turns && (limb || sample.crease != 0)) {
      const Eigen::Vector3d tangent = revolved->tangent(point);
      Eigen::Vector2d along = pixel_by_point * (projector.rotation() * tangent);
      if (limb) {
        const Eigen::Vector2d other =
            pixel_by_point * (projector.rotation() * limb->normal.cross(tangent));
        if (other.squaredNorm() > along.squaredNorm()) along = other;
      }
      if (along.norm() > kSeenAlong * px_per_meter) turn_across(along, line.normal);
    }
    line.by_pose = projector.derivative(point, line.normal, pixel_by_point);
    line.crease = sample.crease != 0;
    line.inside_px = occluders.free_way(line, in_camera.z(), -1,
                                        static_cast<double>(sample.foreground) * px_per_meter);
    line.outside_px = occluders.free_way(line, in_camera.z(), 1,
                                         static_cast<double>(sample.background) * px_per_meter);
  }
}

void finish_line(const LineSamples& samples, int scale, ContourLine& line) {
  posterior(samples, line, scale);
  evidence_beside(samples, line);
}

void measure_lines(const ColorReader& frame, const ColorHistograms& colors, int scale,
                   std::span<ContourLine> lines) {
  const float* const evidence = colors.evidence();
  for (ContourLine& line : lines) {
    measure_line(frame, scale, line, [&](int x, int y) { return evidence[frame.bin(x, y)]; });
  }
}

void correct_for_gamma(double gamma, double blur_px, std::span<ContourLine> lines) {
  constexpr double kBlack = 16, kRange = 219, kDarkest = 0.02;
  const auto light = [&](float level) {
    return std::clamp((static_cast<double>(level) - kBlack) / kRange, kDarkest, 1.0);
  };
  for (ContourLine& line : lines) {
    if (!line.measured || line.inside_level <= 0 || line.outside_level <= 0) continue;
    const double in = light(line.inside_level), out = light(line.outside_level);
    if (std::abs(in - out) < 0.02) continue;
    const double a = std::pow(in, gamma), b = std::pow(out, gamma);
    const double share = (std::pow(0.5 * (in + out), gamma) - b) / (a - b);
    // Phi^-1 near a half; the outline was found where the light's share is `share`, that is
    // outwards of the middle if it is below a half.
    const double off = 2.5066 * (0.5 - share);
    line.mean -= blur_px * off;
  }
}

void collect_colors(const ColorReader& frame, std::span<const ContourLine> lines, double gap_px,
                    double reach_px, std::vector<uint16_t>& foreground,
                    std::vector<uint16_t>& background) {
  foreground.clear();
  background.clear();
  for (const ContourLine& line : lines) {
    const auto read = [&](double r, std::vector<uint16_t>& to) {
      const int x = static_cast<int>(std::lround(line.center.x() + r * line.normal.x()));
      const int y = static_cast<int>(std::lround(line.center.y() + r * line.normal.y()));
      if (x < 0 || y < 0 || x >= frame.width() || y >= frame.height()) return;
      to.push_back(frame.bin(x, y));
    };
    // Half of the free way belongs to this side of the silhouette beyond doubt: the pose may be
    // off.
    for (double r = gap_px; r < std::min(reach_px, line.inside_px - gap_px); ++r) {
      read(-r, foreground);
    }
    for (double r = gap_px; r < std::min(reach_px, line.outside_px - gap_px); ++r) {
      read(r, background);
    }
  }
}

}  // namespace sightline::observe
