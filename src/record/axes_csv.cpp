// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/axes_csv.hpp"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "record/csv.hpp"

namespace sightline {

using namespace record;

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMostDegrees = 36'000;  // a hundred turns
constexpr size_t kMostRows = 20'000'000;

Result<double> parse_angle(std::string_view field, const char* column, const std::string& where,
                           size_t line) {
  SL_ASSIGN(const double degrees, parse_finite(field, column, where, line));
  if (std::abs(degrees) <= kMostDegrees) return degrees * kDegree;
  return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                    "column {} is {}, it must be -{} to {}", column, degrees, kMostDegrees,
                    kMostDegrees);
}

Result<AxisReading> parse_reading(const std::vector<std::string_view>& fields,
                                  const std::string& where, size_t line) {
  AxisReading out;
  SL_ASSIGN(out.stamp, parse_time(fields[1], "t_ns", where, line));
  SL_ASSIGN(out.pan, parse_angle(fields[2], "pan_deg", where, line));
  SL_ASSIGN(out.tilt, parse_angle(fields[3], "tilt_deg", where, line));
  SL_ASSIGN(out.zoom, parse_finite(fields[4], "zoom", where, line));
  SL_ASSIGN(const int moving, parse_whole<int>(fields[5], "moving", where, line, 0, 1));
  out.moving = moving != 0;
  return out;
}

class AxesParser {
 public:
  AxesParser(const std::string& where, std::span<const std::string> cameras)
      : where_(where), cameras_(cameras), readings_(cameras.size()) {}

  Status parse_line(const CsvLines::Line& line) {
    split_fields(line.text, fields_);
    SL_RETURN_IF_ERROR(check_field_count(fields_.size(), 6, kAxesHeader, where_, line.number));
    SL_ASSIGN(const size_t camera, parse_camera(fields_[0], cameras_, where_, line.number));
    SL_ASSIGN(const AxisReading reading, parse_reading(fields_, where_, line.number));
    auto& readings = readings_[camera];
    if (!readings.empty() && reading.stamp <= readings.back().stamp) {
      return make_error(ErrorCode::kInvalidInput, line_of(where_, line.number),
                        "times of camera {} run backwards or stand still: {} ns after {} ns",
                        cameras_[camera], to_ns(reading.stamp), to_ns(readings.back().stamp));
    }
    if (++rows_ > kMostRows) {
      return make_error(ErrorCode::kInvalidInput, line_of(where_, line.number), "more than {} rows",
                        kMostRows);
    }
    readings.push_back(reading);
    return {};
  }

  std::vector<std::vector<AxisReading>> take() { return std::move(readings_); }

 private:
  const std::string& where_;
  std::span<const std::string> cameras_;
  std::vector<std::vector<AxisReading>> readings_;
  std::vector<std::string_view> fields_;
  size_t rows_ = 0;
};

Result<std::vector<std::vector<AxisReading>>> read_lines(CsvLines lines,
                                                         std::span<const std::string> cameras,
                                                         std::vector<std::string>* warnings) {
  SL_RETURN_IF_ERROR(check_header(lines, kAxesHeader));
  AxesParser parser(lines.where(), cameras);
  for (;;) {
    SL_ASSIGN(const auto line, lines.next());
    if (!line) break;
    const Status status = parser.parse_line(*line);
    if (status) continue;
    if (line->ended) return status.error();
    if (warnings != nullptr) {
      warnings->push_back(fmt::format("{}: the file stops inside this line; it is left out",
                                      line_of(lines.where(), line->number)));
    }
  }
  return parser.take();
}

}  // namespace

std::string format_axes_row(std::string_view camera, const AxisReading& reading) {
  return fmt::format("{},{},{:.6f},{:.6f},{},{}", camera, to_ns(reading.stamp),
                     reading.pan / kDegree, reading.tilt / kDegree, reading.zoom,
                     reading.moving ? 1 : 0);
}

Result<std::vector<std::vector<AxisReading>>> parse_axes_csv(std::string_view text,
                                                             const std::string& where,
                                                             std::span<const std::string> cameras,
                                                             std::vector<std::string>* warnings) {
  return read_lines(CsvLines(text, where), cameras, warnings);
}

Result<std::vector<std::vector<AxisReading>>> read_axes_csv(const std::filesystem::path& path,
                                                            std::span<const std::string> cameras,
                                                            std::vector<std::string>* warnings) {
  SL_ASSIGN(CsvLines lines, CsvLines::open(path));
  return read_lines(std::move(lines), cameras, warnings);
}

}  // namespace sightline
