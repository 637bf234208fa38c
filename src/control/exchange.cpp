// SPDX-License-Identifier: Apache-2.0
#include "control/exchange.hpp"

#include <netdb.h>
#include <strings.h>
#include <sys/socket.h>

#include <algorithm>
#include <charconv>
#include <exception>

#include "control/host_name.hpp"
#include "control/stream_body.hpp"
#include "sightline/base/log.hpp"

namespace sightline::control {
namespace {

constexpr std::string_view kPageRules =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "media-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

bool is(const char* a, const char* b) { return strcasecmp(a, b) == 0; }

bool takes_body(std::string_view method) {
  return method == MHD_HTTP_METHOD_POST || method == MHD_HTTP_METHOD_PUT;
}

// Each of them, should there be several: which one another reader takes is its own affair.
bool hosts_are_own(MHD_Connection* connection, const Service& service) {
  struct Look {
    const Service& service;
    bool good = true;
  } look{service};
  const auto visit = [](void* context, MHD_ValueKind, const char* key, const char* value) {
    auto& self = *static_cast<Look*>(context);
    if (!is(key, MHD_HTTP_HEADER_HOST)) return MHD_YES;
    const char* const host = value ? value : "";
    const bool own = names_loopback(host) ||
                     (!self.service.loopback && names_this(host, self.service.options.names));
    self.good = self.good && own;
    return MHD_YES;
  };
  MHD_get_connection_values(connection, MHD_HEADER_KIND, visit, &look);
  return look.good;
}

Query query_of(MHD_Connection* connection) {
  Query query;
  const auto take = [](void* to, MHD_ValueKind, const char* key, const char* value) {
    static_cast<Query*>(to)->emplace(key, value ? value : "");
    return MHD_YES;
  };
  MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, take, &query);
  return query;
}

PeerKey peer_of(MHD_Connection* connection) {
  const auto* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
  return peer_key(info != nullptr ? info->client_addr : nullptr);
}

/// Where the peer reached this host.
std::string own_address_of(MHD_Connection* connection) {
  const auto* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  if (info == nullptr ||
      ::getsockname(info->connect_fd, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    return "";
  }
  char text[NI_MAXHOST];
  if (::getnameinfo(reinterpret_cast<const sockaddr*>(&address), length, text, sizeof text, nullptr,
                    0, NI_NUMERICHOST) != 0) {
    return "";
  }
  const std::string_view plain(text);
  constexpr std::string_view kMapped = "::ffff:";
  return std::string(plain.starts_with(kMapped) ? plain.substr(kMapped.size()) : plain);
}

void add_headers(MHD_Response* response, const HttpReply& reply) {
  const auto add = [response](const char* name, const char* value) {
    MHD_add_response_header(response, name, value);
  };
  add(MHD_HTTP_HEADER_CONTENT_TYPE, reply.type.c_str());
  add(MHD_HTTP_HEADER_CACHE_CONTROL, "no-store");
  add("X-Content-Type-Options", "nosniff");
  add("Cross-Origin-Resource-Policy", "same-origin");
  if (reply.type.starts_with("text/html")) {
    const bool own = std::ranges::any_of(reply.headers, [](const auto& header) {
      return header.first == "Content-Security-Policy";
    });
    if (!own) add("Content-Security-Policy", kPageRules.data());
    add("Referrer-Policy", "no-referrer");
  }
  if (reply.status == MHD_HTTP_UNAUTHORIZED) {
    add(MHD_HTTP_HEADER_WWW_AUTHENTICATE, "Basic realm=\"Sightline\", charset=\"UTF-8\"");
  }
  for (const auto& [name, value] : reply.headers) add(name.c_str(), value.c_str());
}

}  // namespace

Exchange::Exchange(Service& service, MHD_Connection* connection, std::string_view path,
                   std::string_view method)
    : service_(service), connection_(connection), method_(method) {
  request_.path = path;
}

std::string Exchange::header(const char* name) const {
  const char* const value = MHD_lookup_connection_value(connection_, MHD_HEADER_KIND, name);
  return value != nullptr ? value : "";
}

MHD_Result Exchange::go_on(const char* upload, size_t* upload_size) {
  if (late_) return send(*std::exchange(late_, std::nullopt));
  if (!judged_) {
    judged_ = true;
    auto refusal = judge();
    // Before any body is read; the library then closes the connection.
    return refusal ? send(*std::move(refusal)) : MHD_YES;
  }
  if (*upload_size != 0) {
    if (takes_body(method_)) request_.body.append(upload, *upload_size);
    *upload_size = 0;  // another's body is one that nobody asked for
    // Without a length it could not be judged before.
    return request_.body.size() <= HttpServer::kMostBody ? MHD_YES : MHD_NO;
  }
  HttpReply reply = answer();
  if (reply.later) return wait_for(std::move(reply.later));
  return send(std::move(reply));
}

std::optional<HttpReply> Exchange::judge() {
  if (!hosts_are_own(connection_, service_)) {
    return HttpReply::error(
        403, service_.loopback ? "this server answers to localhost only"
                               : "this server does not go by that name; [http] names may list it");
  }
  if (auto refusal = judge_origin()) return refusal;
  match_ = match(method_ == MHD_HTTP_METHOD_HEAD ? MHD_HTTP_METHOD_GET : method_, request_.path);
  if (match_.allowed.empty()) {
    return HttpReply::error(404, "not found; /api/v1/openapi.json lists what there is");
  }
  if (match_.route == nullptr) {
    HttpReply reply = HttpReply::error(405, "only " + match_.allowed);
    reply.headers.emplace_back(MHD_HTTP_HEADER_ALLOW, match_.allowed);
    return reply;
  }
  if (auto refusal = judge_user()) return refusal;
  return judge_body();
}

// A page of another site can make a browser ask this server, also with what the browser knows of
// tokens, but cannot keep it from saying whose page it was.
std::optional<HttpReply> Exchange::judge_origin() const {
  const std::string origin = header("Origin");
  const std::string scheme = service_.options.tls.any() ? "https://" : "http://";
  if (!origin.empty() && origin != scheme + header(MHD_HTTP_HEADER_HOST)) {
    return HttpReply::error(403, "pages of other sites may not ask this server");
  }
  const std::string site = header("Sec-Fetch-Site");
  const bool own = site.empty() || site == "same-origin" || site == "none";
  const bool looks = method_ == MHD_HTTP_METHOD_GET || method_ == MHD_HTTP_METHOD_HEAD;
  if (!own && (!looks || header("Sec-Fetch-Mode") != "navigate")) {
    return HttpReply::error(403, "pages of other sites may not ask this server");
  }
  return std::nullopt;
}

std::optional<HttpReply> Exchange::judge_user() {
  const auto answer = service_.gatekeeper.ask(header(MHD_HTTP_HEADER_AUTHORIZATION),
                                              peer_of(connection_), MonotonicClock::now());
  if (answer.verdict == Gatekeeper::Verdict::kTooOften) {
    HttpReply reply = HttpReply::error(429, "too many wrong tokens from this address");
    reply.headers.emplace_back(MHD_HTTP_HEADER_RETRY_AFTER, "60");
    return reply;
  }
  if (answer.verdict == Gatekeeper::Verdict::kWrong) {
    log::warning("http: a wrong token was tried for {}", match_.route->pattern);
    return HttpReply::error(401, "that token is not known");
  }
  request_.user = answer.name;
  if (answer.role >= match_.route->role) return std::nullopt;
  if (answer.name.empty()) return HttpReply::error(401, "this takes a token");
  return HttpReply::error(403, "this takes the token of an operator");
}

std::optional<HttpReply> Exchange::judge_body() const {
  if (!takes_body(method_)) return std::nullopt;
  const std::string length = header(MHD_HTTP_HEADER_CONTENT_LENGTH);
  uint64_t bytes = 0;
  const auto [end, error] = std::from_chars(length.data(), length.data() + length.size(), bytes);
  if (!length.empty() && (error != std::errc() || end != length.data() + length.size())) {
    return HttpReply::error(400, "that is no length of a body");
  }
  if (bytes > HttpServer::kMostBody) return HttpReply::error(413, "the body is too long");
  const std::string type = header(MHD_HTTP_HEADER_CONTENT_TYPE);
  const std::string media = type.substr(0, type.find(';'));
  // Forms of other sites cannot say this without being asked first.
  const std::string wanted(match_.route->body);
  if (!is(media.c_str(), wanted.c_str())) {
    return HttpReply::error(415, "Content-Type has to be " + wanted);
  }
  return std::nullopt;
}

HttpReply Exchange::answer() {
  try {
    request_.query = query_of(connection_);
    request_.range = header(MHD_HTTP_HEADER_RANGE);
    request_.address = own_address_of(connection_);
    HttpReply reply = match_.route->answer(service_.content, request_, match_.name);
    if (reply.stream && service_.streams >= service_.options.max_streams) {
      return HttpReply::error(503, "as many streams as this server sends are being watched");
    }
    return reply;
  } catch (const std::exception& exception) {
    log::error("http: {} failed: {}", request_.path, exception.what());
    return HttpReply::error(500, "failed; the log says why");
  }
}

MHD_Result Exchange::wait_for(std::function<std::optional<HttpReply>()> later) {
  service_.loop->suspend(connection_, [this, later = std::move(later)] {
    try {
      late_ = later();
    } catch (const std::exception& exception) {
      log::error("http: {} failed: {}", request_.path, exception.what());
      late_ = HttpReply::error(500, "failed; the log says why");
    }
    return late_.has_value();
  });
  return MHD_YES;
}

MHD_Result Exchange::send(HttpReply reply) {
  MHD_Response* const response =
      reply.stream ? make_stream_response(*service_.loop, connection_, reply.stream, reply.length,
                                          service_.streams)
                   : MHD_create_response_from_buffer(reply.body.size(), reply.body.data(),
                                                     MHD_RESPMEM_MUST_COPY);
  if (response == nullptr) return MHD_NO;
  add_headers(response, reply);
  const MHD_Result result = MHD_queue_response(connection_, reply.status, response);
  MHD_destroy_response(response);
  return result;
}

}  // namespace sightline::control
