// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "sightline/base/unique_fd.hpp"
#include "sightline/base/waiting.hpp"
#include "sightline/record/recording_sink.hpp"

namespace sightline {
namespace {

std::string csv_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + '"';
}

}  // namespace

std::string_view to_string(RecordingKind kind) {
  switch (kind) {
    case RecordingKind::kViewing:
      return "viewing";
    case RecordingKind::kSource:
      return "source";
    case RecordingKind::kPoses:
      return "poses";
  }
  return "";
}

Status append_mark(const std::filesystem::path& folder, const RecordingMark& mark) {
  const std::string path = (folder / "marks.csv").string();
  const auto refused = [&] {
    return make_error(ErrorCode::kIo, path, "cannot write the mark: {}", std::strerror(errno));
  };
  const Waiting wait("the disk");
  const UniqueFd file(::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666));
  if (!file.is_open()) return refused();
  std::string text;
  if (::lseek(file.get(), 0, SEEK_END) == 0) text = "t_ns,utc_ns,text\n";
  text += fmt::format("{},{},{}\n", to_ns(mark.time), mark.utc_ns, csv_text(mark.text));
  if (::write(file.get(), text.data(), text.size()) != static_cast<ssize_t>(text.size())) {
    return refused();
  }
  return ::fdatasync(file.get()) == 0 ? Status() : Status(refused());
}

}  // namespace sightline
