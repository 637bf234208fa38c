// SPDX-License-Identifier: Apache-2.0
#include "sightline/record/pose_log.hpp"

#include <cmath>
#include <map>
#include <numbers>

#include "record/csv.hpp"
#include "record/out_file.hpp"
#include "sightline/base/files.hpp"

namespace sightline {

using namespace record;

namespace {

constexpr std::string_view kTruthHeader = "t_ns,object,tx,ty,tz,qw,qx,qy,qz";
constexpr const char* kPoseColumns[] = {"tx", "ty", "tz", "qw", "qx", "qy", "qz"};

/// q and -q are the same rotation: the one whose first non-zero part is positive.
Eigen::Quaterniond canonical(const Eigen::Quaterniond& q) {
  for (const double part : {q.w(), q.x(), q.y(), q.z()}) {
    if (part > 0) return q;
    if (part < 0) return Eigen::Quaterniond(-q.coeffs());
  }
  return q;
}

/// Fixed decimals; what rounds to zero has no sign, so that equal rows give equal bytes.
std::string fixed(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.find_first_not_of("-0.") == std::string::npos && text.starts_with('-')) text.erase(0, 1);
  return text;
}

/// Seven fields from `fields[first]`.
Result<Rigid3> parse_pose(const std::vector<std::string_view>& fields, size_t first,
                          const std::string& where, size_t line) {
  double v[7];
  for (size_t i = 0; i < 7; ++i) {
    SL_ASSIGN(v[i], parse_finite(fields[first + i], kPoseColumns[i], where, line));
  }
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  if (std::abs(q.norm() - 1.0) > 1e-3) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                      "quaternion has length {:.6g}, expected 1", q.norm());
  }
  return Rigid3(q, Eigen::Vector3d(v[0], v[1], v[2]));
}

Result<TrackState> parse_state(std::string_view field, const std::string& where, size_t line) {
  for (const auto state : {TrackState::kSearching, TrackState::kTracking, TrackState::kDegraded,
                           TrackState::kCoasting, TrackState::kLost}) {
    if (field == to_string(state)) return state;
  }
  return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                    "state is '{}', expected searching, tracking, degraded, coasting or lost",
                    field.substr(0, 40));
}

Status check_object(std::string_view object, const std::string& where, size_t line) {
  if (!object.empty()) return {};
  return make_error(ErrorCode::kInvalidInput, line_of(where, line), "the object has no name");
}

std::vector<std::string> split_cameras(std::string_view field) {
  std::vector<std::string> names;
  while (!field.empty()) {
    const size_t plus = field.find('+');
    names.emplace_back(field.substr(0, plus));
    if (plus == std::string_view::npos) break;
    field.remove_prefix(plus + 1);
  }
  return names;
}

Result<PoseLogRow> parse_log_row(const std::vector<std::string_view>& fields,
                                 const std::string& where, size_t line) {
  PoseLogRow row;
  SL_RETURN_IF_ERROR(check_field_count(fields.size(), 13, kPoseLogHeader, where, line));
  SL_ASSIGN(row.time, parse_time(fields[0], "t_ns", where, line));
  SL_RETURN_IF_ERROR(check_object(fields[1], where, line));
  row.object = fields[1];
  SL_ASSIGN(row.state, parse_state(fields[2], where, line));
  row.cameras = split_cameras(fields[12]);
  if (has_pose(row.state)) {
    SL_ASSIGN(row.world_from_object, parse_pose(fields, 3, where, line));
    SL_ASSIGN(row.sigma_t_mm, parse_finite(fields[10], "sigma_t_mm", where, line));
    SL_ASSIGN(row.sigma_r_deg, parse_finite(fields[11], "sigma_r_deg", where, line));
    return row;
  }
  for (size_t i = 3; i < 12; ++i) {
    if (!fields[i].empty()) {
      return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                        "state {} has no pose, but column {} is '{}'", fields[2], i + 1,
                        fields[i].substr(0, 40));
    }
  }
  return row;
}

Result<TruthRow> parse_truth_row(const std::vector<std::string_view>& fields,
                                 const std::string& where, size_t line) {
  TruthRow row;
  SL_RETURN_IF_ERROR(check_field_count(fields.size(), 9, kTruthHeader, where, line));
  SL_ASSIGN(row.time, parse_time(fields[0], "t_ns", where, line));
  SL_RETURN_IF_ERROR(check_object(fields[1], where, line));
  row.object = fields[1];
  SL_ASSIGN(row.world_from_object, parse_pose(fields, 2, where, line));
  return row;
}

Result<std::vector<PoseLogRow>> read_log_rows(CsvLines lines) {
  SL_RETURN_IF_ERROR(check_header(lines, kPoseLogHeader));
  std::vector<PoseLogRow> rows;
  std::vector<std::string_view> fields;
  for (;;) {
    SL_ASSIGN(const auto line, lines.next());
    if (!line) return rows;
    split_fields(line->text, fields);
    auto row = parse_log_row(fields, lines.where(), line->number);
    if (row) rows.push_back(*std::move(row));
    if (!row && line->ended) return row.error();
  }
}

Result<std::vector<TruthRow>> read_truth_rows(CsvLines lines) {
  SL_RETURN_IF_ERROR(check_header(lines, kTruthHeader));
  std::vector<TruthRow> rows;
  std::map<std::string, Time, std::less<>> last;
  std::vector<std::string_view> fields;
  for (;;) {
    SL_ASSIGN(const auto line, lines.next());
    if (!line) return rows;
    split_fields(line->text, fields);
    SL_ASSIGN(TruthRow row, parse_truth_row(fields, lines.where(), line->number));
    const auto [known, is_new] = last.try_emplace(row.object, row.time);
    if (!is_new && row.time <= known->second) {
      return make_error(ErrorCode::kInvalidInput, line_of(lines.where(), line->number),
                        "times of object {} do not grow: {} ns after {} ns", row.object,
                        to_ns(row.time), to_ns(known->second));
    }
    known->second = row.time;
    rows.push_back(std::move(row));
  }
}

class BufferedPoseLog final : public PoseLogWriter {
 public:
  explicit BufferedPoseLog(OutFile file) : file_(std::move(file)) {}
  ~BufferedPoseLog() override { (void)close(); }

  Status append(const PoseLogRow& row) override {
    if (row.object.empty() || row.object.find_first_of(",\r\n") != std::string::npos) {
      return make_error(ErrorCode::kInvalidInput, file_.path(),
                        "object name '{}' cannot be a CSV field", row.object);
    }
    buffer_ += format_pose_row(row);
    buffer_ += '\n';
    return buffer_.size() < kBuffer ? Status() : flush();
  }
  Status flush() override {
    const Status status = file_.write(buffer_);
    buffer_.clear();
    return status;
  }
  Status close() override {
    if (!file_.is_open()) return {};
    const Status flushed = flush();
    const Status closed = file_.close();
    return flushed ? closed : flushed;
  }

 private:
  static constexpr size_t kBuffer = 1 << 16;
  OutFile file_;
  std::string buffer_ = std::string(kPoseLogHeader) + "\n";
};

}  // namespace

const std::string_view kPoseLogHeader =
    "t_ns,object,state,tx,ty,tz,qw,qx,qy,qz,sigma_t_mm,sigma_r_deg,cameras";

PoseLogRow make_pose_log_row(const PoseEstimate& estimate, std::string object,
                             std::span<const std::string> cameras) {
  PoseLogRow row{estimate.time, std::move(object), estimate.state, {}, 0, 0, {}};
  if (has_pose(estimate.state)) {
    row.world_from_object = estimate.world_from_object;
    row.sigma_t_mm = estimate.sigma_translation() * 1e3;
    row.sigma_r_deg = estimate.sigma_rotation() * 180.0 / std::numbers::pi;
  }
  for (size_t i = 0; i < cameras.size() && i < 64; ++i) {
    if (estimate.cameras & camera_bit(CameraId(static_cast<uint32_t>(i)))) {
      row.cameras.push_back(cameras[i]);
    }
  }
  return row;
}

std::string format_pose_row(const PoseLogRow& row) {
  std::string text =
      fmt::format("{},{},{},", to_ns(row.time), row.object, std::string(to_string(row.state)));
  if (row.world_from_object && has_pose(row.state)) {
    const Eigen::Vector3d& t = row.world_from_object->translation;
    const Eigen::Quaterniond q = canonical(row.world_from_object->rotation);
    for (const double v : {t.x(), t.y(), t.z()}) text += fixed(v, 7) + ',';
    for (const double v : {q.w(), q.x(), q.y(), q.z()}) text += fixed(v, 9) + ',';
    text += fixed(row.sigma_t_mm, 4) + ',' + fixed(row.sigma_r_deg, 4) + ',';
  } else {
    text += ",,,,,,,,,";
  }
  for (size_t i = 0; i < row.cameras.size(); ++i) text += (i ? "+" : "") + row.cameras[i];
  return text;
}

Result<std::unique_ptr<PoseLogWriter>> PoseLogWriter::create(const std::filesystem::path& path) {
  SL_ASSIGN(auto file, OutFile::create(path, OutFile::Existing::kReplace));
  return std::unique_ptr<PoseLogWriter>(std::make_unique<BufferedPoseLog>(std::move(file)));
}

Result<std::vector<PoseLogRow>> parse_pose_log(std::string_view text, const std::string& where) {
  return read_log_rows(CsvLines(text, where));
}

Result<std::vector<PoseLogRow>> read_pose_log(const std::filesystem::path& path) {
  SL_ASSIGN(CsvLines lines, CsvLines::open(path));
  return read_log_rows(std::move(lines));
}

Result<std::vector<TruthRow>> parse_truth(std::string_view text, const std::string& where) {
  return read_truth_rows(CsvLines(text, where));
}

Result<std::vector<TruthRow>> read_truth(const std::filesystem::path& path) {
  SL_ASSIGN(CsvLines lines, CsvLines::open(path));
  return read_truth_rows(std::move(lines));
}

Result<std::vector<ImageRow>> parse_image_list(std::string_view text,
                                               const std::filesystem::path& path) {
  constexpr std::string_view kHeader = "image,camera,tx,ty,tz,qw,qx,qy,qz";
  const std::string where = path.string();
  CsvLines lines(text, where);
  SL_RETURN_IF_ERROR(check_header(lines, kHeader));
  std::vector<ImageRow> rows;
  std::vector<std::string_view> fields;
  for (;;) {
    SL_ASSIGN(const auto line, lines.next());
    if (!line) break;
    split_fields(line->text, fields);
    SL_RETURN_IF_ERROR(check_field_count(fields.size(), 9, kHeader, where, line->number));
    if (fields[0].empty() || fields[1].empty()) {
      return make_error(ErrorCode::kInvalidInput, line_of(where, line->number), "names no {}",
                        fields[0].empty() ? "image" : "camera");
    }
    ImageRow row{path.parent_path() / fields[0], std::string(fields[1]), {}, line->number};
    SL_ASSIGN(row.world_from_object, parse_pose(fields, 2, where, line->number));
    rows.push_back(std::move(row));
  }
  if (!rows.empty()) return rows;
  return make_error(ErrorCode::kInvalidInput, where, "lists no image");
}

Result<std::vector<ImageRow>> read_image_list(const std::filesystem::path& path) {
  SL_ASSIGN(const std::string text, read_file(path));
  return parse_image_list(text, path);
}

}  // namespace sightline
