// SPDX-License-Identifier: Apache-2.0
#include "sightline/calibrate/capture_guide.hpp"

#include <algorithm>

#include "calibrate/capture/guide_state.hpp"

namespace sightline {

using namespace calibrate;

namespace {

constexpr size_t kFresh = 3;  // sets that a report may be behind

}  // namespace

struct CaptureGuide::Impl : GuideState {
  using GuideState::GuideState;
};

CaptureGuide::CaptureGuide(const CalibrationTarget& target,
                           const std::vector<ViewedCamera>& cameras,
                           const std::vector<CameraPrior>& priors,
                           const CaptureGuideOptions& options)
    : impl_(std::make_unique<Impl>(target, cameras, priors, options)) {
  for (const ViewedCamera& camera : cameras) {
    if (camera.width < 1) continue;
    (void)set_image_size(static_cast<size_t>(&camera - cameras.data()), camera.width,
                         camera.height);
  }
}

CaptureGuide::~CaptureGuide() = default;
CaptureGuide::CaptureGuide(CaptureGuide&&) noexcept = default;
CaptureGuide& CaptureGuide::operator=(CaptureGuide&&) noexcept = default;

Status CaptureGuide::set_image_size(size_t camera, int width, int height) {
  ViewedCamera& seen = impl_->views.cameras[camera];
  SL_RETURN_IF_ERROR(impl_->records[camera].set_size(seen.name, width, height));
  seen.width = width;
  seen.height = height;
  return {};
}

Result<CaptureStep> CaptureGuide::add(const TargetSight& sight) {
  Impl& guide = *impl_;
  SL_CHECK(guide.records[sight.camera].width() > 0, "the size is set before the first image");
  ++guide.views.cameras[sight.camera].images;
  ++guide.progress[sight.camera].images;
  guide.progress[sight.camera].seen += sight.corners.size() >= guide.options.min_corners;
  guide.windows[sight.camera].add(sight);
  Impl::Sets set(guide.records.size());
  const CaptureStep step = guide.find_set(sight, set);
  if (step.kind != CaptureStep::Kind::kTaken) return step;
  SL_RETURN_IF_ERROR(guide.check(set));
  guide.take(set);
  return step;
}

Status CaptureGuide::resume(const CalibrationViews& earlier) {
  Impl& guide = *impl_;
  SL_RETURN_IF_ERROR(check_views(earlier));
  // Names are not kept in the file.
  CalibrationTarget target = guide.views.target;
  target.name = earlier.target.name;
  const bool same_cameras = std::ranges::equal(earlier.cameras, guide.views.cameras, {},
                                               &ViewedCamera::name, &ViewedCamera::name);
  if (!same_cameras || earlier.target.describe() != target.describe()) {
    return make_error(ErrorCode::kInvalidInput, "the earlier capture",
                      "is of {}: it cannot be added to",
                      same_cameras ? "another target, " + earlier.target.describe()
                                   : std::string("other cameras"));
  }
  for (size_t c = 0; c < earlier.cameras.size(); ++c) {
    if (earlier.cameras[c].width < 1) continue;  // it gave no image
    SL_RETURN_IF_ERROR(set_image_size(c, earlier.cameras[c].width, earlier.cameras[c].height));
    guide.views.cameras[c].images += earlier.cameras[c].images;
  }
  std::vector<std::vector<size_t>> seen_by(earlier.sets);
  for (const TargetView& view : earlier.views) {
    guide.views.views.push_back(view);
    guide.views.views.back().set += guide.views.sets;
    guide.records[view.camera].take(view.corners);
    seen_by[view.set].push_back(view.camera);
  }
  for (const auto& cameras : seen_by) guide.note_seen(cameras);
  guide.views.sets += earlier.sets;
  guide.update();
  return {};
}

void CaptureGuide::judge(const RigSolution& solution, const RigReport& report, size_t sets) {
  for (size_t c = 0; c < impl_->records.size(); ++c) {
    impl_->records[c].set_lens(solution.cameras[c].camera.model);
  }
  impl_->report = report;
  impl_->report_sets = sets;
  impl_->update();
}

const CalibrationViews& CaptureGuide::views() const { return impl_->views; }
const std::vector<CameraProgress>& CaptureGuide::progress() const { return impl_->progress; }
size_t CaptureGuide::links(size_t a, size_t b) const { return impl_->pairs.of(a, b); }

double CaptureGuide::share() const {
  const auto cameras = static_cast<double>(impl_->records.size());
  double sum = 0;
  for (const CameraProgress& camera : impl_->progress) sum += camera.share;
  const double links = (cameras - 1) * static_cast<double>(impl_->options.links);
  if (links <= 0) return sum / cameras;
  const auto missing = static_cast<double>(impl_->pairs.missing(impl_->options.links));
  return 0.8 * sum / cameras + 0.2 * (1 - missing / links);
}

bool CaptureGuide::complete() const {
  return impl_->pairs.missing(impl_->options.links) == 0 &&
         std::ranges::all_of(impl_->progress, &CameraProgress::complete);
}

bool CaptureGuide::passed() const {
  const size_t behind = impl_->views.sets - impl_->report_sets;
  return complete() && impl_->report && impl_->report->grade == CalibrationGrade::kGood &&
         behind <= kFresh;
}

CoverageCells CaptureGuide::coverage(size_t camera) const {
  CoverageCells cells{kCellColumns, kCellRows, {}};
  for (int row = 0; row < kCellRows; ++row) {
    for (int column = 0; column < kCellColumns; ++column) {
      cells.corners.push_back(impl_->records[camera].cell(column, row));
    }
  }
  return cells;
}

const CaptureGuideOptions& CaptureGuide::options() const { return impl_->options; }

std::string CaptureGuide::coverage_svg(size_t camera) const {
  return calibrate::coverage_svg(*impl_, camera, advice());
}

std::string CaptureGuide::page(bool over) const {
  return capture_page(*impl_, advice(), share(), over);
}

CaptureAdvice CaptureGuide::advice() const {
  const Impl& guide = *impl_;
  CaptureAdvice advice;
  if (passed()) {
    advice.kind = CaptureAdvice::Kind::kDone;
    advice.words = "done: the report is good";
    return advice;
  }
  const size_t camera = guide.next_camera();
  if (camera < guide.records.size()) {
    const CameraNeeds& needs = guide.needs[camera];
    advice.camera = camera;
    advice.region = needs.region;
    advice.distance = needs.distance;
    advice.tilt = needs.tilt;
    advice.words = show_words(guide.name(camera), advice, guide.progress[camera].views == 0);
    return advice;
  }
  if (const auto link = missing_link(guide.pairs, guide.options.links, guide.last_camera)) {
    advice.kind = CaptureAdvice::Kind::kTogether;
    advice.camera = link->a;
    advice.other = link->b;
    advice.words =
        link_words(guide.name(link->a), guide.name(link->b), link->sets, guide.options.links);
    return advice;
  }
  return guide.report_advice();
}

}  // namespace sightline
