// SPDX-License-Identifier: Apache-2.0
#include "calibrate/solve_arguments.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>

#include "progress.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "sightline/pipeline/target_views.hpp"
#include "sightline/record/recording.hpp"

namespace sightline::cli {
namespace {

Result<CalibrationTarget> find_target(const ViewArguments& arguments) {
  if (!arguments.targets.empty()) return read_targets(arguments.targets);
  if (arguments.recording.empty()) {
    return make_error(ErrorCode::kInvalidInput, "--target",
                      "say which target the images show: --target target.toml");
  }
  SL_ASSIGN(const Recording recording, open_recording(arguments.recording));
  for (const auto& object : recording.objects) {
    SL_ASSIGN(const std::string text, read_file(object, size_t{1} << 20));
    if (text.find("[board]") != std::string::npos) return read_target(object);
  }
  return make_error(ErrorCode::kInvalidInput, arguments.recording.string(),
                    "no object of the recording is a board; say which target it shows: --target "
                    "target.toml");
}

/// Whether an image of one may be taken for one of the other.
bool share_markers(const CalibrationTarget& a, const CalibrationTarget& b) {
  if (a.kind == TargetKind::kChessboard || b.kind == TargetKind::kChessboard) {
    return a.kind == b.kind && a.columns == b.columns && a.rows == b.rows;
  }
  const auto first = [](const CalibrationTarget& t) {
    return t.kind == TargetKind::kTagGrid ? t.first_id : 0;
  };
  const auto end = [&](const CalibrationTarget& t) {
    const int squares = t.columns * t.rows;
    return first(t) + (t.kind == TargetKind::kTagGrid ? squares : (squares + 1) / 2);
  };
  // Of dictionaries of one size the smaller one is the beginning of the larger one.
  const auto family = [](const CalibrationTarget& t) {
    return t.dictionary.substr(0, t.dictionary.find('_'));
  };
  return a.kind == b.kind && family(a) == family(b) && first(a) < end(b) && first(b) < end(a);
}

std::optional<LensModel> lens_of(const std::string& name) {
  if (name == "brown_conrady") return LensModel::kBrownConrady;
  if (name == "rational") return LensModel::kRational;
  if (name == "fisheye") return LensModel::kFisheye;
  return std::nullopt;
}

}  // namespace

Result<CalibrationTarget> read_targets(const std::vector<std::filesystem::path>& files) {
  std::optional<CalibrationTarget> first;
  for (const auto& file : files) {
    SL_ASSIGN(CalibrationTarget target, read_target(file));
    if (!first) {
      first = std::move(target);
      continue;
    }
    std::vector<CalibrationTarget> before{*first};
    before.insert(before.end(), first->others.begin(), first->others.end());
    for (const CalibrationTarget& other : before) {
      if (!share_markers(target, other)) continue;
      return make_error(ErrorCode::kInvalidInput, file.string(),
                        "nothing tells it from the {}: take another dictionary, or other ids",
                        other.describe());
    }
    first->others.push_back(std::move(target));
  }
  SL_CHECK(first.has_value(), "a target file at least");
  return *first;
}

void add_view_arguments(CLI::App& command, ViewArguments& to) {
  command.add_option("RECORDING", to.recording,
                     "recording in which the target is shown, or corners.csv of another solution");
  command
      .add_option("--images", to.images,
                  "NAME=FOLDER or NAME=PATTERN: still images of one camera, instead of a "
                  "recording; may be repeated")
      ->allow_extra_args(false);
  command
      .add_option("--target", to.targets,
                  "target file (default: the object of the recording that is a board); may be "
                  "repeated: further boards, or tags that stand in the room (fixed = true)")
      ->allow_extra_args(false);
  command.add_option("--camera", to.cameras, "takes part (default: all); may be repeated")
      ->allow_extra_args(false);
  command
      .add_option("--corner-window", to.window,
                  "half side of the window in which corners are refined [px] (default: from the "
                  "size of the squares)")
      ->check(CLI::Range(1, 50));
  command.add_option("--every", to.every, "look at every N-th image of a camera")
      ->check(CLI::PositiveNumber);
}

Result<CalibrationViews> load_views(const ViewArguments& arguments) {
  if (arguments.recording.empty() == arguments.images.empty()) {
    return make_error(ErrorCode::kInvalidInput, "",
                      "name a RECORDING, or the images of each camera (--images NAME=FOLDER)");
  }
  if (arguments.recording.extension() == ".csv") {
    SL_ASSIGN(const std::string text, read_file(arguments.recording));
    return parse_views(text, arguments.recording.string());
  }
  SL_ASSIGN(const CalibrationTarget target, find_target(arguments));
  TargetViewsOptions options;
  options.window = arguments.window;
  options.every = arguments.every;
  options.by_any = arguments.by_any;
  options.cameras = arguments.cameras;
  std::optional<ProgressBar> bar;
  options.on_progress = [&](size_t done, size_t total) {
    if (!bar) bar.emplace("target", total);
    bar->set(done);
  };
  if (!arguments.recording.empty()) {
    return views_of_recording(arguments.recording, target, options);
  }
  std::vector<CameraStills> stills;
  for (const std::string& argument : arguments.images) {
    SL_ASSIGN(stills.emplace_back(), parse_stills(argument));
  }
  return views_of_stills(stills, target, options);
}

Result<std::vector<CameraPrior>> parse_priors(const CalibrationViews& views,
                                              const std::vector<std::string>& models,
                                              const std::filesystem::path& known) {
  std::vector<CameraPrior> priors(views.cameras.size());
  for (const std::string& model : models) {
    const size_t mark = model.find('=');
    const auto lens = lens_of(mark == std::string::npos ? model : model.substr(mark + 1));
    if (!lens) {
      return make_error(ErrorCode::kInvalidInput, "--model",
                        "'{}' is no lens model: brown_conrady, rational, fisheye", model);
    }
    bool used = false;
    for (size_t c = 0; c < priors.size(); ++c) {
      if (mark != std::string::npos && views.cameras[c].name != model.substr(0, mark)) continue;
      priors[c].lens = *lens;
      used = true;
    }
    if (!used) return make_error(ErrorCode::kInvalidInput, "--model", "no camera for '{}'", model);
  }
  if (known.empty()) return priors;
  SL_ASSIGN(const auto cameras, read_calibration(known));
  size_t taken = 0;
  for (size_t c = 0; c < priors.size(); ++c) {
    const CalibratedCamera* camera = find_camera(cameras, views.cameras[c].name);
    if (camera == nullptr) continue;
    priors[c].known = camera->model;
    priors[c].readout_s = camera->readout_s;
    ++taken;
  }
  if (taken > 0) return priors;
  return make_error(ErrorCode::kInvalidInput, known.string(),
                    "has none of the cameras that took part");
}

}  // namespace sightline::cli
