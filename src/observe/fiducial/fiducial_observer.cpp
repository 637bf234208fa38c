// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/fiducial/fiducial_observer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "observe/fiducial/apriltag_detector.hpp"
#include "observe/fiducial/aruco_detector.hpp"
#include "observe/fiducial/code_search.hpp"
#include "observe/fiducial/edge_refine.hpp"
#include "observe/fiducial/fiducial_measurement.hpp"
#include "observe/fiducial/fiducial_object.hpp"
#include "observe/fiducial/search_region.hpp"
#include "observe/terms/opencv_threads.hpp"
#include "sightline/observe/terms/observation_header.hpp"

namespace sightline {
namespace {

using namespace observe;

/// Clockwise in the image (y down) and convex: a print seen from its front.
bool convex_clockwise(const std::array<Eigen::Vector2d, 4>& c) {
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d a = c[(k + 1) % 4] - c[k];
    const Eigen::Vector2d b = c[(k + 2) % 4] - c[(k + 1) % 4];
    if (a.x() * b.y() - a.y() * b.x() <= 0) return false;
  }
  return true;
}

Eigen::Vector2d center_of(const std::array<Eigen::Vector2d, 4>& c) {
  return (c[0] + c[1] + c[2] + c[3]) / 4;
}

}  // namespace

class FiducialObserver::Impl {
 public:
  Impl(const CalibratedCamera& camera, CameraId id, const FiducialOptions& options)
      : camera_(std::make_shared<const CalibratedCamera>(camera)),
        id_(id),
        options_(options),
        light_(options.gamma, kRefineWhite) {}

  Status add_objects(std::vector<ObservedObject> objects);
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);

  std::vector<ObjectId> ids_;
  Counters counters_;

 private:
  void expect_objects(const Frame& frame, std::span<const PoseTrackPtr> tracks);
  void run(CodeSearch& search, const Frame& frame);
  bool run_expected(CodeSearch& search, const Frame& frame);
  std::vector<Region> regions_of(const CodeSearch& search) const;
  void run_region(CodeSearch& search, const Frame& frame, const Region& region, double scale);
  double scale_for(const CodeSearch& search) const;
  void accept(const CodeSearch& search, const Frame& frame, const SquareDetection& detection);
  void accept_fiducial(FiducialObject& object, int fiducial, const SquareDetector::Border& border,
                       const Frame& frame, const SquareDetection& detection);
  bool nearer_to_expected(const FiducialObject& object, size_t square,
                          const std::array<Eigen::Vector2d, 4>& candidate,
                          const std::array<Eigen::Vector2d, 4>& current) const;

  std::shared_ptr<const CalibratedCamera> camera_;
  CameraId id_;
  FiducialOptions options_;
  LightTable light_;
  std::vector<FiducialObject> objects_;
  std::vector<CodeSearch> searches_;
  std::vector<SquareDetection> detections_;
};

Status FiducialObserver::Impl::add_objects(std::vector<ObservedObject> objects) {
  for (ObservedObject& observed : objects) {
    SL_ASSIGN(FiducialObject object, make_fiducial_object(std::move(observed), camera_));
    if (object.squares.empty()) continue;
    ids_.push_back(object.id);
    objects_.push_back(std::move(object));
  }
  SL_ASSIGN(searches_, make_code_searches(objects_, options_, camera_->name));
  return {};
}

void FiducialObserver::Impl::expect_objects(const Frame& frame,
                                            std::span<const PoseTrackPtr> tracks) {
  for (FiducialObject& object : objects_) {
    const auto track = std::find_if(tracks.begin(), tracks.end(), [&](const PoseTrackPtr& t) {
      return t != nullptr && t->object() == object.id;
    });
    object.expected = expect(track == tracks.end() ? nullptr : track->get(), frame.info().capture,
                             *camera_, object.squares, options_);
    object.fiducials.clear();
    object.board_markers.clear();
  }
}

/// Full size where the markers expected would be too small at the usual scale.
double FiducialObserver::Impl::scale_for(const CodeSearch& search) const {
  const double enough = search.detector->min_side_px();
  for (size_t i : search.objects) {
    const auto& expected = objects_[i].expected;
    if (!expected || expected->smallest_side_px <= 0) continue;
    if (expected->smallest_side_px * options_.search_scale < enough) return 1.0;
  }
  return options_.search_scale;
}

void FiducialObserver::Impl::run_region(CodeSearch& search, const Frame& frame,
                                        const Region& region, double scale) {
  detections_.clear();
  search.detector->detect(frame, region, scale, detections_);
  for (const SquareDetection& detection : detections_) accept(search, frame, detection);
}

/// Where the objects of a search are expected, overlapping regions united.
std::vector<Region> FiducialObserver::Impl::regions_of(const CodeSearch& search) const {
  std::vector<Region> regions;
  for (size_t i : search.objects) {
    Region region = objects_[i].expected->region;
    if (region.empty()) continue;
    for (auto at = regions.begin(); at != regions.end();) {
      if (!at->overlaps(region)) {
        ++at;
        continue;
      }
      region = at->united(region);
      regions.erase(at);
      at = regions.begin();
    }
    regions.push_back(region);
  }
  return regions;
}

/// Searches where the objects should be; true if the whole image has to be searched as well.
bool FiducialObserver::Impl::run_expected(CodeSearch& search, const Frame& frame) {
  const auto unseen = [&](size_t i) { return !objects_[i].seen(); };
  const auto facing = [&](size_t i) { return objects_[i].expected->smallest_side_px > 0; };
  const double scale = scale_for(search);
  for (const Region& region : regions_of(search)) {
    run_region(search, frame, region, scale);
    ++counters_.region_searches;
  }
  const bool again = scale < 1 && std::any_of(search.objects.begin(), search.objects.end(),
                                              [&](size_t i) { return unseen(i) && facing(i); });
  if (again) {
    for (const Region& region : regions_of(search)) run_region(search, frame, region, 1.0);
  }
  return std::any_of(search.objects.begin(), search.objects.end(), [&](size_t i) {
    const bool due = objects_[i].since_full_search >= options_.full_search_interval;
    return unseen(i) && (due || !objects_[i].expected->confident);
  });
}

void FiducialObserver::Impl::run(CodeSearch& search, const Frame& frame) {
  for (size_t i : search.objects) ++objects_[i].since_full_search;
  const bool all_expected = std::all_of(search.objects.begin(), search.objects.end(),
                                        [&](size_t i) { return objects_[i].expected.has_value(); });
  if (all_expected && !run_expected(search, frame)) return;
  const bool thorough =
      search.missed % options_.thorough_interval == options_.thorough_interval - 1;
  run_region(search, frame, whole_image(camera_->model), thorough ? 1.0 : options_.search_scale);
  ++counters_.full_searches;
  bool missed = false;
  for (size_t i : search.objects) {
    objects_[i].since_full_search = 0;
    missed = missed || !objects_[i].seen();
  }
  search.missed = missed ? search.missed + 1 : 0;
}

bool FiducialObserver::Impl::nearer_to_expected(
    const FiducialObject& object, size_t square, const std::array<Eigen::Vector2d, 4>& candidate,
    const std::array<Eigen::Vector2d, 4>& current) const {
  if (object.expected) {
    const SquareInObject& points = object.squares[square];
    const Eigen::Vector3d middle = (points[0] + points[1] + points[2] + points[3]) / 4;
    const auto pixel = camera_->model.project(camera_->world_from_camera.inverse() *
                                              (object.expected->world_from_object * middle));
    if (pixel) return (center_of(candidate) - *pixel).norm() < (center_of(current) - *pixel).norm();
  }
  return shortest_side(candidate) > shortest_side(current);
}

void FiducialObserver::Impl::accept(const CodeSearch& search, const Frame& frame,
                                    const SquareDetection& detection) {
  const CodeOwner& owner = search.owners[static_cast<size_t>(detection.code)];
  FiducialObject& object = objects_[owner.object];
  bool good = convex_clockwise(detection.corners) &&
              shortest_side(detection.corners) >= options_.min_side_px;
  for (const Eigen::Vector2d& corner : detection.corners) {
    good = good && corner.allFinite() && camera_->model.unproject(corner).has_value();
  }
  if (!good) {
    ++counters_.refused;
    return;
  }
  if (owner.fiducial >= 0) {
    accept_fiducial(object, owner.fiducial, search.detector->border(detection.code), frame,
                    detection);
    return;
  }
  SquareDetection marker = detection;
  marker.code = owner.board_id;
  const auto same = std::find_if(object.board_markers.begin(), object.board_markers.end(),
                                 [&](const auto& m) { return m.code == marker.code; });
  if (same == object.board_markers.end()) {
    object.board_markers.push_back(marker);
    return;
  }
  const size_t square = object.description.fiducials.size() + static_cast<size_t>(marker.code);
  if (nearer_to_expected(object, square, marker.corners, same->corners)) *same = marker;
}

void FiducialObserver::Impl::accept_fiducial(FiducialObject& object, int fiducial,
                                             const SquareDetector::Border& border,
                                             const Frame& frame, const SquareDetection& detection) {
  // Where the edges cannot be followed the library's own corners are kept, for what they are worth.
  constexpr double kUnrefinedSigmaPx = 0.6;
  SeenFiducial seen{fiducial, detection.corners, kUnrefinedSigmaPx};
  if (const auto refined =
          refine_square(frame.gray(), light_, camera_->model, detection.corners, border)) {
    seen.corners = refined->corners;
    seen.sigma_px = std::hypot(options_.tag_sigma_px, refined->scatter_px);
  }
  const auto same = std::find_if(object.fiducials.begin(), object.fiducials.end(),
                                 [&](const auto& f) { return f.fiducial == fiducial; });
  if (same == object.fiducials.end()) {
    object.fiducials.push_back(seen);
  } else if (nearer_to_expected(object, static_cast<size_t>(fiducial), seen.corners,
                                same->corners)) {
    *same = seen;
  }
}

void FiducialObserver::Impl::step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                                  std::vector<Observation>& out) {
  const FrameInfo& info = frame.info();
  if (info.status != FrameStatus::kGood || info.width != camera_->model.width() ||
      info.height != camera_->model.height()) {
    return;
  }
  ++counters_.frames;
  expect_objects(frame, tracks);
  for (CodeSearch& search : searches_) run(search, frame);
  for (FiducialObject& object : objects_) {
    Observation observation = make_observation(info, id_, object.id);
    const FiducialCounts counts =
        measure_fiducials(object, frame.gray(), camera_, options_, observation);
    counters_.fiducials += counts.accepted;
    counters_.refused += counts.refused;
    out.push_back(std::move(observation));
  }
}

Result<std::unique_ptr<FiducialObserver>> FiducialObserver::create(
    const CalibratedCamera& camera, CameraId id, std::vector<ObservedObject> objects,
    const FiducialOptions& options) {
  observe::keep_opencv_in_one_thread();
  auto impl = std::make_unique<Impl>(camera, id, options);
  SL_RETURN_IF_ERROR(impl->add_objects(std::move(objects)));
  return std::unique_ptr<FiducialObserver>(new FiducialObserver(std::move(impl)));
}

FiducialObserver::FiducialObserver(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FiducialObserver::~FiducialObserver() = default;
std::span<const ObjectId> FiducialObserver::objects() const { return impl_->ids_; }
const FiducialObserver::Counters& FiducialObserver::counters() const { return impl_->counters_; }
void FiducialObserver::step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
                            std::vector<Observation>& out) {
  impl_->step(frame, tracks, out);
}

std::vector<std::string> known_fiducial_families() {
  std::vector<std::string> names = apriltag_families();
  for (const std::string& d : aruco_dictionaries()) names.push_back(aruco_family_of_dictionary(d));
  return names;
}

std::vector<std::string> known_board_dictionaries() { return aruco_dictionaries(); }

}  // namespace sightline
