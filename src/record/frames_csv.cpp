// SPDX-License-Identifier: Apache-2.0
#include "record/csv.hpp"
#include "sightline/record/recording.hpp"

namespace sightline {

using namespace record;

namespace {

constexpr std::string_view kHeader = "camera,sequence,capture_ns,arrival_ns,dropped_before";

Result<RecordedRow> parse_row(const std::vector<std::string_view>& fields, const std::string& where,
                              size_t line) {
  RecordedRow row;
  row.line = line;
  SL_ASSIGN(row.sequence, parse_whole<uint64_t>(fields[1], "sequence", where, line, 0));
  SL_ASSIGN(row.capture, parse_time(fields[2], "capture_ns", where, line));
  SL_ASSIGN(row.arrival, parse_time(fields[3], "arrival_ns", where, line));
  SL_ASSIGN(row.dropped_before, parse_whole<uint32_t>(fields[4], "dropped_before", where, line, 0));
  return row;
}

/// Refuses a row that does not come after the camera's last one.
Status check_order(const RecordedRow& last, const RecordedRow& row, std::string_view camera,
                   const std::string& where) {
  if (row.sequence == last.sequence) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, row.line),
                      "camera {} has sequence {} twice, first in line {}", camera, row.sequence,
                      last.line);
  }
  if (row.sequence < last.sequence) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, row.line),
                      "rows of camera {} are not sorted: sequence {} after {} in line {}", camera,
                      row.sequence, last.sequence, last.line);
  }
  if (row.capture <= last.capture) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, row.line),
                      "capture times of camera {} run backwards or stand still: {} ns after {} ns "
                      "in line {}",
                      camera, to_ns(row.capture), to_ns(last.capture), last.line);
  }
  return {};
}

class FramesParser {
 public:
  FramesParser(const std::string& where, std::span<const std::string> cameras)
      : where_(where), cameras_(cameras), rows_(cameras.size()) {}

  Status parse_line(const CsvLines::Line& line) {
    split_fields(line.text, fields_);
    SL_RETURN_IF_ERROR(check_field_count(fields_.size(), 5, kHeader, where_, line.number));
    SL_ASSIGN(const size_t camera, parse_camera(fields_[0], cameras_, where_, line.number));
    SL_ASSIGN(const RecordedRow row, parse_row(fields_, where_, line.number));
    auto& rows = rows_[camera];
    if (!rows.empty()) SL_RETURN_IF_ERROR(check_order(rows.back(), row, cameras_[camera], where_));
    if (row.arrival < row.capture && early_++ == 0) first_early_ = line.number;
    rows.push_back(row);
    return {};
  }

  void warn(std::vector<std::string>& warnings) const {
    if (early_ > 0) {
      warnings.push_back(fmt::format("{}: {} rows arrive before their capture time, from here on",
                                     line_of(where_, first_early_), early_));
    }
  }

  std::vector<RecordedRows> take() { return std::move(rows_); }

 private:
  const std::string& where_;
  std::span<const std::string> cameras_;
  std::vector<RecordedRows> rows_;
  std::vector<std::string_view> fields_;
  size_t early_ = 0, first_early_ = 0;
};

Result<std::vector<RecordedRows>> read_rows(CsvLines lines, std::span<const std::string> cameras,
                                            std::vector<std::string>* warnings) {
  SL_RETURN_IF_ERROR(check_header(lines, kHeader));
  FramesParser parser(lines.where(), cameras);
  for (;;) {
    SL_ASSIGN(const auto line, lines.next());
    if (!line) break;
    const Status status = parser.parse_line(*line);
    if (status) continue;
    if (line->ended) return status.error();
    if (warnings) {
      warnings->push_back(fmt::format("{}: the file stops inside this line; it is left out",
                                      line_of(lines.where(), line->number)));
    }
  }
  if (warnings) parser.warn(*warnings);
  return parser.take();
}

}  // namespace

Result<std::vector<RecordedRows>> parse_frames_csv(std::string_view text, const std::string& where,
                                                   std::span<const std::string> cameras,
                                                   std::vector<std::string>* warnings) {
  return read_rows(CsvLines(text, where), cameras, warnings);
}

Result<std::vector<RecordedRows>> read_frames_csv(const std::filesystem::path& path,
                                                  std::span<const std::string> cameras,
                                                  std::vector<std::string>* warnings) {
  SL_ASSIGN(CsvLines lines, CsvLines::open(path));
  return read_rows(std::move(lines), cameras, warnings);
}

}  // namespace sightline
