// SPDX-License-Identifier: Apache-2.0
// Records somebody who shows a board to two cameras as the guide of `sightline calibrate capture`
// asks, and holds it still at each pose; with the true cameras as calibration.toml, and board.toml.
//   make_board_recording OUT [--flat] [--poses N] [--cameras N] [--rate HZ] [--held S]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "print_camera.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "sightline/geometry/rolling_shutter.hpp"
#include "sightline/record/writer.hpp"
#include "simulated_user.hpp"

namespace {

using namespace sightline;
using namespace sightline::test;

struct Choice {
  std::string out;
  bool flat = false, floor = false, wall = false, moving = false;
  size_t poses = 60, cameras = 2;
  double rate = 12, held = 0.75, readout = 0;
  int width = 640;
};

SyntheticRig make_small_rig(const Choice& choice) {
  SyntheticRig rig = make_rig({.cameras = choice.cameras, .sets = 0, .seed = 11});
  CalibrationTarget& target = rig.views.target;
  target = CalibrationTarget();
  target.name = "board";
  target.kind = TargetKind::kCharuco;
  target.columns = 8;
  target.rows = 6;
  target.square = 0.045;
  target.marker = 0.034;
  target.dictionary = "5X5_100";
  target.layout = CharucoLayout::kDarkFirst;
  const double scale = choice.width / 1280.0;
  for (size_t c = 0; c < choice.cameras; ++c) {
    CameraModel::Parameters p = rig.truth[c].model.parameters();
    p.width = choice.width;
    p.height = choice.width * 3 / 4;
    p.fx *= scale;
    p.fy *= scale;
    p.cx = (p.cx + 0.5) * scale - 0.5;
    p.cy = (p.height - 1) / 2.0 + 3;
    rig.truth[c].model = *CameraModel::create(p, "test");
    rig.truth[c].readout_s = (c % 2 == 1 ? 1 : -0.5) * (choice.moving ? choice.readout : 0);
    rig.truth[c].name = c == 0 ? "left" : c == 1 ? "right" : "cam" + std::to_string(c);
    rig.views.cameras[c] = {rig.truth[c].name, p.width, p.height, 0};
  }
  return rig;
}

CalibrationTarget wall_target() {
  CalibrationTarget target;
  target.name = "wall";
  target.kind = TargetKind::kTagGrid;
  target.columns = 3;
  target.rows = 2;
  target.marker = 0.12;
  target.gap = 0.03;
  target.dictionary = "tag36h11";
  target.fixed = true;
  return target;
}

class Recorder {
 public:
  Recorder(const SyntheticRig& rig, const Choice& choice, std::unique_ptr<RecordingWriter> writer)
      : rig_(rig),
        choice_(choice),
        print_(rig.views.target),
        wall_(wall_target()),
        writer_(std::move(writer)) {
    for (const CalibratedCamera& camera : rig.truth) eyes_.emplace_back(camera);
  }

  /// On the way there, and held there; or on the way alone.
  Status show(const Rigid3& world_from_target) {
    if (choice_.moving) return pass(world_from_target);
    const Rigid3 before = shown_ ? *shown_ : world_from_target;
    const Vector6 way = difference(before, world_from_target);
    for (int step = 1; shown_ && step < kSteps; ++step) {
      SL_RETURN_IF_ERROR(add(before * Rigid3::exp(way * step / kSteps), 1));
    }
    shown_ = world_from_target;
    return add(world_from_target, static_cast<int>(choice_.held * choice_.rate + 0.5));
  }
  Status close() { return writer_->close(); }

 private:
  static constexpr int kSteps = 4;
  static constexpr int kMovingSteps = 9;

  // Never still but for a moment between two ways; each image is of its own time.
  Status pass(const Rigid3& to) {
    const Rigid3 before = shown_ ? *shown_ : to;
    const Vector6 way = difference(before, to);
    for (int step = 0; shown_ && step < kMovingSteps; ++step) {
      std::vector<std::vector<uint8_t>> images;
      for (size_t c = 0; c < eyes_.size(); ++c) {
        const double frame = step + static_cast<double>(c) / static_cast<double>(eyes_.size());
        images.push_back(eyes_[c].shoot_rows(print_, [&](int row) {
          const double later = row_delay_s(rig_.truth[c], row) * choice_.rate;
          const double s = std::clamp((frame + later) / kMovingSteps, 0.0, 1.0);
          return before * Rigid3::exp(way * s * s * (3 - 2 * s));
        }));
      }
      SL_RETURN_IF_ERROR(append(images));
    }
    shown_ = to;
    return {};
  }

  Status add(const Rigid3& pose, int times) {
    std::vector<std::vector<uint8_t>> images;
    std::vector<PlacedPrint> prints{{&print_, pose}};
    // Behind everything that is shown, square to the first camera.
    if (choice_.wall) prints.push_back({&wall_, Rigid3({1, 0, 0, 0}, {-0.2, -0.15, 2.4})});
    for (const Photographer& eye : eyes_) images.push_back(eye.shoot(prints));
    // Cameras out of step, although all are shown the same: it is for a board that stands still.
    for (int i = 0; i < times; ++i) SL_RETURN_IF_ERROR(append(images));
    return {};
  }

  Status append(const std::vector<std::vector<uint8_t>>& images) {
    const Duration period = from_seconds(1 / choice_.rate);
    for (uint32_t c = 0; c < images.size(); ++c) {
      const Duration phase =
          choice_.wall ? Duration(0) : period * c / static_cast<int64_t>(images.size());
      const Time at = Time(std::chrono::seconds(1)) + period * sequence_ + phase;
      SL_RETURN_IF_ERROR(writer_->append(*noisy_frame(
          c, static_cast<uint64_t>(sequence_), rig_.truth[c].model, images[c], at, random_)));
    }
    ++sequence_;
    return {};
  }

  const SyntheticRig& rig_;
  const Choice& choice_;
  Print print_, wall_;
  std::vector<Photographer> eyes_;
  std::unique_ptr<RecordingWriter> writer_;
  std::optional<Rigid3> shown_;
  int64_t sequence_ = 0;
  Random random_{17};
};

/// world_from_target: face up before the first camera, which looks down by 12 degrees.
Rigid3 lying(const SyntheticRig& rig) {
  constexpr double kDown = 0.21, kFar = 0.8, kBelow = 0.36;
  const Eigen::Vector3d up(0, -std::cos(kDown), -std::sin(kDown));
  Eigen::Matrix3d r;
  r << Eigen::Vector3d::UnitX(), (-up).cross(Eigen::Vector3d::UnitX()), -up;
  const Eigen::Vector2d half = rig.views.target.size() / 2;
  return {Eigen::Quaterniond(r),
          Eigen::Vector3d(0, 0, kFar) - kBelow * up - r * Eigen::Vector3d(half.x(), half.y(), 0)};
}

Status record(const Choice& choice) {
  const SyntheticRig rig = make_small_rig(choice);
  RecordingWriterOptions options;
  options.calibration_toml = format_calibration(rig.truth);
  options.raw_storage = RawStorage::kFfv1;
  for (const CalibratedCamera& camera : rig.truth) {
    options.cameras.push_back(
        {camera.name, PixelFormat::kI420, camera.model.width(), camera.model.height()});
  }
  SL_ASSIGN(auto writer, RecordingWriter::create(choice.out, options));
  SL_RETURN_IF_ERROR(
      write_file_atomically(choice.out + "/board.toml", format_target(rig.views.target)));
  SL_RETURN_IF_ERROR(
      write_file_atomically(choice.out + "/wall.toml", format_target(wall_target())));
  Recorder recorder(rig, choice, std::move(writer));
  if (choice.floor) {
    SL_RETURN_IF_ERROR(recorder.show(lying(rig)));
    return recorder.close();
  }
  CaptureGuideOptions careful;  // what is detected is a little less
  careful.views += 3;
  CaptureGuide guide(rig.views.target, rig.views.cameras, {}, careful);
  SimulatedUser user(rig, {.tilts = !choice.flat});
  size_t spare = 12;  // poses after the guide was content
  for (size_t pose = 0; pose < choice.poses && spare > 0; ++pose) {
    const Rigid3 shown = user.pose_for(guide.advice());
    std::optional<Error> error;
    user.hold(shown, [&](const TargetSight& sight) {
      const auto step = guide.add(sight);
      if (!step) error = step.error();
    });
    if (error) return *error;
    SL_RETURN_IF_ERROR(recorder.show(shown));
    if (guide.complete()) --spare;
  }
  return recorder.close();
}

}  // namespace

int main(int argc, char** argv) {
  Choice choice;
  CLI::App app{"Records somebody who shows a board to cameras"};
  app.add_option("OUT", choice.out, "folder to make")->required();
  app.add_flag("--flat", choice.flat, "never tilts it");
  app.add_flag("--wall", choice.wall, "tags stand behind it, fixed (wall.toml); cameras in step");
  app.add_flag("--moving", choice.moving, "is never held still");
  app.add_option("--readout", choice.readout,
                 "--moving: the last row is exposed so much after the first [s]");
  app.add_flag("--floor", choice.floor, "lies on the floor all the time");
  app.add_option("--poses", choice.poses, "at most");
  app.add_option("--cameras", choice.cameras, "how many")->check(CLI::Range(1, 3));
  app.add_option("--rate", choice.rate, "frames per second");
  app.add_option("--held", choice.held, "how long at each pose [s]");
  app.add_option("--width", choice.width, "of the images");
  CLI11_PARSE(app, argc, argv);
  const Status done = record(choice);
  if (done) return 0;
  std::fprintf(stderr, "make_board_recording: %s\n", done.error().message().c_str());
  return exit_code(done.error());
}
