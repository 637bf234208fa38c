// SPDX-License-Identifier: Apache-2.0
#include "capture/axes/soap_client.hpp"

#include <curl/curl.h>

#include "capture/axes/onvif_messages.hpp"
#include "sightline/base/files.hpp"

namespace sightline::capture {
namespace {

constexpr size_t kLongestAnswer = 1 << 18;
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

}  // namespace

struct SoapClient::Connection {
  std::unique_ptr<curl_slist, Cleanup> headers;  // outlives the handle
  std::unique_ptr<CURL, Cleanup> handle;
  std::string base, name;
};

SoapClient::SoapClient(std::unique_ptr<Connection> connection)
    : connection_(std::move(connection)) {}
SoapClient::SoapClient(SoapClient&& other) noexcept = default;
SoapClient::~SoapClient() = default;

Result<SoapClient> SoapClient::create(const AxisSourceOptions& options, const std::string& name) {
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
  auto connection = std::make_unique<Connection>();
  connection->headers = std::move(headers);
  connection->handle = std::move(handle);
  connection->base = std::move(base);
  connection->name = name;
  return SoapClient(std::move(connection));
}

Result<std::string> SoapClient::ask(const std::string& path, const std::string& body,
                                    long patience_ms) {
  CURL* const handle = connection_->handle.get();
  std::string answer;
  const std::string url = connection_->base + path;
  curl_easy_setopt(handle, CURLOPT_URL, url.c_str());
  curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE, static_cast<long>(body.size()));
  curl_easy_setopt(handle, CURLOPT_COPYPOSTFIELDS, body.c_str());
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, &answer);
  curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS, patience_ms);
  const CURLcode code = curl_easy_perform(handle);
  if (code != CURLE_OK) {
    return make_error(ErrorCode::kTimeout, connection_->name, "{} does not answer: {}", url,
                      curl_easy_strerror(code));
  }
  long status = 0;
  curl_easy_getinfo(handle, CURLINFO_RESPONSE_CODE, &status);
  if (status == 401 || status == 403) {
    return make_error(ErrorCode::kInvalidInput, connection_->name,
                      "{} refuses: give its user as axes_user and axes_password_file", url);
  }
  if (const std::string fault = parse_onvif_fault(answer); !fault.empty()) {
    return make_error(ErrorCode::kUnavailable, connection_->name, "{} refuses: {}", url, fault);
  }
  if (status != 200) {
    return make_error(ErrorCode::kUnavailable, connection_->name, "{} answers with status {}", url,
                      status);
  }
  return answer;
}

}  // namespace sightline::capture
