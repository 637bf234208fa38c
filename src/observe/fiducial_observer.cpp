// SPDX-License-Identifier: Apache-2.0
#include "sightline/observe/fiducial_observer.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <utility>

#include "apriltag_detector.hpp"
#include "aruco_detector.hpp"
#include "board_corners.hpp"
#include "edge_refine.hpp"
#include "plane_pose.hpp"
#include "search_region.hpp"
#include "sightline/observe/corner_term.hpp"
#include "square_detector.hpp"

namespace sightline {
namespace {

using namespace observe;

/// Corners of a fiducial in its own frame (x right, y up), top-left first, clockwise.
std::array<Eigen::Vector2d, 4> square_corners(double size) {
  const double h = size / 2;
  return {Eigen::Vector2d(-h, h), Eigen::Vector2d(h, h), Eigen::Vector2d(h, -h),
          Eigen::Vector2d(-h, -h)};
}

/// Whose marker a detector's code is.
struct CodeOwner {
  size_t object = 0;
  int fiducial = -1;  ///< index of a single marker; -1: of the board
  int board_id = -1;
};

/// One detector and the codes it looks for.
struct Search {
  std::unique_ptr<SquareDetector> detector;
  std::vector<CodeOwner> owners;  ///< by code
  std::vector<size_t> objects;    ///< sorted, unique
  int missed = 0;                 ///< searches of the whole picture that missed an object
};

struct SeenFiducial {
  int fiducial = 0;
  std::array<Eigen::Vector2d, 4> corners;
  double sigma_px = 0;
};

/// One object and what the frame at hand shows of it.
struct ObjectState {
  ObjectId id;
  ObjectDescription description;
  std::vector<SquareInObject> squares;
  std::unique_ptr<BoardFinder> board;
  int since_full_search = 0;

  std::optional<Expectation> expected;
  std::vector<SeenFiducial> fiducials;
  std::vector<SquareDetection> board_markers;  ///< code = marker id
  bool seen() const { return !fiducials.empty() || !board_markers.empty(); }
};

/// Clockwise in the picture (y down) and convex: a print seen from its front.
bool convex_clockwise(const std::array<Eigen::Vector2d, 4>& c) {
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d a = c[(k + 1) % 4] - c[k];
    const Eigen::Vector2d b = c[(k + 2) % 4] - c[(k + 1) % 4];
    if (a.x() * b.y() - a.y() * b.x() <= 0) return false;
  }
  return true;
}

Eigen::Vector2d centre(const std::array<Eigen::Vector2d, 4>& c) {
  return (c[0] + c[1] + c[2] + c[3]) / 4;
}

}  // namespace

class FiducialObserver::Impl {
 public:
  Impl(const CalibratedCamera& camera, CameraId id, const FiducialOptions& options)
      : camera_(std::make_shared<const CalibratedCamera>(camera)),
        id_(id),
        options_(options),
        light_(light_table(options.gamma)) {}

  Status add_object(ObservedObject object);
  Status make_searches();
  void step(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::vector<Observation>& out);

  std::vector<ObjectId> ids_;
  Counters counters_;

 private:
  using Owners = std::map<std::pair<std::string, int>, CodeOwner>;
  Status own(Owners& owners, const std::string& family, int id, CodeOwner owner) const;
  void expect_objects(const Frame& frame, std::span<const PoseTrackPtr> tracks);
  void run(Search& search, const Frame& frame);
  bool run_expected(Search& search, const Frame& frame);
  std::vector<Region> regions_of(const Search& search) const;
  void run_region(Search& search, const Frame& frame, const Region& region, double scale);
  double scale_for(const Search& search) const;
  void accept(const Search& search, const Frame& frame, const SquareDetection& detection);
  void accept_fiducial(ObjectState& object, int fiducial, const SquareDetector::Border& border,
                       const Frame& frame, const SquareDetection& detection);
  bool nearer_to_expected(const ObjectState& object, size_t square,
                          const std::array<Eigen::Vector2d, 4>& candidate,
                          const std::array<Eigen::Vector2d, 4>& current) const;
  void measure(ObjectState& object, const Frame& frame, Observation& out);
  void drop_contradicting(const ObjectState& object, std::vector<SeenFiducial>& fiducials) const;
  PlanarView view_of(const ObjectState& object, const SeenFiducial& seen) const;
  void add_matches(const PlanarView& view, double sigma_px, std::vector<PointMatch>& out) const;
  double with_calibration(double sigma_px) const {
    return std::hypot(sigma_px, options_.calibration_share * camera_->rms_px);
  }

  std::shared_ptr<const CalibratedCamera> camera_;
  CameraId id_;
  FiducialOptions options_;
  LightTable light_;
  std::vector<ObjectState> objects_;
  std::vector<Search> searches_;
  std::vector<SquareDetection> detections_;
};

// ---- set-up ------------------------------------------------------------------------------------

Status FiducialObserver::Impl::add_object(ObservedObject object) {
  ObjectState state;
  state.id = object.id;
  state.description = std::move(object.description);
  const ObjectDescription& d = state.description;
  const std::string where = d.file.empty() ? d.name : d.file.string();
  for (const Fiducial& f : d.fiducials) {
    if (!(f.size > 0) || !std::isfinite(f.size)) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "fiducial {} {}: size must be positive [m], not {}", f.family, f.id,
                        f.size);
    }
    SquareInObject square;
    const auto corners = square_corners(f.size);
    for (size_t k = 0; k < 4; ++k) {
      square[k] = f.object_from_fiducial * Eigen::Vector3d(corners[k].x(), corners[k].y(), 0);
    }
    state.squares.push_back(square);
  }
  if (d.board) {
    const CharucoBoard& b = *d.board;
    if (b.columns < 2 || b.rows < 2 || b.columns > 100 || b.rows > 100) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "board of {} x {} squares: 2 x 2 to 100 x 100 are possible", b.columns,
                        b.rows);
    }
    if (!(b.marker > 0) || !(b.square > b.marker) || !std::isfinite(b.square)) {
      return make_error(ErrorCode::kInvalidInput, where,
                        "board with square {} m and marker {} m: the marker must be positive and "
                        "smaller than the square",
                        b.square, b.marker);
    }
    state.board = std::make_unique<BoardFinder>(b, camera_);
    // Its squares, for the region and the size of its markers.
    const BoardLayout layout(b, false);
    for (int id = 0; id < layout.markers(); ++id) {
      SquareInObject square;
      for (size_t k = 0; k < 4; ++k) square[k] << layout.marker(id)[k], 0;
      state.squares.push_back(square);
    }
  }
  if (state.squares.empty()) return {};
  ids_.push_back(state.id);
  objects_.push_back(std::move(state));
  return {};
}

Status FiducialObserver::Impl::own(Owners& owners, const std::string& family, int id,
                                   CodeOwner owner) const {
  const auto [at, fresh] = owners.emplace(std::pair(family, id), owner);
  if (fresh) return {};
  return make_error(ErrorCode::kInvalidInput, objects_[owner.object].description.name,
                    "{} id {} is also on object '{}': every marker may stand once in an "
                    "installation; print another id",
                    family, id, objects_[at->second.object].description.name);
}

Status FiducialObserver::Impl::make_searches() {
  Owners apriltags;
  std::map<std::pair<std::string, bool>, Owners> arucos;  // by dictionary and inverted
  for (size_t i = 0; i < objects_.size(); ++i) {
    const ObjectDescription& d = objects_[i].description;
    for (size_t f = 0; f < d.fiducials.size(); ++f) {
      const Fiducial& fiducial = d.fiducials[f];
      const CodeOwner owner{i, static_cast<int>(f), -1};
      const std::string dictionary = aruco_dictionary_of_family(fiducial.family);
      if (is_apriltag_family(fiducial.family)) {
        SL_RETURN_IF_ERROR(own(apriltags, fiducial.family, fiducial.id, owner));
      } else if (!dictionary.empty()) {
        SL_RETURN_IF_ERROR(own(arucos[{dictionary, false}], fiducial.family, fiducial.id, owner));
      } else {
        return make_error(ErrorCode::kInvalidInput, d.file.empty() ? d.name : d.file.string(),
                          "fiducial family '{}' is not known; known are {}", fiducial.family,
                          fmt::join(known_fiducial_families(), ", "));
      }
    }
    if (!d.board) continue;
    if (!is_aruco_dictionary(d.board->dictionary)) {
      return make_error(ErrorCode::kInvalidInput, d.file.empty() ? d.name : d.file.string(),
                        "board dictionary '{}' is not known; known are {}", d.board->dictionary,
                        fmt::join(known_board_dictionaries(), ", "));
    }
    Owners& owners = arucos[{d.board->dictionary, d.board->inverted}];
    const int markers = (d.board->columns * d.board->rows + 1) / 2;
    const std::string family = aruco_family_of_dictionary(d.board->dictionary);
    for (int id = 0; id < markers; ++id) {
      SL_RETURN_IF_ERROR(own(owners, family, id, {i, -1, id}));
    }
  }
  const auto add = [&](const Owners& owners, auto&& make) -> Status {
    std::vector<SquareCode> codes;
    Search search;
    for (const auto& [code, owner] : owners) {
      codes.push_back({code.first, code.second});
      search.owners.push_back(owner);
      search.objects.push_back(owner.object);
    }
    std::sort(search.objects.begin(), search.objects.end());
    search.objects.erase(std::unique(search.objects.begin(), search.objects.end()),
                         search.objects.end());
    SL_ASSIGN(search.detector, make(codes));
    searches_.push_back(std::move(search));
    return {};
  };
  if (!apriltags.empty()) {
    SL_RETURN_IF_ERROR(add(apriltags, [&](const std::vector<SquareCode>& codes) {
      return make_apriltag_detector(
          codes, {options_.threads, options_.max_hamming, options_.min_decision_margin},
          camera_->name);
    }));
  }
  for (const auto& entry : arucos) {
    const auto& key = entry.first;  // clang 14 captures no structured bindings
    SL_RETURN_IF_ERROR(add(entry.second, [&](const std::vector<SquareCode>& codes) {
      return make_aruco_detector(codes, key.first, key.second, camera_->name);
    }));
  }
  return {};
}

// ---- search ------------------------------------------------------------------------------------

void FiducialObserver::Impl::expect_objects(const Frame& frame,
                                            std::span<const PoseTrackPtr> tracks) {
  for (ObjectState& object : objects_) {
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
double FiducialObserver::Impl::scale_for(const Search& search) const {
  const double enough = search.detector->min_side_px();
  for (size_t i : search.objects) {
    const auto& expected = objects_[i].expected;
    if (!expected || expected->smallest_side_px <= 0) continue;
    if (expected->smallest_side_px * options_.search_scale < enough) return 1.0;
  }
  return options_.search_scale;
}

void FiducialObserver::Impl::run_region(Search& search, const Frame& frame, const Region& region,
                                        double scale) {
  detections_.clear();
  search.detector->detect(frame, region, scale, detections_);
  for (const SquareDetection& detection : detections_) accept(search, frame, detection);
}

/// Where the objects of a search are expected, overlapping regions united.
std::vector<Region> FiducialObserver::Impl::regions_of(const Search& search) const {
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

/// Looks where the objects should be; true if the whole picture has to be searched as well.
bool FiducialObserver::Impl::run_expected(Search& search, const Frame& frame) {
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

void FiducialObserver::Impl::run(Search& search, const Frame& frame) {
  for (size_t i : search.objects) ++objects_[i].since_full_search;
  const bool all_expected = std::all_of(search.objects.begin(), search.objects.end(),
                                        [&](size_t i) { return objects_[i].expected.has_value(); });
  if (all_expected && !run_expected(search, frame)) return;
  const bool thorough =
      search.missed % options_.thorough_interval == options_.thorough_interval - 1;
  run_region(search, frame, whole_picture(camera_->model), thorough ? 1.0 : options_.search_scale);
  ++counters_.full_searches;
  bool missed = false;
  for (size_t i : search.objects) {
    objects_[i].since_full_search = 0;
    missed = missed || !objects_[i].seen();
  }
  search.missed = missed ? search.missed + 1 : 0;
}

bool FiducialObserver::Impl::nearer_to_expected(
    const ObjectState& object, size_t square, const std::array<Eigen::Vector2d, 4>& candidate,
    const std::array<Eigen::Vector2d, 4>& current) const {
  if (object.expected) {
    const SquareInObject& points = object.squares[square];
    const Eigen::Vector3d middle = (points[0] + points[1] + points[2] + points[3]) / 4;
    const auto pixel = camera_->model.project(camera_->world_from_camera.inverse() *
                                              (object.expected->world_from_object * middle));
    if (pixel) return (centre(candidate) - *pixel).norm() < (centre(current) - *pixel).norm();
  }
  return shortest_side(candidate) > shortest_side(current);
}

void FiducialObserver::Impl::accept(const Search& search, const Frame& frame,
                                    const SquareDetection& detection) {
  const CodeOwner& owner = search.owners[static_cast<size_t>(detection.code)];
  ObjectState& object = objects_[owner.object];
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

void FiducialObserver::Impl::accept_fiducial(ObjectState& object, int fiducial,
                                             const SquareDetector::Border& border,
                                             const Frame& frame, const SquareDetection& detection) {
  // Where the edges cannot be followed the library's own corners are kept, for what they are worth.
  constexpr double kUnrefinedSigmaPx = 0.6;
  SeenFiducial seen{fiducial, detection.corners, kUnrefinedSigmaPx};
  if (const auto refined =
          refine_square(frame.grey(), light_, camera_->model, detection.corners, border)) {
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

// ---- measurement -------------------------------------------------------------------------------

PlanarView FiducialObserver::Impl::view_of(const ObjectState& object,
                                           const SeenFiducial& seen) const {
  const Fiducial& f = object.description.fiducials[static_cast<size_t>(seen.fiducial)];
  const auto corners = square_corners(f.size);
  return {f.object_from_fiducial,
          {corners.begin(), corners.end()},
          {seen.corners.begin(), seen.corners.end()}};
}

void FiducialObserver::Impl::add_matches(const PlanarView& view, double sigma_px,
                                         std::vector<PointMatch>& out) const {
  for (size_t i = 0; i < view.points.size(); ++i) {
    const Eigen::Vector3d point =
        view.object_from_plane * Eigen::Vector3d(view.points[i].x(), view.points[i].y(), 0);
    out.push_back({point, view.pixels[i], with_calibration(sigma_px)});
  }
}

void FiducialObserver::Impl::drop_contradicting(const ObjectState& object,
                                                std::vector<SeenFiducial>& fiducials) const {
  if (fiducials.size() < 2) return;
  // The pose of each marker alone votes; a marker agrees if its corners come out near where they
  // were seen. A pose from one small marker is rough, hence the wide limit.
  const auto agrees = [&](const Rigid3& camera_from_object, const SeenFiducial& seen) {
    const double limit = std::max(4.0, 0.25 * shortest_side(seen.corners));
    const SquareInObject& square = object.squares[static_cast<size_t>(seen.fiducial)];
    for (size_t k = 0; k < 4; ++k) {
      const auto pixel = camera_->model.project(camera_from_object * square[k]);
      if (!pixel || (*pixel - seen.corners[k]).norm() > limit) return false;
    }
    return true;
  };
  std::vector<SeenFiducial> best;
  double best_side = -1;
  for (const SeenFiducial& voter : fiducials) {
    const PlanarView view = view_of(object, voter);
    for (const Rigid3& camera_from_plane : plane_poses(camera_->model, view)) {
      const Rigid3 camera_from_object = camera_from_plane * view.object_from_plane.inverse();
      std::vector<SeenFiducial> agreeing;
      for (const SeenFiducial& seen : fiducials) {
        if (seen.fiducial == voter.fiducial || agrees(camera_from_object, seen)) {
          agreeing.push_back(seen);
        }
      }
      const double side = shortest_side(voter.corners);
      if (agreeing.size() > best.size() || (agreeing.size() == best.size() && side > best_side)) {
        best = std::move(agreeing);
        best_side = side;
      }
    }
  }
  if (!best.empty()) fiducials = std::move(best);
}

void FiducialObserver::Impl::measure(ObjectState& object, const Frame& frame, Observation& out) {
  std::vector<PlanarView> views;
  std::vector<PointMatch> matches;
  if (object.board) {
    if (auto view =
            object.board->find(frame.grey(), object.board_markers, options_.min_board_corners)) {
      add_matches(*view, options_.board_sigma_px, matches);
      views.push_back(std::move(*view));
    }
  }
  const size_t before = object.fiducials.size();
  drop_contradicting(object, object.fiducials);
  counters_.refused += before - object.fiducials.size();
  for (const SeenFiducial& seen : object.fiducials) {
    views.push_back(view_of(object, seen));
    add_matches(views.back(), seen.sigma_px, matches);
  }
  if (matches.empty()) return;
  counters_.fiducials += views.size();
  const auto term = std::make_shared<CornerTerm>(camera_, std::move(matches), options_.huber,
                                                 options_.view_error);
  out.hypotheses = pose_hypotheses(*term, views, options_.flip_cost_margin);
  out.terms.push_back(term);
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
  for (Search& search : searches_) run(search, frame);
  for (ObjectState& object : objects_) {
    Observation observation;
    observation.object = object.id;
    observation.camera = id_;
    observation.epoch = info.epoch;
    observation.sequence = info.sequence;
    observation.capture = info.capture;
    observation.capture_error = info.capture_error;
    measure(object, frame, observation);
    out.push_back(std::move(observation));
  }
}

// ---- the public face ---------------------------------------------------------------------------

Result<std::unique_ptr<FiducialObserver>> FiducialObserver::create(
    const CalibratedCamera& camera, CameraId id, std::vector<ObservedObject> objects,
    const FiducialOptions& options) {
  cv::setNumThreads(1);  // threads are the daemon's; and results must not depend on their number
  auto impl = std::make_unique<Impl>(camera, id, options);
  for (ObservedObject& object : objects) SL_RETURN_IF_ERROR(impl->add_object(std::move(object)));
  SL_RETURN_IF_ERROR(impl->make_searches());
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
