// SPDX-License-Identifier: Apache-2.0
#include "calibration/capture_session.hpp"

#include <algorithm>
#include <utility>

#include "sightline/base/priority.hpp"
#include "sightline/base/thread.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr size_t kFirstSolve = 8, kNextSolve = 4;  // sets, while something is missing

}  // namespace

CaptureSession::CaptureSession(const CaptureSessionOptions& options,
                               std::vector<ViewedCamera> cameras)
    : options_(options), guide_(options.target, cameras, options.solve.cameras, options.guide) {}

Result<std::unique_ptr<CaptureSession>> CaptureSession::start(
    const Installation& installation, const std::vector<size_t>& cameras,
    const CaptureSessionOptions& options) {
  std::vector<ViewedCamera> viewed;
  for (const size_t i : cameras) viewed.push_back({installation.cameras[i].name, 0, 0, 0});
  std::unique_ptr<CaptureSession> session(new CaptureSession(options, viewed));
  if (options.earlier) SL_RETURN_IF_ERROR(session->guide_.resume(*options.earlier));
  std::vector<std::unique_ptr<TargetDetector>> detectors;
  for (size_t c = 0; c < cameras.size(); ++c) {
    SL_ASSIGN(auto detector, TargetDetector::create(options.target, {.window = options.window}));
    detectors.push_back(std::move(detector));
  }
  for (auto& part : session->parts_of(installation, cameras, std::move(detectors))) {
    auto camera = TargetCamera::start(std::move(part));
    std::lock_guard lock(session->mutex_);
    session->cameras_.push_back(std::move(camera));
  }
  CaptureSession* raw = session.get();
  raw->solver_ = start_thread("solve", [raw](const std::stop_token& stop) { raw->solve(stop); });
  return session;
}

std::vector<TargetCamera::Parts> CaptureSession::parts_of(
    const Installation& installation, const std::vector<size_t>& cameras,
    std::vector<std::unique_ptr<TargetDetector>> detectors) {
  std::vector<TargetCamera::Parts> parts;
  std::vector<std::shared_ptr<TargetSlot>> slots(installation.cameras.size());
  for (size_t c = 0; c < cameras.size(); ++c) {
    CameraConfig config = installation.cameras[cameras[c]];
    TargetCamera::Parts part{config.name, options_.target, std::move(detectors[c]), {}, {}};
    part.on_image = [this, c](const Frame& frame, const auto& corners) { see(c, frame, corners); };
    // Stamps as they are: the offset is what is looked for.
    offsets_.push_back(options_.live ? from_seconds(config.calibration.time_offset_s)
                                     : Duration(0));
    if (options_.live) {
      part.nice = kSearchNice;
      slots[cameras[c]] = part.frames;
    } else {
      config.loop = false;
      config.calibration.time_offset_s = 0;
      part.open_source =
          sources_.opener(config, CameraId(static_cast<uint32_t>(cameras[c])), false);
    }
    parts.push_back(std::move(part));
  }
  if (options_.live) frames_ = std::make_shared<const TargetFrames>(std::move(slots));
  return parts;
}

Status CaptureSession::check_layout(size_t camera) const {
  const CharucoLayout asked = options_.target.layout;
  if (asked == CharucoLayout::kAny || camera >= cameras_.size()) return {};
  const CharucoLayout seen = cameras_[camera]->layout();
  if (seen == CharucoLayout::kAny || seen == asked) return {};
  const bool dark = seen == CharucoLayout::kDarkFirst;
  return make_error(ErrorCode::kInvalidInput, "camera " + guide_.views().cameras[camera].name,
                    "the print has the other layout for its even number of rows: {} at its "
                    "top-left. Write layout = \"{}\" (or \"any\") into the target file",
                    dark ? "a dark square" : "a marker", dark ? "dark_first" : "marker_first");
}

void CaptureSession::see(size_t camera, const Frame& frame,
                         const std::vector<DetectedCorner>& corners) {
  TargetSight sight{camera, frame.info().capture - offsets_[camera], {}, 0};
  for (const DetectedCorner& c : corners) {
    sight.corners.push_back({c.id, c.pixel, Eigen::Vector2d::Zero()});
  }
  if (!corners.empty()) sight.edge_px = target_edge_width(frame.gray(), corners);
  std::lock_guard lock(mutex_);
  if (error_ || concluding_) return;
  Status status = guide_.set_image_size(camera, frame.info().width, frame.info().height);
  if (status) status = check_layout(camera);
  if (!status) {
    error_ = status.error();
    return;
  }
  const auto step = guide_.add(sight);
  if (!step) {
    error_ = step.error();
    return;
  }
  step_ = *step;
  if (step->kind == CaptureStep::Kind::kTaken) taken_.notify_one();
}

bool CaptureSession::worth_solving() const {
  const size_t sets = guide_.views().sets;
  if (concluding_) return !concluded_;
  if (sets <= tried_sets_ || error_) return false;
  return guide_.complete() || sets >= (tried_sets_ == 0 ? kFirstSolve : tried_sets_ + kNextSolve);
}

void CaptureSession::solve(const std::stop_token& stop) {
  if (options_.live) give_way(kPointsNice);
  while (!stop.stop_requested()) {
    CalibrationViews views;
    {
      std::unique_lock lock(mutex_);
      if (!taken_.wait(lock, stop, [this] { return worth_solving(); })) return;
      views = guide_.views();
      if (concluding_ && (error_ || views.sets == tried_sets_)) {
        concluded_ = true;
        continue;
      }
      tried_sets_ = views.sets;
    }
    auto solved = solve_and_assess(views, options_.solve);
    std::lock_guard lock(mutex_);
    refusal_.reset();
    if (!solved) {
      refusal_ = solved.error().message();
      continue;
    }
    guide_.judge(solved->solution, solved->report, views.sets);
    solved_ =
        std::make_shared<const SolvedCapture>(SolvedCapture{std::move(views), *std::move(solved)});
  }
}

CaptureState CaptureSession::state() const {
  std::lock_guard lock(mutex_);
  CaptureState state;
  state.sets = guide_.views().sets;
  state.share = guide_.share();
  state.advice = guide_.advice();
  state.step = step_;
  state.progress = guide_.progress();
  for (const auto& camera : cameras_) state.cameras.push_back(camera->status());
  state.passed = guide_.passed();
  state.ended = std::ranges::all_of(state.cameras, &TargetCameraStatus::ended);
  state.error = error_;
  state.concluded = concluded_;
  if (guide_.complete() || concluded_) state.refusal = refusal_;
  return state;
}

CalibrationViews CaptureSession::views() const {
  std::lock_guard lock(mutex_);
  return guide_.views();
}

std::vector<ViewedCamera> CaptureSession::cameras() const {
  std::lock_guard lock(mutex_);
  return guide_.views().cameras;
}

std::string CaptureSession::coverage_svg(size_t camera) const {
  std::lock_guard lock(mutex_);
  return guide_.coverage_svg(camera);
}

CoverageCells CaptureSession::coverage(size_t camera) const {
  std::lock_guard lock(mutex_);
  return guide_.coverage(camera);
}

std::string CaptureSession::page(bool over) const {
  std::lock_guard lock(mutex_);
  return guide_.page(over);
}

size_t CaptureSession::links(size_t a, size_t b) const {
  std::lock_guard lock(mutex_);
  return guide_.links(a, b);
}

std::shared_ptr<const SolvedCapture> CaptureSession::solved() const {
  std::lock_guard lock(mutex_);
  return solved_;
}

void CaptureSession::conclude() {
  std::lock_guard lock(mutex_);
  concluding_ = true;
  taken_.notify_one();
}

void CaptureSession::request_stop() {
  for (const auto& camera : cameras_) camera->request_stop();
  solver_.request_stop();
}

void CaptureSession::stop() {
  request_stop();
  for (const auto& camera : cameras_) camera->stop();
  if (solver_.joinable()) solver_.join();
}

}  // namespace sightline
