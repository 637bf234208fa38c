// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>

#include "calibrate/calibrate_commands.hpp"
#include "calibrate/capture_page.hpp"
#include "calibrate/capture_progress.hpp"
#include "calibrate/solve_arguments.hpp"
#include "calibrate/solved_rig.hpp"
#include "calibration/capture_files.hpp"
#include "calibration/capture_session.hpp"
#include "calibration/capture_words.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/base/log_output.hpp"
#include "sightline/base/thread.hpp"
#include "sightline/calibrate/target_file.hpp"
#include "sightline/config/installation.hpp"
#include "signals.hpp"

namespace sightline::cli {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr Duration kTurn = 100ms;

struct CaptureCommandOptions {
  fs::path config, target, out = "calibration", intrinsics;
  std::vector<std::string> cameras, models;
  std::string reference;
  int window = 0;
  size_t most = 200;
  bool moving = false, readouts = false, bend = false, resume = false, json = false;
  bool corners_only = false, page = false;
  std::optional<uint16_t> page_port;
  std::optional<double> seconds;
};

Result<Installation> open_installation(const CaptureCommandOptions& o) {
  std::error_code ignored;
  if (fs::is_directory(o.config, ignored)) return recording_installation(o.config);
  return read_uncalibrated_installation(o.config);
}

Result<CalibrationTarget> find_target(const CaptureCommandOptions& o, const Installation& rig) {
  if (!o.target.empty()) return read_target(o.target);
  for (const ObjectConfig& object : rig.objects) {
    SL_ASSIGN(const std::string text, read_file(object.description.file, size_t{1} << 20));
    if (text.find("[board]") != std::string::npos) return read_target(object.description.file);
  }
  return make_error(ErrorCode::kInvalidInput, "--target",
                    "say which target is shown: --target board.toml (sightline calibrate target "
                    "writes one)");
}

Result<std::vector<size_t>> chosen_cameras(const CaptureCommandOptions& o,
                                           const Installation& rig) {
  std::vector<size_t> chosen;
  for (const std::string& name : o.cameras) {
    const auto found = std::ranges::find(rig.cameras, name, &CameraConfig::name);
    if (found == rig.cameras.end()) {
      return make_error(ErrorCode::kInvalidInput, o.config.string(), "has no camera '{}'", name);
    }
    chosen.push_back(static_cast<size_t>(found - rig.cameras.begin()));
  }
  for (size_t i = 0; o.cameras.empty() && i < rig.cameras.size(); ++i) chosen.push_back(i);
  return chosen;
}

/// The folder that is written to; nothing in it that is worth keeping is written over.
Status prepare_folder(const CaptureCommandOptions& o, const Installation& rig) {
  std::error_code error;
  fs::create_directories(o.out, error);
  if (error)
    return make_error(ErrorCode::kIo, o.out.string(), "cannot make it: {}", error.message());
  std::error_code differs;
  if (fs::equivalent(o.out / "calibration.toml", rig.calibration, differs)) {
    return make_error(ErrorCode::kInvalidInput, (o.out / "calibration.toml").string(),
                      "is the calibration in force: name another folder with --out, look at the "
                      "report, and copy the new file then");
  }
  if (!o.resume && fs::exists(o.out / "corners.csv", error)) {
    return make_error(ErrorCode::kInvalidInput, (o.out / "corners.csv").string(),
                      "is of an earlier capture: --resume goes on with it, or name another folder "
                      "with --out");
  }
  return {};
}

Result<CaptureSessionOptions> session_options(const CaptureCommandOptions& o,
                                              const CalibrationTarget& target,
                                              const std::vector<std::string>& names) {
  CaptureSessionOptions options{
      .target = target, .window = o.window, .solve = {}, .guide = {}, .earlier = {}};
  CalibrationViews cameras{.target = target, .cameras = {}, .sets = 0, .views = {}};
  for (const std::string& name : names) cameras.cameras.push_back({name, 0, 0, 0});
  SL_ASSIGN(options.solve.cameras, parse_priors(cameras, o.models, o.intrinsics));
  SL_ASSIGN(options.solve.reference, reference_camera(cameras, o.reference));
  options.solve.bend = o.bend;
  options.solve.time_offsets = options.guide.moving = o.moving;
  options.solve.readouts = o.readouts;
  std::error_code ignored;
  if (o.resume && fs::exists(o.out / "corners.csv", ignored)) {
    SL_ASSIGN(const std::string text, read_file(o.out / "corners.csv"));
    SL_ASSIGN(options.earlier, parse_views(text, (o.out / "corners.csv").string()));
  }
  return options;
}

/// Until the report passes, a signal, the end of what is played, or enough of it.
Status watch(const CaptureSession& session, const Signals& signals,
             const std::vector<std::string>& names, const CaptureCommandOptions& o,
             CapturePage* page) {
  const Time start = MonotonicClock::now();
  CaptureProgressLine line(names);
  size_t kept = SIZE_MAX;
  std::string words;
  for (;;) {
    const bool asked = signals.wait(kTurn) != 0;
    const CaptureState state = session.state();
    line.show(state);
    if (page != nullptr) page->show(session, state);
    (void)log::flush(0ms);
    if (state.sets != kept || state.advice.words != words) {
      kept = state.sets;
      words = state.advice.words;
      SL_RETURN_IF_ERROR(keep_capture(session, names, o.out, false));
    }
    if (state.error) return *state.error;
    const Duration elapsed = MonotonicClock::now() - start;
    SL_RETURN_IF_ERROR(
        check_present(state, names, elapsed, "--camera chooses cameras that take part"));
    const bool enough = state.passed || state.sets >= o.most;
    if (asked || enough || state.ended) return {};
    if (o.seconds && elapsed >= from_seconds(*o.seconds)) return {};
  }
}

/// Runs what cannot be asked to stop; a signal meanwhile ends the program. What was taken is on the
/// disk by then.
void run_unless_asked(const Signals& signals, const std::function<void()>& work,
                      const std::function<void(const std::string& what)>& on_failure) {
  std::atomic<bool> done{false};
  const std::jthread worker = start_thread(
      "solve",
      [&](const std::stop_token&) {
        work();
        done = true;
      },
      [&](const std::string& what) {
        on_failure(what);
        done = true;
      });
  while (!done) {
    if (signals.wait(kTurn) == 0) continue;
    std::fprintf(stderr, "sightline: given up; corners.csv has what was taken\n");
    std::fflush(nullptr);
    std::_Exit(1);
  }
}

Result<SolvedRig> solve_last(const CalibrationViews& views, const SolveOptions& options,
                             const Signals& signals) {
  std::optional<Result<SolvedRig>> solved;
  run_unless_asked(
      signals, [&] { solved.emplace(solve_and_assess(views, options)); },
      [&](const std::string& what) {
        solved.emplace(make_error(ErrorCode::kInternal, "solving", "{}", what));
      });
  return *std::move(solved);
}

/// Where the installation has the daemon's page, under the same rules; null unless asked for.
Result<std::unique_ptr<CapturePage>> start_page(const CaptureCommandOptions& o,
                                                const Installation& rig,
                                                const std::vector<std::string>& names) {
  if (!o.page) return std::unique_ptr<CapturePage>();
  HttpOptions options = rig.http.server;
  if (o.page_port) options.port = *o.page_port;
  auto page = CapturePage::start(options, names);
  if (!page && page.error().code == ErrorCode::kUnavailable) {
    return make_error(ErrorCode::kUnavailable, page.error().where,
                      "{}; is a sightlined running? --page-port takes another", page.error().text);
  }
  if (page) std::fprintf(stderr, "page: %s\n", (*page)->address().c_str());
  return page;
}

/// What came of it, in words; `page` outlives it, so that these can be shown.
Result<std::string> capture(const CaptureCommandOptions& o, std::unique_ptr<CapturePage>& page) {
  SL_ASSIGN(const Signals signals, Signals::create());
  SL_ASSIGN(const Installation rig, open_installation(o));
  SL_ASSIGN(const CalibrationTarget target, find_target(o, rig));
  SL_ASSIGN(const std::vector<size_t> chosen, chosen_cameras(o, rig));
  std::vector<std::string> names;
  for (const size_t i : chosen) names.push_back(rig.cameras[i].name);
  SL_RETURN_IF_ERROR(prepare_folder(o, rig));
  SL_ASSIGN(const CaptureSessionOptions options, session_options(o, target, names));
  SL_ASSIGN(page, start_page(o, rig, names));
  SL_ASSIGN(const auto session, CaptureSession::start(rig, chosen, options));
  const Status watched = watch(*session, signals, names, o, page.get());
  const auto at_the_end = session->solved();
  const CaptureState state = session->state();
  run_unless_asked(
      signals, [&] { session->stop(); }, [](const std::string&) {});
  SL_RETURN_IF_ERROR(keep_capture(*session, names, o.out, true));
  SL_RETURN_IF_ERROR(watched);
  const CalibrationViews views = session->views();
  if (views.sets == 0) {
    return make_error(ErrorCode::kInvalidInput, "", "nothing was taken: {}",
                      next_words(state, names));
  }
  if (o.corners_only) {
    const std::string words =
        fmt::format("{} sets written: {}", views.sets, (o.out / "corners.csv").string());
    fmt::print("{}\n", words);
    return words;
  }
  std::optional<SolvedRig> solved;
  // Of all sets: what came after the solution is not thrown away.
  if (at_the_end && state.passed && at_the_end->views.sets == views.sets) {
    solved = at_the_end->rig;
  } else {
    if (!state.passed) std::fprintf(stderr, "left open: %s\n", state.advice.words.c_str());
    SL_ASSIGN(solved, solve_last(views, options.solve, signals));
  }
  SL_RETURN_IF_ERROR(write_solved(o.out, views, *solved));
  print_solved(views, *solved, o.json, o.out);
  return fmt::format("Done, {}: {}", to_string(solved->report.grade),
                     (o.out / "report.html").string());
}

int run(const CaptureCommandOptions& options) {
  std::unique_ptr<CapturePage> page;
  const Result<std::string> done = capture(options, page);
  if (page) page->finish(done ? *done : done.error().message(), done.has_value());
  (void)log::flush(1s);
  return done ? 0 : report(done.error());
}

}  // namespace

void add_calibrate_capture(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<CaptureCommandOptions>();
  auto* command = parent.add_subcommand(
      "capture",
      "watches the cameras while a target is shown to them, says what is missing, and "
      "solves");
  command
      ->add_option("--config", options->config,
                   "installation file; its cameras need no "
                   "calibration yet. Or a recording")
      ->required();
  command->add_option("--target", options->target,
                      "target file (default: the installation's object that is a board)");
  command->add_option("--out", options->out,
                      "folder for calibration.toml, report.html, report.json, corners.csv, "
                      "capture.html and coverage_CAMERA.svg (default: calibration)");
  command->add_option("--camera", options->cameras, "takes part (default: all); may be repeated")
      ->allow_extra_args(false);
  auto* moving =
      command->add_flag("--moving", options->moving,
                        "the target need not be held still: the time offsets of the cameras are "
                        "solved for, too");
  command
      ->add_flag("--readouts", options->readouts,
                 "rows of cameras may be exposed one after the other (rolling shutter): solve for "
                 "how long that takes, too")
      ->needs(moving);
  command->add_flag("--resume", options->resume, "goes on with the sets in the folder");
  command
      ->add_option("--model", options->models,
                   "brown_conrady (default), rational or fisheye; NAME=MODEL for one camera")
      ->allow_extra_args(false);
  command->add_option("--intrinsics", options->intrinsics,
                      "calibration.toml whose lenses are held; only the places are solved for");
  command->add_option("--reference", options->reference,
                      "camera whose frame becomes the world's (default: the first)");
  command->add_flag("--bend", options->bend, "the target may be bent: solve for that, too");
  command
      ->add_option("--corner-window", options->window,
                   "half side of the window in which corners are refined [px] (default: from the "
                   "size of the squares)")
      ->check(CLI::Range(1, 50));
  command->add_flag("--corners-only", options->corners_only,
                    "writes corners.csv and solves nothing: for `calibrate check` and `world`");
  command->add_option("--sets", options->most, "stop after so many sets (default 200)")
      ->check(CLI::PositiveNumber);
  command->add_option("--seconds", options->seconds, "stop after so long")
      ->check(CLI::PositiveNumber);
  auto* page = command->add_flag(
      "--page", options->page,
      "shows the same as a page at the address of the installation's [http] (default: "
      "http://127.0.0.1:8080/), for a phone at the rig");
  command->add_option("--page-port", options->page_port, "at this port; 0: a free one")
      ->needs(page);
  command->add_flag("--json", options->json, "print the report as JSON");
  command->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace sightline::cli
