// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "calibrate/calibrate_commands.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/interchange.hpp"

namespace sightline::cli {
namespace {

constexpr const char* kFormats = "opencv, kalibr, ros, colmap, mrcal, anipose or caliscope";
constexpr size_t kMaxBytes = size_t{64} << 20;  // mrcal keeps its solver's inputs

struct InterchangeOptions {
  std::vector<std::filesystem::path> from;
  std::filesystem::path calibration, out;
  std::string format, unit = "m";
};

double meters_per_unit(const std::string& unit) {
  return unit == "mm" ? 1e-3 : unit == "cm" ? 1e-2 : 1;
}

std::vector<CalibratedCamera> scaled(std::vector<CalibratedCamera> cameras, double factor) {
  for (CalibratedCamera& camera : cameras) camera.world_from_camera.translation *= factor;
  return cameras;
}

void add_unit(CLI::App& command, InterchangeOptions& to) {
  command.add_option("--unit", to.unit, "of lengths in the other program's files (default: m)")
      ->check(CLI::IsMember({"m", "cm", "mm"}));
}

Status run_import(const InterchangeOptions& o) {
  SL_ASSIGN(const InterchangeFormat format, parse_interchange_format(o.format));
  std::vector<NamedText> files;
  for (const auto& path : o.from) {
    SL_ASSIGN(std::string text, read_file(path, kMaxBytes));
    files.push_back({path.filename().string(), std::move(text)});
  }
  SL_ASSIGN(const auto cameras, import_cameras(files, format));
  SL_RETURN_IF_ERROR(write_calibration(o.out, scaled(cameras, meters_per_unit(o.unit))));
  fmt::print("{} cameras written: {}\n", cameras.size(), o.out.string());
  return {};
}

Status run_export(const InterchangeOptions& o) {
  SL_ASSIGN(const InterchangeFormat format, parse_interchange_format(o.format));
  SL_ASSIGN(const auto cameras, read_calibration(o.calibration));
  SL_ASSIGN(const auto files, export_cameras(scaled(cameras, 1 / meters_per_unit(o.unit)), format));
  for (const CalibratedCamera& camera : cameras) {
    if (camera.time_offset_s == 0) continue;
    fmt::print(stderr,
               "camera {}: its time offset of {} s is left out, the format has no place for it\n",
               camera.name, camera.time_offset_s);
  }
  std::error_code error;
  std::filesystem::create_directories(o.out, error);
  if (error)
    return make_error(ErrorCode::kIo, o.out.string(), "cannot make it: {}", error.message());
  for (const NamedText& file : files) {
    SL_RETURN_IF_ERROR(write_file_atomically(o.out / file.name, file.text));
    fmt::print("written: {}\n", (o.out / file.name).string());
  }
  return {};
}

int exit_of(const Status& done) { return done ? 0 : report(done.error()); }

}  // namespace

void add_calibrate_import(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<InterchangeOptions>();
  auto* command = parent.add_subcommand("import", "calibration.toml from files of other programs");
  command->add_option("FILE", options->from, "its files")->required();
  command->add_option("--format", options->format, kFormats)->required();
  command->add_option("--out", options->out, "calibration.toml to write")->required();
  add_unit(*command, *options);
  command->callback(
      [options, &chosen] { chosen = [options] { return exit_of(run_import(*options)); }; });
}

void add_calibrate_export(CLI::App& parent, Command& chosen) {
  auto options = std::make_shared<InterchangeOptions>();
  auto* command = parent.add_subcommand("export", "files of other programs from calibration.toml");
  command->add_option("CALIBRATION", options->calibration, "calibration.toml")->required();
  command->add_option("--format", options->format, kFormats)->required();
  command->add_option("--out", options->out, "folder to write into")->required();
  add_unit(*command, *options);
  command->callback(
      [options, &chosen] { chosen = [options] { return exit_of(run_export(*options)); }; });
}

}  // namespace sightline::cli
