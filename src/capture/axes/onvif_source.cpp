// SPDX-License-Identifier: Apache-2.0
//
// ONVIF PTZ over HTTP: its status is asked for some 20 times a second. Requests wait for 200 ms at
// the longest, those of the beginning for a second.
#include <curl/curl.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <thread>

#include "capture/axes/axis_sources.hpp"
#include "capture/axes/onvif_messages.hpp"
#include "sightline/base/files.hpp"

namespace sightline::capture {
namespace {

using namespace std::chrono_literals;

constexpr Duration kPeriod = 50ms;
constexpr long kPatienceMs = 200, kOpenPatienceMs = 1000;
constexpr int kMostFailures = 5;  // in a row
constexpr size_t kLongestAnswer = 1 << 18;
constexpr double kDegree = std::numbers::pi / 180;
constexpr size_t kMostPassword = 4096;  // bytes

struct Cleanup {
  void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};

size_t append(const char* data, size_t size, size_t count, void* to) {
  auto& answer = *static_cast<std::string*>(to);
  if (answer.size() + size * count > kLongestAnswer) return 0;
  answer.append(data, size * count);
  return size * count;
}

Result<std::string> password_of(const AxisSourceOptions& options) {
  if (options.password_file.empty()) return std::string();
  SL_ASSIGN(const std::string text, read_file(options.password_file, kMostPassword));
  return text.substr(0, text.find_first_of("\r\n"));
}

/// One connection to a camera's services.
class SoapClient {
 public:
  static Result<SoapClient> create(const AxisSourceOptions& options, const std::string& name) {
    static const CURLcode started = curl_global_init(CURL_GLOBAL_DEFAULT);
    std::unique_ptr<CURL, Cleanup> handle(started == CURLE_OK ? curl_easy_init() : nullptr);
    std::unique_ptr<curl_slist, Cleanup> headers(
        curl_slist_append(nullptr, "Content-Type: application/soap+xml; charset=utf-8"));
    if (!handle || !headers) {
      return make_error(ErrorCode::kInternal, name, "libcurl cannot be used");
    }
    curl_easy_setopt(handle.get(), CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(handle.get(), CURLOPT_PROTOCOLS_STR, "http");
    curl_easy_setopt(handle.get(), CURLOPT_PROXY, "");
    curl_easy_setopt(handle.get(), CURLOPT_HTTPHEADER, headers.get());
    curl_easy_setopt(handle.get(), CURLOPT_WRITEFUNCTION, append);
    if (!options.user.empty()) {
      SL_ASSIGN(const std::string password, password_of(options));
      curl_easy_setopt(handle.get(), CURLOPT_HTTPAUTH, CURLAUTH_DIGEST);
      curl_easy_setopt(handle.get(), CURLOPT_USERNAME, options.user.c_str());
      curl_easy_setopt(handle.get(), CURLOPT_PASSWORD, password.c_str());
    }
    const bool v6 = options.host.find(':') != std::string::npos;
    std::string base = "http://" + (v6 ? "[" + options.host + "]" : options.host) + ":" +
                       std::to_string(options.port);
    return SoapClient(std::move(handle), std::move(headers), std::move(base), name);
  }

  Result<std::string> ask(const std::string& path, const std::string& body, long patience_ms) {
    CURL* const handle = handle_.get();
    std::string answer;
    const std::string url = base_ + path;
    curl_easy_setopt(handle, CURLOPT_URL, url.c_str());
    curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE, static_cast<long>(body.size()));
    curl_easy_setopt(handle, CURLOPT_COPYPOSTFIELDS, body.c_str());
    curl_easy_setopt(handle, CURLOPT_WRITEDATA, &answer);
    curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS, patience_ms);
    const CURLcode code = curl_easy_perform(handle);
    if (code != CURLE_OK) {
      return make_error(ErrorCode::kUnavailable, name_, "{} does not answer: {}", url,
                        curl_easy_strerror(code));
    }
    long status = 0;
    curl_easy_getinfo(handle, CURLINFO_RESPONSE_CODE, &status);
    if (status == 401 || status == 403) {
      return make_error(ErrorCode::kInvalidInput, name_,
                        "{} refuses: give its user as axes_user and axes_password_file", url);
    }
    if (const std::string fault = parse_onvif_fault(answer); !fault.empty()) {
      return make_error(ErrorCode::kUnavailable, name_, "{} refuses: {}", url, fault);
    }
    if (status != 200) {
      return make_error(ErrorCode::kUnavailable, name_, "{} answers with status {}", url, status);
    }
    return answer;
  }

 private:
  SoapClient(std::unique_ptr<CURL, Cleanup> handle, std::unique_ptr<curl_slist, Cleanup> headers,
             std::string base, std::string name)
      : headers_(std::move(headers)),
        handle_(std::move(handle)),
        base_(std::move(base)),
        name_(std::move(name)) {}

  std::unique_ptr<curl_slist, Cleanup> headers_;  // outlives the handle
  std::unique_ptr<CURL, Cleanup> handle_;
  std::string base_, name_;
};

class OnvifSource final : public AxisSource {
 public:
  OnvifSource(SoapClient client, std::string path, std::string profile,
              const AxisSourceOptions& options)
      : client_(std::move(client)),
        path_(std::move(path)),
        profile_(std::move(profile)),
        unit_(options.degrees_per_unit * kDegree),
        fastest_(options.fastest) {}

  Result<std::optional<AxisReading>> next(Duration timeout) override {
    if (order_) send_order();
    const Duration early = asked_ + kPeriod - MonotonicClock::now();
    if (early > timeout) {
      sleep_for(timeout);
      return std::optional<AxisReading>();
    }
    sleep_for(std::max<Duration>(early, 0ms));
    asked_ = MonotonicClock::now();
    const auto answer = client_.ask(path_, format_onvif_get_status(profile_), kPatienceMs);
    const Time answered = MonotonicClock::now();
    const auto status = answer ? parse_onvif_status(*answer) : std::optional<OnvifStatus>();
    if (!status) {
      ++counts_.bad;
      if (++failures_ >= kMostFailures && !answer) return answer.error();
      return std::optional<AxisReading>();
    }
    failures_ = 0;
    ++counts_.good;
    degrees_ = status->degrees;
    AxisReading reading;
    reading.stamp = asked_ + (answered - asked_) / 2;
    reading.pan = status->pan * unit();
    reading.tilt = status->tilt * unit();
    reading.zoom = status->zoom;
    reading.moving = status->moving;
    return std::optional(reading);
  }
  Counts counts() const override { return counts_; }
  void turn(const HeadOrder& order) override { order_ = order; }

 private:
  double unit() const { return degrees_ ? kDegree : unit_; }

  static void sleep_for(Duration time) { std::this_thread::sleep_for(time); }

  // Not before the first status: it says how places are counted.
  void send_order() {
    if (counts_.good == 0) return;
    const auto share = [this](double rate) {
      return std::clamp(std::abs(rate) / fastest_, 0.01, 1.0);
    };
    const HeadAngles speed(share(order_->rate.x()), share(order_->rate.y()));
    const auto body = format_onvif_move(profile_, order_->place / unit(), degrees_, speed);
    order_.reset();
    ++counts_.ordered;
    if (!client_.ask(path_, body, kPatienceMs)) ++counts_.refused;
  }

  SoapClient client_;
  const std::string path_, profile_;
  const double unit_, fastest_;  ///< [rad], [rad/s]
  bool degrees_ = false;
  Time asked_{};
  int failures_ = 0;
  std::optional<HeadOrder> order_;  ///< not sent yet
  Counts counts_;
};

}  // namespace

Result<std::unique_ptr<AxisSource>> open_onvif(const AxisSourceOptions& options,
                                               const std::string& name) {
  SL_ASSIGN(SoapClient client, SoapClient::create(options, name));
  SL_ASSIGN(const std::string services,
            client.ask("/onvif/device_service", format_onvif_capabilities(), kOpenPatienceMs));
  const std::string media = parse_onvif_path(services, "Media");
  const std::string ptz = parse_onvif_path(services, "PTZ");
  if (media.empty() || ptz.empty()) {
    return make_error(ErrorCode::kInvalidInput, name, "{} has no ONVIF services of media and PTZ",
                      options.host);
  }
  SL_ASSIGN(const std::string profiles,
            client.ask(media, format_onvif_profiles(), kOpenPatienceMs));
  std::string profile = parse_onvif_profile(profiles, options.profile);
  if (profile.empty()) {
    return make_error(ErrorCode::kInvalidInput, name, "{} has no profile {} with a head",
                      options.host, options.profile);
  }
  return std::unique_ptr<AxisSource>(
      std::make_unique<OnvifSource>(std::move(client), ptz, std::move(profile), options));
}

}  // namespace sightline::capture
