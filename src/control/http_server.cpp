// SPDX-License-Identifier: Apache-2.0
#include "sightline/control/http_server.hpp"

#include <microhttpd.h>

#include <exception>

#include "control/connection_loop.hpp"
#include "control/exchange.hpp"
#include "control/listen_socket.hpp"
#include "sightline/base/log.hpp"

namespace sightline {

using namespace control;

struct HttpServer::Impl {
  explicit Impl(Service made) : service(std::move(made)) {}

  Service service;
  uint16_t port = 0;
  std::unique_ptr<ConnectionLoop> loop;  ///< last: ends before the rest goes

  MHD_Result handle(MHD_Connection* connection, const char* path, const char* method,
                    const char* upload, size_t* upload_size, void** progress) noexcept;
};

MHD_Result HttpServer::Impl::handle(MHD_Connection* connection, const char* path,
                                    const char* method, const char* upload, size_t* upload_size,
                                    void** progress) noexcept {
  try {
    if (*progress == nullptr) *progress = new Exchange(service, connection, path, method);
    return static_cast<Exchange*>(*progress)->go_on(upload, upload_size);
  } catch (const std::exception& exception) {
    log::error("http: a request failed: {}", exception.what());
    return MHD_NO;
  }
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() = default;

Result<std::unique_ptr<HttpServer>> HttpServer::create(const HttpOptions& options,
                                                       HttpContent content) {
  std::vector<AccessToken> tokens;
  if (!options.tokens.empty()) {
    SL_ASSIGN(tokens, read_tokens(options.tokens));
  }
  TlsTexts tls;
  if (options.tls.any()) {
    SL_ASSIGN(tls, read_tls(options.tls));
  }
  const bool guarded = !tokens.empty();
  SL_ASSIGN(ListenSocket socket,
            open_listen_socket(options.address, options.port, guarded || options.open));
  if (!socket.loopback && !guarded) {
    log::warning(
        "http: everybody who reaches {} may watch and operate: [http] open without [access] tokens",
        options.address);
  }
  const auto waker = content.waker;
  auto impl = std::make_unique<Impl>(
      Service{std::move(content), options, socket.loopback,
              Gatekeeper(std::move(tokens), options.open ? Role::kViewer : Role::kNone)});
  impl->port = socket.port;
  const auto handler = [](void* self, MHD_Connection* connection, const char* url,
                          const char* method, const char*, const char* upload, size_t* upload_size,
                          void** progress) {
    return static_cast<Impl*>(self)->handle(connection, url, method, upload, upload_size, progress);
  };
  const auto completed = [](void* progress) { delete static_cast<Exchange*>(progress); };
  SL_ASSIGN(impl->loop, ConnectionLoop::create(std::move(socket.fd), options, tls,
                                               {+handler, impl.get(), +completed, waker}));
  impl->service.loop = impl->loop.get();
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

void HttpServer::run(std::stop_token stop) { impl_->loop->run(std::move(stop)); }

uint16_t HttpServer::port() const { return impl_->port; }

}  // namespace sightline
