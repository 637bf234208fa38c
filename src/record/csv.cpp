// SPDX-License-Identifier: Apache-2.0
#include "record/csv.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace sightline::record {

namespace {

constexpr size_t kPiece = size_t{1} << 20;
constexpr size_t kLongestLine = size_t{64} << 10;
constexpr size_t kMostZeros = size_t{64} << 20;

}  // namespace

Result<CsvLines> CsvLines::open(const std::filesystem::path& path) {
  CsvLines lines({}, path.string());
  // O_NONBLOCK: opening a FIFO by mistake must not hang.
  lines.file_ = UniqueFd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!lines.file_.is_open()) {
    const bool missing = errno == ENOENT || errno == ENOTDIR || errno == ELOOP;
    return make_error(missing ? ErrorCode::kNotFound : ErrorCode::kIo, lines.where_,
                      "cannot open: {}", std::strerror(errno));
  }
  struct stat info {};
  if (::fstat(lines.file_.get(), &info) != 0 || !S_ISREG(info.st_mode)) {
    return make_error(ErrorCode::kInvalidInput, lines.where_, "not a regular file");
  }
  return lines;
}

Status CsvLines::fill() {
  const size_t kept = rest_.size();
  if (buffer_.size() < kLongestLine + kPiece) buffer_.resize(kLongestLine + kPiece);
  if (kept > 0) std::memmove(buffer_.data(), rest_.data(), kept);
  rest_ = {buffer_.data(), kept};
  ssize_t got = 0;
  do {
    got = ::read(file_.get(), buffer_.data() + kept, kPiece);
  } while (got < 0 && errno == EINTR);
  if (got < 0) {
    return make_error(ErrorCode::kIo, where_, "cannot read: {}", std::strerror(errno));
  }
  if (got == 0) {
    file_.reset();
    return {};
  }
  const std::string_view piece(buffer_.data() + kept, static_cast<size_t>(got));
  const size_t used = piece.find_last_not_of('\0') + 1;
  if (used > 0 && zeros_ > 0) {
    return make_error(ErrorCode::kInvalidInput, where_,
                      "{} zeros after line {}, and more text behind them; the "
                      "file is damaged",
                      zeros_, number_);
  }
  zeros_ += piece.size() - used;
  if (zeros_ > kMostZeros) {
    return make_error(ErrorCode::kInvalidInput, where_,
                      "more than {} zeros after line {}; the file is damaged: cut it there",
                      kMostZeros, number_);
  }
  rest_ = {buffer_.data(), kept + used};
  return {};
}

Error CsvLines::too_long() const {
  return make_error(ErrorCode::kInvalidInput, line_of(where_, number_ + 1),
                    "a line of more than {} bytes; this is no CSV file of a recording",
                    kLongestLine);
}

Result<std::optional<CsvLines::Line>> CsvLines::next() {
  size_t end = rest_.find('\n');
  while (end == std::string_view::npos && file_.is_open()) {
    if (rest_.size() > kLongestLine) return too_long();
    const size_t searched = rest_.size();
    SL_RETURN_IF_ERROR(fill());
    end = rest_.find('\n', searched);
  }
  if (rest_.empty()) return std::optional<Line>();
  Line line{rest_.substr(0, end), number_ + 1, end != std::string_view::npos};
  if (line.text.size() > kLongestLine) return too_long();
  ++number_;
  rest_.remove_prefix(line.ended ? end + 1 : rest_.size());
  if (line.text.ends_with('\r')) line.text.remove_suffix(1);
  return std::optional(line);
}

void split_fields(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  for (;;) {
    const size_t comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

std::string line_of(const std::string& where, size_t number) {
  return fmt::format("{}:{}", where, number);
}

Result<Time> parse_time(std::string_view field, const char* column, const std::string& where,
                        size_t line) {
  SL_ASSIGN(const int64_t ns, parse_whole<int64_t>(field, column, where, line, 0, kMaxTimeNs));
  return time_from_ns(ns);
}

Result<double> parse_finite(std::string_view field, const char* column, const std::string& where,
                            size_t line) {
  double value = 0;
  const char* end = field.data() + field.size();
  const auto [stop, fault] = std::from_chars(field.data(), end, value);
  if (field.empty() || fault != std::errc() || stop != end || !std::isfinite(value)) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                      "column {} is '{}', expected a finite number", column, field.substr(0, 40));
  }
  return value;
}

Status check_header(CsvLines& lines, std::string_view header) {
  SL_ASSIGN(const auto line, lines.next());
  if (line && line->text == header) return {};
  return make_error(ErrorCode::kInvalidInput, line_of(lines.where(), 1),
                    "first line is '{}', expected '{}'", line ? line->text.substr(0, 100) : "",
                    header);
}

Status check_field_count(size_t found, size_t expected, std::string_view header,
                         const std::string& where, size_t line) {
  if (found == expected) return {};
  return make_error(ErrorCode::kInvalidInput, line_of(where, line), "{} columns, expected {}: {}",
                    found, expected, header);
}

Result<size_t> parse_camera(std::string_view field, std::span<const std::string> cameras,
                            const std::string& where, size_t line) {
  const auto camera = std::find(cameras.begin(), cameras.end(), field);
  if (camera == cameras.end()) {
    return make_error(ErrorCode::kInvalidInput, line_of(where, line),
                      "camera '{}' is not in recording.toml", field.substr(0, 40));
  }
  return static_cast<size_t>(camera - cameras.begin());
}

}  // namespace sightline::record
