// SPDX-License-Identifier: Apache-2.0
#include "sightline/control/http_server.hpp"

#include <microhttpd.h>
#include <strings.h>

#include <exception>
#include <string_view>

#include "control/connection_loop.hpp"
#include "control/host_name.hpp"
#include "control/listen_socket.hpp"
#include "sightline/base/log.hpp"

namespace sightline {

using namespace control;

namespace {

struct Reply {
  unsigned status = MHD_HTTP_OK;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
};

Reply text_reply(unsigned status, std::string text) {
  return {status, "text/plain; charset=utf-8", std::move(text) + "\n"};
}

// Each of them, should there be several: which one another reader takes is its own affair.
bool only_loopback_named(MHD_Connection* connection) {
  bool good = true;
  const auto look = [](void* all_good, MHD_ValueKind, const char* key, const char* value) {
    if (strcasecmp(key, MHD_HTTP_HEADER_HOST) == 0 && !names_loopback(value ? value : "")) {
      *static_cast<bool*>(all_good) = false;
    }
    return MHD_YES;
  };
  MHD_get_connection_values(connection, MHD_HEADER_KIND, look, &good);
  return good;
}

MHD_Result send(MHD_Connection* connection, const Reply& reply) {
  MHD_Response* response = MHD_create_response_from_buffer(
      reply.body.size(), const_cast<char*>(reply.body.data()), MHD_RESPMEM_MUST_COPY);
  if (response == nullptr) return MHD_NO;
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, reply.type.c_str());
  MHD_add_response_header(response, MHD_HTTP_HEADER_CACHE_CONTROL, "no-store");
  MHD_add_response_header(response, "X-Content-Type-Options", "nosniff");
  if (reply.status == MHD_HTTP_METHOD_NOT_ALLOWED) {
    MHD_add_response_header(response, MHD_HTTP_HEADER_ALLOW, "GET, HEAD");
  }
  const MHD_Result result = MHD_queue_response(connection, reply.status, response);
  MHD_destroy_response(response);
  return result;
}

}  // namespace

struct HttpServer::Impl {
  HttpContent content;
  bool loopback = true;
  uint16_t port = 0;
  std::unique_ptr<ConnectionLoop> loop;  ///< last: ends before the rest goes

  Reply answer(std::string_view path) const;
  Reply checked_answer(MHD_Connection* connection, std::string_view path) const;
  MHD_Result handle(MHD_Connection* connection, std::string_view path, std::string_view method,
                    size_t* upload_size, void** progress);
};

Reply HttpServer::Impl::answer(std::string_view path) const {
  if (path == "/metrics") {
    return {MHD_HTTP_OK, "text/plain; version=0.0.4; charset=utf-8",
            content.registry ? metrics_text(*content.registry) : std::string()};
  }
  if (path == "/healthz") {
    const Health health = content.health ? content.health() : Health{true, "ok"};
    return text_reply(health.ok ? MHD_HTTP_OK : MHD_HTTP_SERVICE_UNAVAILABLE, health.text);
  }
  if (path == "/api/state") {
    return {MHD_HTTP_OK, "application/json", content.state_json ? content.state_json() : "{}"};
  }
  return text_reply(MHD_HTTP_NOT_FOUND, "not found; there are /metrics, /healthz and /api/state");
}

Reply HttpServer::Impl::checked_answer(MHD_Connection* connection, std::string_view path) const {
  if (loopback && !only_loopback_named(connection)) {
    return text_reply(MHD_HTTP_FORBIDDEN, "this server answers to localhost only");
  }
  try {
    return answer(path);
  } catch (const std::exception& exception) {
    log::error("http: {} failed: {}", path, exception.what());
    return text_reply(MHD_HTTP_INTERNAL_SERVER_ERROR, "failed; the log says why");
  }
}

MHD_Result HttpServer::Impl::handle(MHD_Connection* connection, std::string_view path,
                                    std::string_view method, size_t* upload_size, void** progress) {
  if (method != MHD_HTTP_METHOD_GET && method != MHD_HTTP_METHOD_HEAD) {
    // Answered before any body is read; the library then closes the connection.
    return send(connection, text_reply(MHD_HTTP_METHOD_NOT_ALLOWED, "only GET and HEAD"));
  }
  static char headers_seen;
  if (*progress == nullptr) {
    *progress = &headers_seen;
    return MHD_YES;
  }
  if (*upload_size != 0) {
    *upload_size = 0;  // a body nobody asked for
    return MHD_YES;
  }
  return send(connection, checked_answer(connection, path));
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() = default;

Result<std::unique_ptr<HttpServer>> HttpServer::create(const HttpOptions& options,
                                                       HttpContent content) {
  SL_ASSIGN(ListenSocket socket,
            open_listen_socket(options.address, options.port, options.allow_remote));
  auto impl = std::make_unique<Impl>();
  impl->content = std::move(content);
  impl->loopback = socket.loopback;
  impl->port = socket.port;
  const auto handler = [](void* self, MHD_Connection* connection, const char* url,
                          const char* method, const char*, const char*, size_t* upload_size,
                          void** progress) {
    return static_cast<Impl*>(self)->handle(connection, url, method, upload_size, progress);
  };
  SL_ASSIGN(impl->loop,
            ConnectionLoop::create(std::move(socket.fd), options, +handler, impl.get()));
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

void HttpServer::run(std::stop_token stop) { impl_->loop->run(std::move(stop)); }

uint16_t HttpServer::port() const { return impl_->port; }

}  // namespace sightline
