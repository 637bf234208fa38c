// SPDX-License-Identifier: Apache-2.0
//
// The drawing thread of a camera.
#include "workers/camera_worker.hpp"
#include "workers/stage_latency.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kTurn = 200ms;            // longest wait without a look at the stop token
constexpr Duration kNoSignalPeriod = 500ms;  // between images while there is no signal

// For the labels: a pose may be right and still lie beside the object in this camera's picture.
std::string_view notice_of(const DrawStage& stage) {
  switch (stage.calibration_state ? stage.calibration_state() : CalibrationState::kUnknown) {
    case CalibrationState::kKnocked:
      return "camera knocked";
    case CalibrationState::kDrifting:
      return "camera drifting";
    case CalibrationState::kDisputed:
      return "camera disputed";
    case CalibrationState::kUnfit:
      return "wrong picture";
    default:
      return {};
  }
}

}  // namespace

void CameraWorker::draw(std::stop_token stop, Heartbeat& heartbeat) {
  DrawStage stage = std::move(parts_.draw);
  while (!stop.stop_requested()) {
    heartbeat.beat();
    const Duration until_slate = next_no_signal_ - MonotonicClock::now();
    const bool slate_next = until_slate > Duration(0) && until_slate < kTurn;
    const auto frame = draw_slot_.take(stop, slate_next ? until_slate : kTurn);
    renew(stage);
    if (!frame) {
      const auto lost_since = signal_.lost_since(MonotonicClock::now());
      if (lost_since && stage.slate && parts_.output->wanted()) {
        draw_no_signal(*lost_since, *stage.slate);
      }
      parts_.output->report();
      continue;
    }
    if (parts_.output->wanted()) draw_one(*frame, stage);
  }
}

void CameraWorker::draw_no_signal(Time since, NoSignalSlate& slate) {
  const Time now = MonotonicClock::now();
  if (now < next_no_signal_) return;
  next_no_signal_ = now + kNoSignalPeriod;
  if (!no_signal_.image || since != no_signal_since_) {
    const SignalWatch::Last last = signal_.last();
    auto image = std::make_shared<Image>(parts_.width, parts_.height);
    const I420View shown = last.image ? last.image->view() : I420View{};
    slate.draw(image->mutable_view(), last.image ? &shown : nullptr,
               no_signal_text(parts_.name, utc_ns_of(since)));
    no_signal_.image = std::move(image);
    no_signal_.frame = last.frame;  // no fresh frame is claimed, and there are no poses
    no_signal_.frame.camera = parts_.id;
    no_signal_since_ = since;
  }
  no_signal_.shown = now;
  parts_.output->accept(no_signal_);
}

void CameraWorker::draw_points(const MutableI420View& image, const FrameInfo& frame,
                               const DrawStage& stage) {
  const ScenePointsPtr points = stage.points(frame.capture);
  if (!points || (frame.place && !frame.place->trusted())) return;
  const CalibratedCamera& camera = *stage.calibration;
  const Rigid3& place = frame.place ? frame.place->world_from_camera : camera.world_from_camera;
  marks_.clear();
  marks_of_points(camera.model, place.inverse(), points->points, marks_);
  draw_point_marks(image, marks_, fit_depth_scale(marks_), kManyPoints);
}

void CameraWorker::draw_one(const FramePtr& frame, DrawStage& stage) {
  const Time start = MonotonicClock::now();
  // The observer needs the shared image anyway.
  if (observes_) frame->i420();
  offer_clean(*frame);
  if (!parts_.output->wants_annotated()) return;
  std::shared_ptr<Image> image = images_.get();
  frame->copy_i420_to(image->mutable_view());
  stage.board->read(draw_tracks_);
  annotated_.frame = frame->info();
  const OcclusionDepthPtr hidden = hidden_.read();
  stage.renderer->draw(image->mutable_view(), frame->info().capture, draw_tracks_, annotated_.poses,
                       {hidden.get(), notice_of(stage), frame->info().place.get()});
  if (stage.points) draw_points(image->mutable_view(), frame->info(), stage);
  annotated_.image = std::move(image);
  draw_seconds_.set(to_seconds(MonotonicClock::now() - start));
  observe_age(*drawn_, frame->info().capture);
  parts_.output->accept(annotated_);
  annotated_.image.reset();
}

void CameraWorker::offer_clean(const Frame& frame) {
  PictureSlot& pictures = parts_.output->pictures();
  if (!pictures.wanted(PictureKind::kClean)) return;
  std::shared_ptr<Image> clean = images_.get();
  frame.copy_i420_to(clean->mutable_view());
  pictures.offer(PictureKind::kClean, std::move(clean), frame.info());
}

}  // namespace sightline
