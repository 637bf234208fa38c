// SPDX-License-Identifier: Apache-2.0
#include "daemon.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <exception>

#include "cell/shared_orders.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/log_output.hpp"
#include "system/gauge_report.hpp"
#include "system/system_exchange.hpp"
#include "system/system_status.hpp"
#include "web/calibration_json.hpp"
#include "web/content.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kForRecordings = 400ms;  // to finish them, at the end
constexpr Duration kForCapture = 100ms;     // to end: unless a solution is being made
constexpr Duration kWaitShown = 2s;         // shorter waits are part of the work

// Whatever a library throws over a strange file ends here.
template <typename Function>
auto guarded(const Function& function) -> decltype(function()) {
  try {
    return function();
  } catch (const std::bad_alloc&) {
    return make_error(ErrorCode::kInternal, "", "there is not enough memory for it");
  } catch (const std::exception& exception) {
    return make_error(ErrorCode::kInternal, "", "unexpected: {}", exception.what());
  }
}

Error stopping_error() {
  return make_error(ErrorCode::kUnavailable, "", "the daemon is being stopped");
}

}  // namespace

Daemon::Daemon(const DaemonOptions& options, std::shared_ptr<HttpWaker> waker)
    : options_(options),
      waker_(std::move(waker)),
      context_{options.record_to,
               registry_,
               beats_,
               sources_,
               std::make_shared<FrameTaps>(),
               std::make_shared<PoseFeed>(registry_, waker_),
               nullptr,
               nullptr,
               nullptr,
               {},
               {},
               options.request_reload},
      captures_(std::make_shared<CaptureService>(beats_, context_.taps)),
      orders_(options.request_orders, waker_) {
  system_.publish(std::make_shared<const System>());
  config_.publish(std::make_shared<const ConfigReport>());
  count_lost_messages();
}

Daemon::~Daemon() { (void)stop(); }

Result<std::unique_ptr<Daemon>> Daemon::start(Installation installation,
                                              const DaemonOptions& options, std::stop_token stop) {
  SL_ASSIGN(auto waker, HttpWaker::create());
  std::unique_ptr<Daemon> daemon(new Daemon(options, std::move(waker)));
  SL_RETURN_IF_ERROR(daemon->prepare_web());
  const std::filesystem::path file = installation.file;
  const std::string content = installation.content;
  daemon->overlays_.note_file(installation);
  SL_RETURN_IF_ERROR(guarded([&] { return daemon->replace(std::move(installation), stop); }));
  daemon->note_loaded(file, content);
  return daemon;
}

Status Daemon::prepare_web() {
  SL_ASSIGN(context_.pictures, PictureBoard::start(registry_, beats_, waker_));
  context_.recordings = RecordingManager::start(registry_, beats_, waker_, context_.taps);
  context_.whep = WhepService::start(options_.serve, beats_, waker_);
  context_.http = web_content({.registry = &registry_,
                               .health = [this] { return health(); },
                               .system = [this] { return system_.read(); },
                               .config = [this] { return config_.read(); },
                               .waits = [this] { return waits(); },
                               .request_reload = options_.request_reload,
                               .poses = context_.poses,
                               .pictures = context_.pictures,
                               .recordings = context_.recordings,
                               .whep = context_.whep,
                               .captures = captures_,
                               .waker = waker_});
  context_.on_order = [here = context_.http](const CellOrder& order) { obey(order, here); };
  share_orders(context_.http, [this] { return system_.read()->cell; });
  if (options_.request_orders) add_orders();
  return {};
}

Status Daemon::reload(const std::filesystem::path& file, std::stop_token stop) {
  const Status done = guarded([&]() -> Status {
    SL_ASSIGN(const Installation as_read, read_installation(file));
    Installation next = as_read;
    overlays_.carry_over(system_.read()->installation, next);
    const std::string content = next.content;
    const InstallationChanges changes = compare(system_.read()->installation, next);
    if (!broken_ && changes.none()) {
      log::info("reload: nothing differs");
    } else {
      SL_RETURN_IF_ERROR(replace(std::move(next), stop));
      log::info("reload: {}", changes.summary());
    }
    overlays_.note_file(as_read);
    note_loaded(file, content);
    return {};
  });
  if (!done) note_refused(done.error());
  return done;
}

Status Daemon::replace(Installation next, std::stop_token stop) {
  if (!options_.serve) next.rtsp.enabled = next.http.enabled = next.points.enabled = false;
  const auto old = system_.read();
  const Installation wanted = next;
  const Status done = guarded([&]() -> Status {
    SL_ASSIGN(SystemDraft draft, SystemBuilder(context_, *old).prepare(std::move(next), stop));
    const std::lock_guard lock(change_mutex_);
    if (stopping_) return stopping_error();
    return exchange(*old, std::move(draft));
  });
  if (!done) remove_metrics(registry_, wanted, system_.read()->installation);
  return done;
}

Status Daemon::exchange(const System& old, SystemDraft draft) {
  bool touched = false;
  const Status done = guarded([&]() -> Status {
    SystemExchange exchange(context_, old, std::move(draft));
    touched = true;
    if (const Status acquired = exchange.acquire(); !acquired) {
      touched = !exchange.old_is_whole();
      return acquired;
    }
    SL_RETURN_IF_ERROR(exchange.switch_over());
    touched = false;
    publish(exchange, old);
    return {};
  });
  if (!done && touched) restore(old);
  return done;
}

void Daemon::publish(SystemExchange& exchange, const System& old) {
  const auto next = std::make_shared<System>(exchange.system());
  log::set_level(next->installation.daemon.log_level);
  if (options_.serve)
    context_.recordings->configure(next->installation.record, next->installation.zones);
  system_.publish(next);
  broken_ = false;
  exchange.retire_old();
  if (next->rtsp != old.rtsp || next->http != old.http) {
    for (const std::string& address : addresses()) log::info("{}", address);
  }
  const auto points = exchange.start_points();
  if (points == next->points) return;
  const auto complete = std::make_shared<System>(*next);
  complete->points = points;
  system_.publish(complete);
}

void Daemon::restore(const System& old) {
  log::error("the change broke off halfway; the last good configuration is started again");
  broken_ = true;
  StopLeft left;
  (void)old.stop(left);
  System nothing;
  auto empty = std::make_shared<System>();
  empty->installation = old.installation;
  system_.publish(empty);
  const Status done = guarded([&]() -> Status {
    SL_ASSIGN(SystemDraft draft, SystemBuilder(context_, nothing).prepare(old.installation, {}));
    SystemExchange exchange(context_, nothing, std::move(draft));
    SL_RETURN_IF_ERROR(exchange.acquire());
    SL_RETURN_IF_ERROR(exchange.switch_over());
    publish(exchange, nothing);
    return {};
  });
  if (!done) log::error("it does not start: {}", done.error().message());
}

void Daemon::note_loaded(const std::filesystem::path& file, const std::string& content) {
  std::error_code error;
  ConfigReport report{file, content, utc_now_ns(), "", 0};
  report.calibration_report = std::filesystem::is_regular_file(
      calibration_report_file(system_.read()->installation), error);
  registry_.remove("content", config_.read()->content);
  registry_
      .gauge("sightline_config_info", "1 for the configuration that is in force",
             {{"file", file.string()}, {"content", report.content}})
      .set(1);
  registry_
      .gauge("sightline_config_loaded_timestamp_seconds",
             "When the configuration in force was loaded, UTC")
      .set(static_cast<double>(report.loaded_utc_ns) * 1e-9);
  registry_.gauge("sightline_config_refused", "1 while the newest configuration is refused").set(0);
  config_.publish(std::make_shared<const ConfigReport>(std::move(report)));
}

void Daemon::note_refused(const Error& error) {
  ConfigReport report = *config_.read();
  report.refused = error.message();
  report.refused_utc_ns = utc_now_ns();
  registry_.gauge("sightline_config_refused", "1 while the newest configuration is refused").set(1);
  config_.publish(std::make_shared<const ConfigReport>(std::move(report)));
}

Status Daemon::stop(StopLeft* left) {
  const std::lock_guard lock(change_mutex_);
  stopping_ = true;
  StopLeft unsaid;
  StopLeft& all = left != nullptr ? *left : unsaid;
  const bool capture_ended = captures_->stop(kForCapture);
  Status done = system_.read()->stop(all);
  if (!capture_ended && !captures_->stop(kForCapture)) {
    all.what.emplace_back("the solution of a capture");
  }
  for (std::string& what : context_.recordings->stop(kForRecordings)) {
    all.what.push_back(std::move(what));
    all.recording = true;
  }
  return done;
}

void Daemon::tell_waits() {
  wait_report_.tell(waits(), MonotonicClock::now());
  const auto system = system_.read();
  report_gauges(*system, *context_.recordings, registry_);
  if (!system->cell) return;
  std::vector<bool> away;
  for (const auto& camera : system->cameras) away.push_back(!camera->status().present);
  system->cell->set_away(std::move(away));
}

std::vector<std::string> Daemon::stalled() const {
  auto names = beats_.stalled(MonotonicClock::now());
  if (broken_) names.emplace_back("the whole system");
  return names;
}

std::vector<ThreadWait> Daemon::waits() const {
  return beats_.waits(MonotonicClock::now(), kWaitShown);
}

bool Daemon::ended() const {
  const auto system = system_.read();
  return !system->cameras.empty() && std::ranges::all_of(system->cameras, [](const auto& camera) {
    return camera->status().ended;
  });
}

bool Daemon::recording() const {
  const auto system = system_.read();
  return system->recorder && !system->recorder->status().folder.empty();
}

std::string Daemon::record_problem() const {
  const auto system = system_.read();
  return system->recorder ? system->recorder->status().problem : "";
}

std::vector<std::string> Daemon::addresses() const {
  const auto system = system_.read();
  std::vector<std::string> out;
  for (const auto& camera : system->cameras) {
    if (camera->output()) out.push_back(camera->output()->url());
  }
  for (const auto& view : system->views) out.push_back(view->output()->url());
  if (system->http) {
    const std::string& address = system->http->options().address;
    const bool v6 = address.find(':') != std::string::npos;
    const std::string scheme = system->http->options().tls.any() ? "https://" : "http://";
    const std::string host =
        scheme + (v6 ? "[" + address + "]" : address) + ":" + std::to_string(system->http->port());
    out.push_back(host + "/");
    out.push_back(host + "/metrics");
  }
  return out;
}

std::string Daemon::status_line() const {
  return sightline::status_line(*system_.read(), *config_.read(), waits());
}

Health Daemon::health() const {
  const auto names = stalled();
  if (names.empty()) return {true, status_line()};
  return {false, "no progress in " + fmt::format("{}", fmt::join(names, ", "))};
}

void Daemon::count_lost_messages() {
  Counter& counter =
      registry_.counter("sightline_log_messages_lost_total",
                        "Log messages that were dropped since nobody read them in time");
  counter.add(log::lost() - counter.value());
}

}  // namespace sightline
