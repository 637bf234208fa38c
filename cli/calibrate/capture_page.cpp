// SPDX-License-Identifier: Apache-2.0
#include "calibrate/capture_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "calibration/capture_words.hpp"
#include "system/servers.hpp"

namespace sightline::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

constexpr Duration kLooking = 3s;   // who asked so recently still looks
constexpr Duration kFarewell = 3s;  // that is waited for whoever looks

constexpr std::string_view kHead = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Calibration: capture</title>
<style>
:root{color-scheme:light dark;--ink:#1c1c1a;--ground:#fff;--soft:#55554f;--bar:#1f5f8b;
--warn:#a33b00;--good:#1b6a35}
@media(prefers-color-scheme:dark){:root{--ink:#f2f1ec;--ground:#161715;--soft:#b9b8b0;--bar:#79b8e6;
--warn:#ffab73;--good:#7fd69a}}
body{font:17px/1.4 system-ui,sans-serif;margin:0 auto;padding:.8rem;max-width:75rem;
color:var(--ink);background:var(--ground)}
h1{font-size:1rem;margin:0;color:var(--soft)}
#words{font-size:1.7rem;font-weight:600;line-height:1.2;margin:.4rem 0;min-height:4.2rem}
#words.good{color:var(--good)}#words.bad{color:var(--warn)}
#hint{font-size:1.2rem;min-height:1.7rem;margin:0;color:var(--warn)}
progress{width:100%;height:1rem;accent-color:var(--bar)}
#pictures{display:grid;gap:.8rem;margin-top:.8rem;
grid-template-columns:repeat(auto-fill,minmax(min(21rem,100%),1fr))}
#pictures svg{width:100%;height:auto}
#stale{color:var(--warn);font-weight:600;min-height:1.5rem}
body.stale main{opacity:.45}body.taken #words{outline:.3rem solid var(--good)}
</style></head><body><h1>Calibration: capture</h1><main>
<p id="words" role="status" aria-live="polite">The cameras are being opened.</p>
<p id="hint"></p>
<progress id="share" max="100" value="0" aria-label="what has been taken of what is needed">
</progress>
<p id="sets"></p><div id="pictures"></div><p id="links"></p></main>
<p id="stale" role="alert"></p>
)";
constexpr std::string_view kScript = R"(
const at = (id) => document.getElementById(id);
let last = Date.now(), sets = -1, drawn = '', over = false;
const put = (element, text) => { if (element.textContent !== text) element.textContent = text; };
const show = (now) => {
  put(at('words'), now.words);
  at('words').className = now.over ? (now.good ? 'good' : 'bad') : '';
  put(at('hint'), now.hint);
  at('share').value = now.share;
  const sets_taken = `${now.sets} ${now.sets === 1 ? 'set' : 'sets'} taken`;
  put(at('sets'), `${sets_taken}, ${now.share} % of what is needed`);
  if (sets >= 0 && now.sets > sets) {
    document.body.classList.add('taken');
    setTimeout(() => document.body.classList.remove('taken'), 700);
    if (navigator.vibrate && navigator.userActivation?.hasBeenActive) navigator.vibrate(150);
  }
  sets = now.sets;
  if (now.drawn !== drawn) {
    drawn = now.drawn;
    at('pictures').innerHTML = now.pictures;
    put(at('links'), now.links);
  }
  over = now.over;
};
const look = async () => {
  try {
    const answer = await fetch('/api/v1/state', { signal: AbortSignal.timeout(3000) });
    if (answer.ok) { show(await answer.json()); last = Date.now(); }
  } catch { /* it is said below for how long */ }
  const old = Math.round((Date.now() - last) / 1000);
  document.body.classList.toggle('stale', old >= 3 && !over);
  put(at('stale'), old >= 3 && !over ? `No word from the rig for ${old} s.` : '');
  if (!over) setTimeout(look, 400);
};
look();
)";

// Nobody can guess it: only the script above runs, whatever gets into the page.
std::string nonce() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
}

HttpReply page() {
  const std::string once = nonce();
  HttpReply reply{
      200, "text/html; charset=utf-8",
      fmt::format("{}<script nonce=\"{}\">{}</script></body></html>\n", kHead, once, kScript)};
  reply.headers.emplace_back(
      "Content-Security-Policy",
      fmt::format("default-src 'none'; style-src 'unsafe-inline'; script-src 'nonce-{}'; "
                  "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
                  once));
  return reply;
}

std::string links_of(const CaptureSession& session, const std::vector<std::string>& cameras) {
  std::string text;
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      const size_t sets = session.links(a, b);
      if (sets == 0) continue;
      text += fmt::format("{} and {} saw it together {} time{}. ", cameras[a], cameras[b], sets,
                          sets == 1 ? "" : "s");
    }
  }
  return text;
}

}  // namespace

struct CapturePage::Shared {
  std::mutex mutex;  // guards all below
  std::string json = "{}";
  bool over = false, told = false;
  Time asked = Time::min();

  std::string ask() {
    const std::lock_guard lock(mutex);
    asked = MonotonicClock::now();
    told = over;
    return json;
  }
};

CapturePage::CapturePage(std::vector<std::string> cameras, std::shared_ptr<Shared> shared)
    : cameras_(std::move(cameras)), shared_(std::move(shared)) {}

CapturePage::~CapturePage() {
  if (service_) service_->stop();
}

Result<std::unique_ptr<CapturePage>> CapturePage::start(const HttpOptions& options,
                                                        std::vector<std::string> cameras) {
  const auto shared = std::make_shared<Shared>();
  std::unique_ptr<CapturePage> made(new CapturePage(std::move(cameras), shared));
  HttpContent content;
  content.home = page;
  content.state_json = [shared] { return shared->ask(); };
  SL_ASSIGN(made->service_, HttpService::start(options, content));
  const bool v6 = options.address.find(':') != std::string::npos;
  made->address_ =
      fmt::format("{}://{}{}{}:{}/", options.tls.any() ? "https" : "http", v6 ? "[" : "",
                  options.address, v6 ? "]" : "", made->service_->port());
  return made;
}

void CapturePage::show(const CaptureSession& session, const CaptureState& state) {
  const std::string words = next_words(state, cameras_);
  const auto share = static_cast<int>(std::floor(100 * std::clamp(state.share, 0.0, 1.0)));
  const std::string hint = state.passed ? "" : hint_words(state.step);
  const std::string seen = fmt::format("{} {} {} {}", words, hint, share, state.sets);
  if (seen == seen_) return;
  seen_ = seen;
  pictures_.clear();
  for (size_t c = 0; c < cameras_.size(); ++c) {
    pictures_ += "<div role=\"img\" aria-label=\"coverage of camera " + cameras_[c] + "\">" +
                 session.coverage_svg(c) + "</div>";
  }
  const Json json{{"words", words},
                  {"hint", hint},
                  {"share", share},
                  {"sets", state.sets},
                  {"links", links_of(session, cameras_)},
                  {"over", false},
                  {"good", false},
                  {"drawn", std::to_string(std::hash<std::string>()(pictures_))},
                  {"pictures", pictures_}};
  std::string text = json.dump();
  const std::lock_guard lock(shared_->mutex);
  shared_->json = std::move(text);
}

void CapturePage::finish(const std::string& words, bool good) {
  {
    const std::lock_guard lock(shared_->mutex);
    Json json = Json::parse(shared_->json, nullptr, false);
    if (!json.is_object()) json = Json::object();
    json["words"] = words;
    json["hint"] = "";
    json["over"] = true;
    json["good"] = good;
    for (const char* number : {"share", "sets"}) json.emplace(number, 0);
    for (const char* text : {"links", "drawn", "pictures"}) json.emplace(text, "");
    shared_->json = json.dump(-1, ' ', false, Json::error_handler_t::replace);
    shared_->over = true;
  }
  const Time end = MonotonicClock::now() + kFarewell;
  for (;;) {
    {
      const std::lock_guard lock(shared_->mutex);
      const Time now = MonotonicClock::now();
      const bool looking = shared_->asked != Time::min() && now - shared_->asked < kLooking;
      if (shared_->told || !looking || now > end) break;
    }
    std::this_thread::sleep_for(50ms);
  }
  std::this_thread::sleep_for(100ms);  // the answer is on its way
}

}  // namespace sightline::cli
