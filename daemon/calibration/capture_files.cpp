// SPDX-License-Identifier: Apache-2.0
#include "calibration/capture_files.hpp"

#include <ctime>

#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"

namespace sightline {
namespace {

std::vector<CalibratedCamera> cameras_of(const RigSolution& solution) {
  std::vector<CalibratedCamera> cameras;
  for (const SolvedCamera& solved : solution.cameras) cameras.push_back(solved.camera);
  return cameras;
}

/// UTC, as TOML writes dates.
std::string today() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

}  // namespace

std::string epoch_of(const CalibrationViews& views, const RigSolution& solution) {
  return fmt::format("{:016x}",
                     content_hash(format_views(views) + format_calibration(cameras_of(solution))));
}

Status write_solved(const std::filesystem::path& folder, const CalibrationViews& views,
                    const SolvedRig& solved) {
  const auto& [solution, report] = solved;
  const std::string epoch = epoch_of(views, solution);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    return make_error(ErrorCode::kIo, folder.string(), "cannot make it: {}", error.message());
  SL_RETURN_IF_ERROR(write_file_atomically(folder / "corners.csv", format_views(views)));
  SL_RETURN_IF_ERROR(
      write_file_atomically(folder / "report.json", report_json(views, solution, report, epoch)));
  SL_RETURN_IF_ERROR(
      write_file_atomically(folder / "report.html", report_html(views, solution, report, epoch)));
  const std::string text =
      format_solution(solution, today(), fmt::format("epoch {}, see corners.csv", epoch));
  SL_RETURN_IF_ERROR(parse_calibration(text, "the calibration"));
  return write_file_atomically(folder / "calibration.toml", text);
}

Status keep_capture(const CaptureSession& session, const std::vector<std::string>& cameras,
                    const std::filesystem::path& folder, bool over) {
  const CalibrationViews views = session.views();
  if (views.sets > 0) {
    SL_RETURN_IF_ERROR(write_file_atomically(folder / "corners.csv", format_views(views)));
  }
  for (size_t c = 0; c < cameras.size(); ++c) {
    SL_RETURN_IF_ERROR(write_file_atomically(folder / fmt::format("coverage_{}.svg", cameras[c]),
                                             session.coverage_svg(c)));
  }
  return write_file_atomically(folder / "capture.html", session.page(over));
}

}  // namespace sightline
