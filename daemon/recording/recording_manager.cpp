// SPDX-License-Identifier: Apache-2.0
#include "recording/recording_manager.hpp"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "sightline/base/log.hpp"
#include "web/utc_text.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

using Json = nlohmann::ordered_json;

bool starts(const RecordConfig& config, RecordingKind kind) {
  return config.enabled && RecordConfig::names(config.kinds, kind);
}

std::string_view type_of(const std::string& file) {
  const size_t dot = file.find_last_of('.');
  const std::string_view ending =
      dot == std::string::npos ? "" : std::string_view(file).substr(dot);
  if (ending == ".mp4") return "video/mp4";
  if (ending == ".mkv") return "video/x-matroska";
  if (ending == ".csv") return "text/csv; charset=utf-8";
  return "application/octet-stream";
}

struct ByteRange {
  uint64_t first = 0, size = 0;
};

// RFC 9110, 14.1.2, of one range; nullopt: another form, which may be ignored. An Error: there is
// nothing in it.
Result<std::optional<ByteRange>> parse_range(std::string_view text, uint64_t bytes) {
  const auto none = std::optional<ByteRange>();
  constexpr std::string_view kUnit = "bytes=";
  if (!text.starts_with(kUnit)) return none;
  text.remove_prefix(kUnit.size());
  const size_t dash = text.find('-');
  if (dash == std::string_view::npos) return none;
  const auto number = [](std::string_view digits) -> std::optional<uint64_t> {
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
    return value;
  };
  const auto first = number(text.substr(0, dash)), last = number(text.substr(dash + 1));
  if ((!first && dash > 0) || (!last && dash + 1 < text.size()) || (!first && !last)) return none;
  const Error empty{ErrorCode::kInvalidInput, "there is nothing in that range", ""};
  if (bytes == 0) return empty;
  if (!first) {
    if (*last == 0) return empty;
    const uint64_t size = std::min(*last, bytes);
    return std::optional(ByteRange{bytes - size, size});
  }
  if (last && *last < *first) return none;
  if (*first >= bytes) return empty;
  return std::optional(
      ByteRange{*first, std::min(last.value_or(bytes - 1), bytes - 1) - *first + 1});
}

Json status_json(RecordingKind kind, const RecordingSinkStatus& status) {
  const bool writing = !status.folder.empty();
  Json json{{"kind", to_string(kind)},
            {"state", writing         ? "recording"
                      : status.wanted ? "stopped"
                                      : "off"},
            {"dropped", status.dropped}};
  if (writing) {
    json["name"] = status.folder.filename().string();
    json["written"] = status.written;
  }
  if (writing && status.since_utc_ns > 0) json["since"] = utc_text(status.since_utc_ns);
  if (!status.problem.empty()) json["problem"] = status.problem;
  return json;
}

}  // namespace

std::shared_ptr<RecordingManager> RecordingManager::start(Registry& registry, HeartbeatBoard& beats,
                                                          std::shared_ptr<HttpWaker> waker,
                                                          std::shared_ptr<FrameTaps> taps) {
  std::shared_ptr<RecordingManager> manager(new RecordingManager());
  manager->taps_ = std::move(taps);
  manager->zones_ = std::make_shared<ZoneWatch>(registry);
  manager->config_.publish(std::make_shared<const RecordConfig>());
  manager->viewing_ = RecordingSinkWorker::start(RecordingKind::kViewing, registry, beats);
  manager->poses_ = RecordingSinkWorker::start(RecordingKind::kPoses, registry, beats);
  manager->viewing_->pass_on_to(manager->poses_);
  manager->library_ =
      RecordingLibrary::start(registry, beats, std::move(waker), [raw = manager.get()] {
        std::set<std::filesystem::path> active;
        for (const RecordingKind kind : kRecordingKinds) {
          const auto folder = raw->status(kind).folder;
          if (!folder.empty()) active.insert(folder);
        }
        return active;
      });
  return manager;
}

void RecordingManager::configure(const RecordConfig& config, const std::vector<ZoneConfig>& zones) {
  zones_->configure(zones);
  std::set<RecordingKind> by_zones;
  for (const ZoneConfig& zone : zones) by_zones.insert(zone.record.begin(), zone.record.end());
  const RecordConfig before = *config_.read();
  if (before == config && by_zones == by_zones_) return;
  by_zones_ = by_zones;
  config_.publish(std::make_shared<const RecordConfig>(config));
  const auto ready = [&](RecordingKind kind) {
    const bool by_event = RecordConfig::names(config.on_lost, kind) || by_zones.contains(kind);
    return by_event ? config.before : Duration(0);
  };
  viewing_->configure({config.directory,
                       [options = config.viewing](const std::filesystem::path& folder) {
                         return make_viewing_writer(folder, options);
                       },
                       true, ready(RecordingKind::kViewing)});
  poses_->configure(
      {config.directory,
       [files = config.pose_files, parts = config.viewing](const std::filesystem::path& folder) {
         return make_poses_writer(folder, files, parts);
       },
       config.pose_video && config.pose_files != PoseFiles::kCsv, ready(RecordingKind::kPoses)});
  library_->configure(config.directory, static_cast<uint64_t>(config.quota_gb * 1e9));
  for (const auto& [kind, recorder] :
       {std::pair(RecordingKind::kViewing, viewing_), std::pair(RecordingKind::kPoses, poses_)}) {
    if (starts(config, kind) && !starts(before, kind)) recorder->begin({}, "by the configuration");
    if (!starts(config, kind) && starts(before, kind)) recorder->end("by the configuration");
  }
}

void RecordingManager::push(const PoseEstimate& estimate, bool of_frame) {
  note_lost(estimate);
  note_zones(estimate);
  if (!of_frame || !poses_->wants()) return;
  if (auto names = names_.read()) poses_->push(PoseFeed::Entry{estimate, std::move(names)});
}

void RecordingManager::note_lost(const PoseEstimate& estimate) {
  const size_t index = estimate.object.index();
  if (index >= states_.size()) states_.resize(index + 1, TrackState::kSearching);
  const TrackState before = std::exchange(states_[index], estimate.state);
  if (!has_pose(before) || has_pose(estimate.state)) return;
  const auto config = config_.read();
  if (config->on_lost.empty()) return;
  const auto names = names_.read();
  const std::string object =
      names && index < names->objects.size() ? names->objects[index] : "an object";
  for (const RecordingKind kind : config->on_lost) {
    begin(kind, config->after, object + " is lost");
  }
}

void RecordingManager::note_zones(const PoseEstimate& estimate) {
  const auto names = names_.read();
  const size_t index = estimate.object.index();
  if (!names || index >= names->objects.size()) return;
  std::string why;
  const auto kinds = zones_->take(estimate, names->objects[index], why);
  if (kinds.empty()) return;
  const Duration after = config_.read()->after;
  for (const RecordingKind kind : kinds) begin(kind, after, why);
}

void RecordingManager::begin(RecordingKind kind, std::optional<Duration> for_at_most,
                             const std::string& why) {
  if (kind == RecordingKind::kViewing) viewing_->begin(for_at_most, why);
  if (kind == RecordingKind::kPoses) poses_->begin(for_at_most, why);
  if (kind != RecordingKind::kSource) return;
  if (const auto source = taps_->recorder.read()) source->begin(for_at_most);
}

void RecordingManager::end(RecordingKind kind, const std::string& why) {
  if (kind == RecordingKind::kViewing) viewing_->end(why);
  if (kind == RecordingKind::kPoses) poses_->end(why);
  if (kind != RecordingKind::kSource) return;
  if (const auto source = taps_->recorder.read()) source->end();
}

RecordingSinkStatus RecordingManager::status(RecordingKind kind) const {
  if (kind == RecordingKind::kViewing) return viewing_->status();
  if (kind == RecordingKind::kPoses) return poses_->status();
  const auto source = taps_->recorder.read();
  if (!source) return {};
  const RecordingStatus status = source->status();
  return {source->wanted(),    status.folder,     status.problem,
          status.since_utc_ns, source->written(), source->dropped()};
}

Result<std::vector<RecordingKind>> RecordingManager::kinds_of(const RecordingOrder& order) const {
  const auto config = config_.read();
  if (config->directory.empty()) {
    return make_error(ErrorCode::kUnavailable, "",
                      "no folder takes recordings: name it under [record] directory");
  }
  if (order.kinds.empty()) return config->kinds;
  std::vector<RecordingKind> kinds;
  for (const std::string& name : order.kinds) {
    const auto known = std::ranges::find(kRecordingKinds, name,
                                         [](RecordingKind kind) { return to_string(kind); });
    if (known == std::end(kRecordingKinds)) {
      return make_error(ErrorCode::kInvalidInput, name,
                        "there is no such kind; there are viewing, source, poses");
    }
    kinds.push_back(*known);
  }
  return kinds;
}

Status RecordingManager::begin(const RecordingOrder& order) {
  SL_ASSIGN(const auto kinds, kinds_of(order));
  std::optional<Duration> time;
  if (order.seconds) time = from_seconds(*order.seconds);
  for (const RecordingKind kind : kinds) begin(kind, time, "by order");
  return {};
}

Status RecordingManager::end(const RecordingOrder& order) {
  if (order.kinds.empty()) {
    for (const RecordingKind kind : kRecordingKinds) end(kind, "by order");
    return {};
  }
  SL_ASSIGN(const auto kinds, kinds_of(order));
  for (const RecordingKind kind : kinds) end(kind, "by order");
  return {};
}

Status RecordingManager::mark(const std::string& text) {
  std::vector<std::filesystem::path> folders;
  for (const RecordingKind kind : kRecordingKinds) {
    const auto folder = status(kind).folder;
    if (!folder.empty()) folders.push_back(folder);
  }
  if (folders.empty()) {
    return make_error(ErrorCode::kUnavailable, "", "nothing is being recorded now");
  }
  const Time now = MonotonicClock::now();
  library_->mark(std::move(folders), {now, utc_ns_of(now), text});
  return {};
}

std::string RecordingManager::json() const {
  const auto list = library_->list();
  Json json{{"directory", list->directory.string()},
            {"bytes", list->bytes},
            {"kinds", Json::array()},
            {"recordings", Json::array()}};
  if (!list->problem.empty()) json["problem"] = list->problem;
  for (const RecordingKind kind : kRecordingKinds) {
    json["kinds"].push_back(status_json(kind, status(kind)));
  }
  for (const auto& recording : list->recordings) {
    Json files = Json::array();
    for (const auto& file : recording.files) {
      files.push_back({{"name", file.name}, {"bytes", file.bytes}});
    }
    json["recordings"].push_back({{"name", recording.name},
                                  {"kind", to_string(recording.kind)},
                                  {"bytes", recording.bytes},
                                  {"changed", utc_text(recording.changed_utc_ns)},
                                  {"files", std::move(files)}});
  }
  return json.dump(2) + "\n";
}

Result<HttpReply> RecordingManager::file(const std::string& name, const std::string& file,
                                         const std::string& range) const {
  const auto list = library_->list();
  const RecordingList::File* const found = list->find(name, file);
  if (found == nullptr) {
    return make_error(ErrorCode::kNotFound, name + "/" + file, "there is no such recording");
  }
  HttpReply reply{200, std::string(type_of(file)), ""};
  reply.headers.emplace_back("Accept-Ranges", "bytes");
  const auto asked = parse_range(range, found->bytes);
  if (!asked) {
    HttpReply nothing = HttpReply::error(416, asked.error().text);
    nothing.headers.emplace_back("Content-Range", fmt::format("bytes */{}", found->bytes));
    return nothing;
  }
  const ByteRange part = asked->value_or(ByteRange{0, found->bytes});
  if (*asked) {
    reply.status = 206;
    reply.headers.emplace_back(
        "Content-Range",
        fmt::format("bytes {}-{}/{}", part.first, part.first + part.size - 1, found->bytes));
  }
  if (part.size == 0) return reply;
  reply.length = part.size;
  reply.stream = library_->read(list->directory / name / file, part.first, part.size);
  return reply;
}

std::string RecordingManager::problem() const {
  for (const RecordingKind kind : kRecordingKinds) {
    const std::string text = status(kind).problem;
    if (!text.empty()) return fmt::format("{}: {}", to_string(kind), text);
  }
  return "";
}

std::vector<std::string> RecordingManager::stop(Duration patience) {
  const Time end = MonotonicClock::now() + patience;
  const auto rest = [end] { return std::max<Duration>(end - MonotonicClock::now(), 0ns); };
  std::vector<std::string> left;
  if (!viewing_->stop_unless_waiting(rest())) left.emplace_back("the viewing recording");
  if (!poses_->stop_unless_waiting(rest())) left.emplace_back("the recording of poses");
  if (!library_->stop_unless_waiting(rest())) left.emplace_back("the list of recordings");
  return left;
}

}  // namespace sightline
