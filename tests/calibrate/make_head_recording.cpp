// SPDX-License-Identifier: Apache-2.0
// Records a board that stands still before a camera on a pan and tilt head, which goes from place
// to place and then to and fro, and before cameras that stand still: axes.csv as its encoder says
// it, the truth as calibration.toml, what is known before as before.toml (the head without its
// axes), and board.toml.
//   make_head_recording OUT [--calibration FILE] [--board FILE] [--settings N] ...
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>

#include "print_camera.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "sightline/record/axes_csv.hpp"
#include "sightline/record/writer.hpp"
#include "synthetic_head.hpp"

namespace {

using namespace sightline;
using namespace sightline::test;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kGamma = 2.2;  // corners of tags are looked for in light

struct Choice {
  std::string out, calibration, board;
  SyntheticHeadOptions head;
  double distance = 1.0, rate = 10, aside_deg = 0;
  bool frozen = false, carried = false, object = false;
};

CalibratedCamera small_camera(const std::string& name, double focal) {
  CameraModel::Parameters p;
  p.width = 480;
  p.height = 320;
  p.fx = p.fy = focal;
  p.cx = 241.2;
  p.cy = 157.9;
  p.distortion = {-0.1, 0.03, 0.0003, -0.0002, 0};
  return {name, *CameraModel::create(p, "test"), Rigid3()};
}

Rigid3 turn(double degrees, const Eigen::Vector3d& axis) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(degrees * kDegree, axis)), Eigen::Vector3d::Zero()};
}

/// A head that counts pan the other way, and a camera beside it.
std::vector<CalibratedCamera> own_rig() {
  CalibratedCamera head = small_camera("head", 420), beside = small_camera("left", 400);
  CameraAxes axes;
  axes.world_from_base = Rigid3({1, 0, 0, 0}, {0.3, -0.2, 1.1}) *
                         turn(35, Eigen::Vector3d::UnitZ()) * turn(2, Eigen::Vector3d::UnitX());
  axes.pan_from_tilt =
      Rigid3({1, 0, 0, 0}, {0.004, 0.012, 0.06}) * turn(0.6, Eigen::Vector3d::UnitY());
  axes.tilt_from_camera = Rigid3({1, 0, 0, 0}, {0.003, 0.035, 0.012}) *
                          turn(-92, Eigen::Vector3d::UnitX()) * turn(1, Eigen::Vector3d::UnitZ());
  axes.pan_scale = -1;
  axes.latency_s = 0.06;
  axes.sigma = 0.05 * kDegree / std::sqrt(12.0);
  head.axes = axes;
  head.world_from_camera = axes.world_from_camera(0, 0);
  beside.world_from_camera = head.world_from_camera * Rigid3({1, 0, 0, 0}, {-0.5, 0.05, 0}) *
                             turn(25, Eigen::Vector3d::UnitY());
  return {head, beside};
}

CalibrationTarget own_board() {
  CalibrationTarget target;
  target.name = "board";
  target.columns = 7;
  target.rows = 5;
  target.square = 0.05;
  target.marker = 0.038;
  target.dictionary = "4X4_50";
  target.layout = CharucoLayout::kDarkFirst;
  return target;
}

/// Before the head at rest, its print turned from it by so much about the vertical.
Rigid3 place_board(const CalibratedCamera& head, const CalibrationTarget& target,
                   const Choice& choice) {
  const Eigen::Vector2d half = target.size() / 2;
  const Rigid3 camera_from_target = Rigid3({1, 0, 0, 0}, {0, 0, choice.distance}) *
                                    turn(choice.aside_deg, Eigen::Vector3d::UnitY()) *
                                    turn(18, Eigen::Vector3d::UnitX()) *
                                    Rigid3({1, 0, 0, 0}, {-half.x(), -half.y(), 0});
  return head.world_from_camera * camera_from_target;
}

CalibratedCamera zoomed(CalibratedCamera camera, double zoom) {
  CameraModel::Parameters p = camera.model.parameters();
  p.fx *= zoom_factor(zoom);
  p.fy *= zoom_factor(zoom);
  camera.model = *CameraModel::create(p, "test");
  return camera;
}

/// The board as an object of the recording, its mesh a thin plate. Beside the recording, which
/// takes a copy.
Result<std::filesystem::path> write_object(const std::string& out, const CalibrationTarget& t) {
  const std::filesystem::path folder = out + "_object";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const Eigen::Vector2d size = t.size();
  std::string mesh;
  for (const double z : {0.0, 0.004}) {
    mesh +=
        fmt::format("v 0 0 {2}\nv {0} 0 {2}\nv {0} {1} {2}\nv 0 {1} {2}\n", size.x(), size.y(), z);
  }
  mesh += "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
  SL_RETURN_IF_ERROR(write_file_atomically(folder / "board.obj", mesh));
  SL_RETURN_IF_ERROR(write_file_atomically(
      folder / "board.toml",
      fmt::format(
          "name = \"board\"\nmesh = \"board.obj\"\nunit = \"m\"\nmodalities = [\"fiducial\"]\n"
          "[board]\ntype = \"charuco\"\ncolumns = {}\nrows = {}\nsquare = {}\nmarker = {}\n"
          "dictionary = \"{}\"\n",
          t.columns, t.rows, t.square, t.marker, t.dictionary)));
  return folder / "board.toml";
}

class Recorder {
 public:
  Recorder(const Choice& choice, std::vector<CalibratedCamera> cameras, size_t head,
           const CalibrationTarget& target)
      : choice_(choice),
        cameras_(std::move(cameras)),
        head_(head),
        print_(target),
        world_from_board_(place_board(cameras_[head], target, choice)),
        random_(choice.head.seed + 22),
        way_(choice.head, random_) {
    for (size_t c = 0; c < cameras_.size(); ++c) {
      if (c == head_ && !choice.head.zooms.empty()) continue;
      eyes_.emplace_back(cameras_[c], kGamma);
    }
    if (choice.head.zooms.empty()) return;
    for (const double zoom : choice.head.zooms) lenses_.push_back(zoomed(cameras_[head], zoom));
    for (const CalibratedCamera& lens : lenses_) zoom_eyes_.emplace_back(lens, kGamma);
  }

  Status record(RecordingWriter& writer) {
    const auto angles = way_.with_play(choice_.head.play_deg * kDegree);
    std::vector<std::vector<uint8_t>> images(cameras_.size());
    std::optional<Eigen::Vector2d> shown;
    std::optional<double> shown_zoom;
    bool moved = false;
    uint64_t sequence = 0;
    for (double t = 0.003; t < way_.end(); t += 1 / choice_.rate, ++sequence) {
      const Eigen::Vector2d at = angles[static_cast<size_t>(t * 1e3 + 0.5)];
      const double zoom = way_.zoom(t);
      const bool carry = choice_.carried && !moved && t > way_.end() / 2;
      if (carry) {
        world_from_board_.translation += Eigen::Vector3d(0.01, 0.015, 0.02);
        moved = true;
      }
      for (size_t c = 0; c < cameras_.size(); ++c) {
        if (c == head_ && (!shown || *shown != at || *shown_zoom != zoom || carry)) {
          images[c] = eye(c, zoom).shoot({{&print_, world_from_board_}},
                                         cameras_[c].axes->world_from_camera(at[0], at[1]));
        } else if (c != head_ && (images[c].empty() || carry)) {
          images[c] = eye(c, zoom).shoot({{&print_, world_from_board_}});
        }
        const Time time = kHeadStart + from_seconds(t);
        SL_RETURN_IF_ERROR(writer.append(*noisy_frame(
            static_cast<uint32_t>(c), sequence, cameras_[c].model, images[c], time, random_)));
      }
      shown = at;
      shown_zoom = zoom;
    }
    return {};
  }

  /// The board stands where it stands.
  std::string truth_csv() const {
    std::string text = "t_ns,object,tx,ty,tz,qw,qx,qy,qz\n";
    const Eigen::Vector3d& t = world_from_board_.translation;
    const Eigen::Quaterniond& q = world_from_board_.rotation;
    for (double at = 0.003; at < way_.end(); at += 1 / choice_.rate) {
      text += fmt::format("{},board,{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n",
                          to_ns(kHeadStart + from_seconds(at)), t.x(), t.y(), t.z(), q.w(), q.x(),
                          q.y(), q.z());
    }
    return text;
  }

  std::string axes_csv() {
    std::string text = std::string(kAxesHeader) + "\n";
    std::vector<AxisReading> readings = read_head(choice_.head, way_, random_);
    for (size_t i = 0; i < readings.size(); ++i) {
      AxisReading reading = readings[i];
      if (choice_.frozen && i > readings.size() / 2) {
        reading.pan = readings[readings.size() / 2].pan;
        reading.tilt = readings[readings.size() / 2].tilt;
      }
      text += format_axes_row(cameras_[head_].name, reading) + "\n";
    }
    return text;
  }

 private:
  const Photographer& eye(size_t camera, double zoom) const {
    if (zoom_eyes_.empty()) return eyes_[camera];
    if (camera != head_) return eyes_[camera - (camera > head_)];
    const auto at = std::ranges::find(choice_.head.zooms, zoom);
    return zoom_eyes_[static_cast<size_t>(at - choice_.head.zooms.begin())];
  }

  const Choice& choice_;
  const std::vector<CalibratedCamera> cameras_;
  const size_t head_;
  Print print_;
  Rigid3 world_from_board_;
  Random random_;
  HeadWay way_;
  std::vector<Photographer> eyes_, zoom_eyes_;
  std::vector<CalibratedCamera> lenses_;
};

Status record(Choice choice) {
  std::vector<CalibratedCamera> cameras = own_rig();
  if (!choice.calibration.empty()) {
    SL_ASSIGN(cameras, read_calibration(choice.calibration));
  }
  CalibrationTarget target = own_board();
  if (!choice.board.empty()) {
    SL_ASSIGN(target, read_target(choice.board));
  }
  const auto head = std::ranges::find_if(
      cameras, [](const CalibratedCamera& camera) { return camera.axes.has_value(); });
  if (head == cameras.end()) {
    return make_error(ErrorCode::kInvalidInput, choice.calibration, "has no camera with axes");
  }
  const CameraAxes& axes = *head->axes;
  choice.head.pan_scale = axes.pan_scale;
  choice.head.tilt_scale = axes.tilt_scale;
  choice.head.latency_s = axes.latency_s;
  RecordingWriterOptions options;
  options.calibration_toml = format_calibration(cameras);
  options.raw_storage = RawStorage::kFfv1;
  for (const CalibratedCamera& camera : cameras) {
    options.cameras.push_back(
        {camera.name, PixelFormat::kI420, camera.model.width(), camera.model.height()});
  }
  if (choice.object) {
    SL_ASSIGN(options.objects.emplace_back(), write_object(choice.out, target));
  }
  SL_ASSIGN(auto writer, RecordingWriter::create(choice.out, options));
  Recorder recorder(choice, cameras, static_cast<size_t>(head - cameras.begin()), target);
  SL_RETURN_IF_ERROR(recorder.record(*writer));
  SL_RETURN_IF_ERROR(writer->close());
  SL_RETURN_IF_ERROR(write_file_atomically(choice.out + "/axes.csv", recorder.axes_csv()));
  SL_RETURN_IF_ERROR(write_file_atomically(choice.out + "/board.toml", format_target(target)));
  if (choice.object) {
    SL_RETURN_IF_ERROR(write_file_atomically(choice.out + "/truth.csv", recorder.truth_csv()));
  }
  head->axes.reset();
  return write_file_atomically(choice.out + "/before.toml", format_calibration(cameras));
}

}  // namespace

int main(int argc, char** argv) {
  Choice choice;
  choice.head.settings = 14;
  choice.head.moving_s = 5;
  choice.head.pan_range_deg = 12;
  CLI::App app{"Records a board before a camera on a head"};
  app.add_option("OUT", choice.out, "folder to make")->required();
  app.add_option("--calibration", choice.calibration, "the true rig (default: its own)");
  app.add_option("--board", choice.board, "target file (default: a ChArUco board)");
  app.add_option("--distance", choice.distance, "of the board from the head [m]");
  app.add_option("--aside-deg", choice.aside_deg, "the board turned about the vertical");
  app.add_option("--settings", choice.head.settings, "places of the head, at each zoom");
  app.add_option("--moving", choice.head.moving_s, "how long it turns to and fro behind [s]");
  app.add_option("--pan-range", choice.head.pan_range_deg, "to either side [deg]");
  app.add_option("--tilt-range", choice.head.tilt_range_deg, "to either side [deg]");
  app.add_option("--play", choice.head.play_deg, "of both axes [deg]");
  app.add_option("--zooms", choice.head.zooms, "settings of the zoom")->delimiter(',');
  app.add_option("--seed", choice.head.seed, "of the places");
  app.add_option("--rate", choice.rate, "frames per second");
  app.add_flag("--object", choice.object, "the board is an object, with its truth (truth.csv)");
  app.add_flag("--frozen", choice.frozen, "the angles freeze in the middle");
  app.add_flag("--carried", choice.carried, "the board is moved in the middle");
  CLI11_PARSE(app, argc, argv);
  const Status done = record(choice);
  if (done) return 0;
  std::fprintf(stderr, "make_head_recording: %s\n", done.error().message().c_str());
  return exit_code(done.error());
}
