// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/rtsp_server.hpp"

#include <fcntl.h>
#include <gst/rtsp-server/rtsp-server.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <vector>

#include "sightline/base/log.hpp"
#include "stream/client_sessions.hpp"
#include "stream/guarded_socket.hpp"
#include "stream/handover.hpp"
#include "stream/rtsp_access.hpp"
#include "stream/rtsp_connections.hpp"
#include "stream/rtsp_stream.hpp"

namespace sightline {

using namespace stream;

namespace {

/// A peer that acknowledges nothing, or takes nothing, for so long is cut off by the kernel [ms].
constexpr unsigned kPeerTimeoutMs = 20'000;
/// How long run() waits for connections to end after a stop.
constexpr Duration kGoodbye = std::chrono::milliseconds(700);
/// Connections that wait to be accepted.
constexpr int kBacklog = 128;
/// RTP over UDP is sent from here: above the ports that Linux hands out by itself.
constexpr guint16 kFirstUdpPort = 61000, kLastUdpPort = 65533;

bool has_session(const void* client) {
  GList* sessions = gst_rtsp_client_session_filter(
      static_cast<GstRTSPClient*>(const_cast<void*>(client)), nullptr, nullptr);
  const bool any = sessions != nullptr;
  g_list_free_full(sessions, g_object_unref);
  return any;
}

/// What the signals of server, clients and sessions need; they may come after the server is gone.
struct State {
  explicit State(const RtspOptions& chosen)
      : options(chosen),
        connections({chosen.max_clients, chosen.max_clients_per_address}, has_session) {}

  const RtspOptions options;
  RtspConnections connections;
  SeldomWarning refusals;
  /// Accepted, on its way to the client object that the library makes of it; the server's thread.
  RtspConnections::Connection arriving;
  mutable std::mutex mutex;
  std::map<std::string, std::shared_ptr<SharedStream>> streams;
  ClientSessions sessions;
  GObjectPtr<GTlsCertificate> certificate;  ///< null: no TLS

  std::vector<std::shared_ptr<SharedStream>> all_streams() const {
    std::lock_guard lock(mutex);
    std::vector<std::shared_ptr<SharedStream>> all;
    for (const auto& [name, stream] : streams) all.push_back(stream);
    return all;
  }

  /// The stream of a request path such as "/left" or "/left/stream=0"; null if there is none.
  std::shared_ptr<SharedStream> stream_of(std::string path) const {
    if (path.starts_with('/')) path.erase(0, 1);
    path = path.substr(0, path.find('/'));
    std::lock_guard lock(mutex);
    const auto found = streams.find(path);
    return found == streams.end() ? nullptr : found->second;
  }
};
using StatePtr = std::shared_ptr<State>;

void connect(gpointer object, const char* signal, GCallback callback, const StatePtr& state) {
  g_signal_connect_data(object, signal, callback, UserData<StatePtr>::make(state),
                        UserData<StatePtr>::destroy_closure, static_cast<GConnectFlags>(0));
}

State& state_of(gpointer data) { return *UserData<StatePtr>::in(data); }

/// Kernel-side bounds on a peer that vanished or stopped reading.
void bound_peer(int fd) {
  const int on = 1;
  setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof(on));
  setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &kPeerTimeoutMs, sizeof(kPeerTimeoutMs));
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
}

void on_play(GstRTSPClient* client, GstRTSPContext* context, gpointer data) {
  const LibraryCall call(data);
  if (!context->session || !context->uri) return;
  if (const auto stream = state_of(data).stream_of(context->uri->abspath)) {
    stream->viewer_started(client, gst_rtsp_session_get_sessionid(context->session));
  }
}

void on_stop_playing(GstRTSPClient* client, GstRTSPContext* context, gpointer data) {
  const LibraryCall call(data);
  if (!context->session || !context->uri) return;
  if (const auto stream = state_of(data).stream_of(context->uri->abspath)) {
    stream->viewer_stopped(client, gst_rtsp_session_get_sessionid(context->session));
  }
}

void on_send(GstRTSPClient* client, GstRTSPContext* context, GstRTSPMessage* message,
             gpointer data) {
  const LibraryCall call(data);
  state_of(data).connections.answered(client);
  if (!refuses_password(context, message)) return;
  state_of(data).connections.wrong_password(client, MonotonicClock::now());
}

/// One session for each connection: with more, one client could take them all.
GstRTSPStatusCode on_pre_setup(GstRTSPClient* client, GstRTSPContext* context, gpointer) {
  const bool another = context->session == nullptr && has_session(client);
  return another ? GST_RTSP_STS_NOT_ENOUGH_BANDWIDTH : GST_RTSP_STS_OK;
}

void on_new_session(GstRTSPClient* client, GstRTSPSession* session, gpointer data) {
  const LibraryCall call(data);
  state_of(data).sessions.add(client, gst_rtsp_session_get_sessionid(session));
  const auto seconds =
      std::chrono::duration_cast<std::chrono::seconds>(state_of(data).options.session_timeout);
  gst_rtsp_session_set_timeout(session, static_cast<guint>(std::max<int64_t>(1, seconds.count())));
}

void end_sessions(GstRTSPClient* client, State& state) {
  const GObjectPtr<GstRTSPSessionPool> pool(gst_rtsp_client_get_session_pool(client));
  for (const std::string& id : state.sessions.take(client)) {
    const GObjectPtr<GstRTSPSession> session(gst_rtsp_session_pool_find(pool.get(), id.c_str()));
    if (session) gst_rtsp_session_pool_remove(pool.get(), session.get());
  }
}

void on_closed(GstRTSPClient* client, gpointer data) {
  const LibraryCall call(data);
  State& state = state_of(data);
  state.connections.remove(client);
  end_sessions(client, state);
  for (const auto& stream : state.all_streams()) stream->client_gone(client);
}

/// While the connection is handed over: on the server's thread, before the client gets its own.
void on_client(GstRTSPServer*, GstRTSPClient* client, gpointer data) {
  const LibraryCall call(data);
  const StatePtr& state = UserData<StatePtr>::in(data);
  // The guard refuses HTTP already; this is the library's own way to know no RTSP inside HTTP.
  GstRTSPConnection* const connection = gst_rtsp_client_get_connection(client);
  gst_rtsp_connection_set_http_mode(connection, TRUE);
  RtspConnections::Connection arriving = std::exchange(state->arriving, {});
  if (state->certificate) arriving.tls = speak_tls(connection, state->certificate.get());
  const bool plain_by_mistake = state->certificate && !arriving.tls;
  state->connections.add(client, std::move(arriving));
  if (plain_by_mistake) {
    state->connections.end_if([client](const void* one) { return one == client; });
  }
  connect(client, "closed", G_CALLBACK(on_closed), state);
  connect(client, "send-message", G_CALLBACK(on_send), state);
  connect(client, "pre-setup-request", G_CALLBACK(on_pre_setup), state);
  connect(client, "new-session", G_CALLBACK(on_new_session), state);
  connect(client, "play-request", G_CALLBACK(on_play), state);
  connect(client, "pause-request", G_CALLBACK(on_stop_playing), state);
  connect(client, "teardown-request", G_CALLBACK(on_stop_playing), state);
}

void on_session_removed(GstRTSPSessionPool*, GstRTSPSession* session, gpointer data) {
  const LibraryCall call(data);
  const std::string id = gst_rtsp_session_get_sessionid(session);
  state_of(data).sessions.forget(id);
  for (const auto& stream : state_of(data).all_streams()) stream->session_gone(id);
}

bool is_valid_name(const std::string& name) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  return !name.empty() && name.size() <= 128 && name != "." && name != ".." &&
         std::all_of(name.begin(), name.end(), allowed);
}

Error bind_error(const RtspOptions& options, const GErrorPtr& error) {
  if (error && error->domain == G_IO_ERROR && error->code == G_IO_ERROR_ADDRESS_IN_USE) {
    return make_error(ErrorCode::kUnavailable, "rtsp",
                      "port {} of {} is in use by another program; stop it (`ss -ltnp 'sport = "
                      ":{}'` names it) or choose another port under [rtsp]",
                      options.port, options.address, options.port);
  }
  return make_error(ErrorCode::kUnavailable, "rtsp", "cannot listen on {} port {}: {}",
                    options.address, options.port, text_of(error));
}

std::string host_of(const std::string& address) {
  if (address == "0.0.0.0" || address == "::") return "localhost";
  return address.find(':') == std::string::npos ? address : "[" + address + "]";
}

}  // namespace

struct RtspServer::Impl {
  explicit Impl(const RtspOptions& options) : state(std::make_shared<State>(options)) {}

  const StatePtr state;
  GMainContextPtr context{g_main_context_new()};
  GObjectPtr<GstRTSPServer> server;
  GObjectPtr<GstRTSPSessionPool> sessions;
  GObjectPtr<GstRTSPMountPoints> mounts;
  GObjectPtr<GstRTSPAddressPool> udp_addresses;  ///< null: all of this host's
  GObjectPtr<GSocket> socket;
  GSourcePtr listening;
  uint16_t port = 0;

  Status listen();
  void take_address();
  void accept_one();
  void hand_over(GObjectPtr<GSocket> accepted, const RemoteHost& peer);
  void drop_everybody();
};

Status RtspServer::Impl::listen() {
  const RtspOptions& options = state->options;
  server.reset(gst_rtsp_server_new());
  ask_for_passwords(server.get(), options.users);
  if (options.tls()) {
    SL_ASSIGN(state->certificate, make_certificate(options.certificate_pem, options.key_pem));
  }
  sessions.reset(gst_rtsp_server_get_session_pool(server.get()));
  mounts.reset(gst_rtsp_server_get_mount_points(server.get()));
  gst_rtsp_server_set_address(server.get(), options.address.c_str());
  gst_rtsp_server_set_service(server.get(), std::to_string(options.port).c_str());
  // Twice the places: connections that leave have theirs until their threads are done.
  gst_rtsp_session_pool_set_max_sessions(sessions.get(),
                                         2 * static_cast<guint>(options.max_clients));
  gst_rtsp_server_set_backlog(server.get(), kBacklog);
  gst_rtsp_server_set_content_length_limit(server.get(), RequestGuard::kMaxBody);
  {
    // A thread for each client: a DESCRIBE waits for the first packet, and must not hold up others.
    const GObjectPtr<GstRTSPThreadPool> threads(gst_rtsp_server_get_thread_pool(server.get()));
    gst_rtsp_thread_pool_set_max_threads(threads.get(), -1);
  }
  connect(server.get(), "client-connected", G_CALLBACK(on_client), state);
  connect(sessions.get(), "session-removed", G_CALLBACK(on_session_removed), state);

  GError* raw = nullptr;
  socket.reset(gst_rtsp_server_create_socket(server.get(), nullptr, &raw));
  const GErrorPtr error(raw);
  if (!socket) return bind_error(options, error);
  take_address();
  listening.reset(g_socket_create_source(socket.get(), G_IO_IN, nullptr));
  const GSocketSourceFunc on_incoming = [](GSocket*, GIOCondition, gpointer self) -> gboolean {
    static_cast<Impl*>(self)->accept_one();
    return G_SOURCE_CONTINUE;
  };
  g_source_set_callback(listening.get(), G_SOURCE_FUNC(on_incoming), this, nullptr);
  g_source_attach(listening.get(), context.get());
  return {};
}

/// What follows from the address that was bound: where UDP is sent from, and who can watch.
void RtspServer::Impl::take_address() {
  const GObjectPtr<GSocketAddress> bound(g_socket_get_local_address(socket.get(), nullptr));
  SL_CHECK(bound && G_IS_INET_SOCKET_ADDRESS(bound.get()), "the RTSP server has an IP address");
  port = g_inet_socket_address_get_port(G_INET_SOCKET_ADDRESS(bound.get()));
  GInetAddress* address = g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(bound.get()));
  if (!g_inet_address_get_is_loopback(address) && state->options.users.empty()) {
    log::warning(
        "rtsp: {} can be reached from other machines, and there is no password: everybody who "
        "reaches port {} can watch; tokens under [access], or 127.0.0.1 under [rtsp]",
        state->options.address, port);
  }
  if (g_inet_address_get_is_any(address)) return;
  const GStringPtr text(g_inet_address_to_string(address));
  udp_addresses.reset(gst_rtsp_address_pool_new());
  gst_rtsp_address_pool_add_range(udp_addresses.get(), text.get(), text.get(), kFirstUdpPort,
                                  kLastUdpPort, 0);
}

void RtspServer::Impl::accept_one() {
  GError* raw = nullptr;
  GObjectPtr<GSocket> accepted(g_socket_accept(socket.get(), nullptr, &raw));
  const GErrorPtr error(raw);
  const Time now = MonotonicClock::now();
  if (!accepted) {
    if (g_error_matches(error.get(), G_IO_ERROR, G_IO_ERROR_WOULD_BLOCK)) return;
    state->refusals.warn(fmt::format("rtsp: a connection cannot be accepted: {}", text_of(error)),
                         now);
    g_usleep(50'000);  // out of descriptors, most likely: it would come again at once
    return;
  }
  const std::optional<RemoteHost> peer = peer_of(accepted.get());
  if (!peer) return;
  if (state->connections.guessed_too_often(*peer, now)) {
    state->refusals.warn(fmt::format("rtsp: a client at {} is refused for a minute: too many wrong "
                                     "passwords came from there",
                                     peer->address),
                         now);
    return;
  }
  if (state->connections.make_room(*peer)) {
    hand_over(std::move(accepted), *peer);
    return;
  }
  state->refusals.warn(
      fmt::format("rtsp: a client at {} is refused: {} are connected and none is idle "
                  "(max_clients, max_clients_per_address)",
                  peer->address, state->connections.count()),
      now);
}

void RtspServer::Impl::hand_over(GObjectPtr<GSocket> accepted, const RemoteHost& peer) {
  const int fd = g_socket_get_fd(accepted.get());
  bound_peer(fd);
  RtspConnections::Connection& arriving = state->arriving;
  arriving = {peer, std::make_shared<GuardedInput>(), UniqueFd(fcntl(fd, F_DUPFD_CLOEXEC, 0)),
              MonotonicClock::now(), false};
  if (!arriving.socket.is_open()) return;
  if (state->options.tls()) arriving.input->guard.expect_opaque();
  const std::weak_ptr<State> of = state;
  arriving.input->on_refusal = [of, address = peer.address](RequestGuard::Verdict verdict) {
    if (const auto it = of.lock()) {
      it->refusals.warn(
          fmt::format("rtsp: the connection from {} is ended: {}", address, describe(verdict)),
          MonotonicClock::now());
    }
  };
  guard_socket(accepted.get(), arriving.input);
  gst_rtsp_server_transfer_connection(server.get(), accepted.release(), peer.address.c_str(),
                                      peer.port, nullptr);
  arriving = {};
}

void RtspServer::Impl::drop_everybody() {
  state->connections.end_if([](const void*) { return true; });
  g_list_free_full(
      gst_rtsp_session_pool_filter(
          sessions.get(),
          [](GstRTSPSessionPool*, GstRTSPSession*, gpointer) { return GST_RTSP_FILTER_REMOVE; },
          nullptr),
      g_object_unref);
}

RtspServer::RtspServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

RtspServer::~RtspServer() {
  for (const auto& stream : impl_->state->all_streams()) stream->close();
}

Result<std::unique_ptr<RtspServer>> RtspServer::create(const RtspOptions& options) {
  SL_RETURN_IF_ERROR(start_gstreamer());
  if (options.max_clients < 1) {
    return make_error(ErrorCode::kInvalidInput, "rtsp", "max_clients must be at least 1");
  }
  for (const char* element : {"appsrc", "h264parse", "rtph264pay", "udpsink"}) {
    const GstObjectPtr<GstElementFactory> factory(gst_element_factory_find(element));
    if (factory) continue;
    return make_error(ErrorCode::kUnavailable, "rtsp",
                      "GStreamer element {} is missing; install the Debian packages "
                      "gstreamer1.0-plugins-base, gstreamer1.0-plugins-good and "
                      "gstreamer1.0-plugins-bad",
                      element);
  }
  auto impl = std::make_unique<Impl>(options);
  SL_RETURN_IF_ERROR(impl->listen());
  return std::unique_ptr<RtspServer>(new RtspServer(std::move(impl)));
}

Result<std::shared_ptr<RtspStream>> RtspServer::add_stream(const std::string& name,
                                                           const RtspStreamOptions& options) {
  if (!is_valid_name(name)) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "a stream's name is made of letters, digits and '-_.' (it becomes the path "
                      "of its address)");
  }
  const auto stream = std::make_shared<SharedStream>(
      name,
      fmt::format("{}://{}:{}/{}", impl_->state->options.tls() ? "rtsps" : "rtsp",
                  host_of(impl_->state->options.address), port(), name),
      options);
  {
    std::lock_guard lock(impl_->state->mutex);
    if (!impl_->state->streams.emplace(name, stream).second) {
      return make_error(ErrorCode::kInvalidInput, name, "there is a stream of this name already");
    }
  }
  gst_rtsp_mount_points_add_factory(
      impl_->mounts.get(), ("/" + name).c_str(),
      stream->make_factory(impl_->udp_addresses.get(), impl_->state->options.tls()).release());
  return std::shared_ptr<RtspStream>(stream);
}

void RtspServer::remove_stream(const std::string& name) {
  std::shared_ptr<SharedStream> stream;
  {
    std::lock_guard lock(impl_->state->mutex);
    const auto found = impl_->state->streams.find(name);
    if (found == impl_->state->streams.end()) return;
    stream = found->second;
    impl_->state->streams.erase(found);
  }
  gst_rtsp_mount_points_remove_factory(impl_->mounts.get(), ("/" + name).c_str());
  impl_->state->connections.end_if(
      [&](const void* client) { return stream->is_watched_by(client); });
  stream->close();
}

uint16_t RtspServer::port() const { return impl_->port; }

int RtspServer::clients() const { return impl_->state->connections.count(); }

void RtspServer::run(std::stop_token stop, const std::function<void()>& on_tick) {
  GMainContext* context = impl_->context.get();
  g_main_context_push_thread_default(context);
  struct Tick {
    Impl& impl;
    const std::function<void()>& callback;
  } ticking{*impl_, on_tick};
  const GSourcePtr tick(g_timeout_source_new(500));
  g_source_set_callback(
      tick.get(),
      [](gpointer data) -> gboolean {
        const auto& self = *static_cast<const Tick*>(data);
        gst_rtsp_session_pool_cleanup(self.impl.sessions.get());
        self.impl.state->connections.end_overdue(MonotonicClock::now());
        if (self.callback) self.callback();
        return G_SOURCE_CONTINUE;
      },
      &ticking, nullptr);
  g_source_attach(tick.get(), context);
  {
    const std::stop_callback wake(stop, [context] { g_main_context_wakeup(context); });
    while (!stop.stop_requested()) g_main_context_iteration(context, TRUE);
  }
  impl_->listening.reset();
  impl_->socket.reset();
  impl_->drop_everybody();
  const Time deadline = MonotonicClock::now() + kGoodbye;
  while (clients() > 0 && MonotonicClock::now() < deadline) {
    g_main_context_iteration(context, FALSE);
    g_usleep(5'000);
  }
  g_main_context_pop_thread_default(context);
}

}  // namespace sightline
