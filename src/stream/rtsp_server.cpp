// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/rtsp_server.hpp"

#include <gst/rtsp-server/rtsp-server.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <vector>

#include "handover.hpp"
#include "rtsp_stream.hpp"
#include "sightline/base/log.hpp"

namespace sightline {
namespace {

/// A connection without a session is somebody who will not watch.
constexpr Duration kIdleConnection = std::chrono::seconds(20);
/// A peer that acknowledges nothing, or takes nothing, for so long is cut off by the kernel [ms].
constexpr unsigned kPeerTimeoutMs = 20'000;
/// How long run() waits for connections to end after a stop.
constexpr Duration kGoodbye = std::chrono::milliseconds(700);

/// What the signals of server, clients and sessions need; they may come after the server is gone.
struct State {
  RtspOptions options;
  mutable std::mutex mutex;
  std::map<std::string, std::shared_ptr<SharedStream>> streams;
  std::map<GstRTSPClient*, Time> clients;  ///< since when

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
  g_signal_connect_data(object, signal, callback, Carried<StatePtr>::make(state),
                        Carried<StatePtr>::destroy_closure, static_cast<GConnectFlags>(0));
}

State& state_of(gpointer data) { return *Carried<StatePtr>::in(data); }

/// Kernel-side bounds on a peer that vanished or stopped reading.
void bound_peer(GstRTSPClient* client) {
  GstRTSPConnection* connection = gst_rtsp_client_get_connection(client);
  GSocket* socket = connection ? gst_rtsp_connection_get_read_socket(connection) : nullptr;
  if (socket == nullptr) return;
  const int fd = g_socket_get_fd(socket);
  const int on = 1;
  setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof(on));
  setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &kPeerTimeoutMs, sizeof(kPeerTimeoutMs));
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
}

// --- signals; on the server's thread or on a client's thread
// ---------------------------------------

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

void on_new_session(GstRTSPClient*, GstRTSPSession* session, gpointer data) {
  const LibraryCall call(data);
  const auto seconds =
      std::chrono::duration_cast<std::chrono::seconds>(state_of(data).options.session_timeout);
  gst_rtsp_session_set_timeout(session, static_cast<guint>(std::max<int64_t>(1, seconds.count())));
}

void on_closed(GstRTSPClient* client, gpointer data) {
  const LibraryCall call(data);
  State& state = state_of(data);
  {
    std::lock_guard lock(state.mutex);
    state.clients.erase(client);
  }
  for (const auto& stream : state.all_streams()) stream->client_gone(client);
}

/// Closes a client from the running main context, a moment later: while "client-connected" is
/// emitted the library has not finished setting it up.
void close_soon(GstRTSPClient* client) {
  const std::unique_ptr<GSource, UnrefSource> source(g_idle_source_new());
  g_source_set_callback(
      source.get(),
      [](gpointer data) -> gboolean {
        gst_rtsp_client_close(GST_RTSP_CLIENT(data));
        return G_SOURCE_REMOVE;
      },
      g_object_ref(client), g_object_unref);
  g_source_attach(source.get(), g_main_context_get_thread_default());
}

void on_client(GstRTSPServer*, GstRTSPClient* client, gpointer data) {
  const LibraryCall call(data);
  const StatePtr& state = Carried<StatePtr>::in(data);
  bool refused = false;
  {
    std::lock_guard lock(state->mutex);
    refused = std::ssize(state->clients) >= state->options.max_clients;
    if (!refused) state->clients.emplace(client, MonotonicClock::now());
  }
  if (refused) {
    log::warning("rtsp: a client is refused: {} are connected already (max_clients)",
                 state->options.max_clients);
    close_soon(client);
    return;
  }
  bound_peer(client);
  connect(client, "closed", G_CALLBACK(on_closed), state);
  connect(client, "new-session", G_CALLBACK(on_new_session), state);
  connect(client, "play-request", G_CALLBACK(on_play), state);
  connect(client, "pause-request", G_CALLBACK(on_stop_playing), state);
  connect(client, "teardown-request", G_CALLBACK(on_stop_playing), state);
}

void on_session_removed(GstRTSPSessionPool*, GstRTSPSession* session, gpointer data) {
  const LibraryCall call(data);
  const std::string id = gst_rtsp_session_get_sessionid(session);
  for (const auto& stream : state_of(data).all_streams()) stream->session_gone(id);
}

// --- helpers
// ---------------------------------------------------------------------------------------

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
  StatePtr state = std::make_shared<State>();
  GMainContextPtr context{g_main_context_new()};
  GObjectPtr<GstRTSPServer> server;
  GObjectPtr<GstRTSPSessionPool> sessions;
  GObjectPtr<GstRTSPMountPoints> mounts;
  GSourcePtr listening;
  uint16_t port = 0;

  Status listen();
  void housekeeping();
  void close_clients(const std::function<bool(GstRTSPClient*)>& which);
  void drop_everybody();
};

Status RtspServer::Impl::listen() {
  const RtspOptions& options = state->options;
  server.reset(gst_rtsp_server_new());
  sessions.reset(gst_rtsp_server_get_session_pool(server.get()));
  mounts.reset(gst_rtsp_server_get_mount_points(server.get()));
  gst_rtsp_server_set_address(server.get(), options.address.c_str());
  gst_rtsp_server_set_service(server.get(), std::to_string(options.port).c_str());
  gst_rtsp_session_pool_set_max_sessions(sessions.get(), static_cast<guint>(options.max_clients));
  {
    // A thread for each client: a DESCRIBE waits for the first packet, and must not hold up others.
    const GObjectPtr<GstRTSPThreadPool> threads(gst_rtsp_server_get_thread_pool(server.get()));
    gst_rtsp_thread_pool_set_max_threads(threads.get(), -1);
  }
  connect(server.get(), "client-connected", G_CALLBACK(on_client), state);
  connect(sessions.get(), "session-removed", G_CALLBACK(on_session_removed), state);

  GError* raw = nullptr;
  listening.reset(gst_rtsp_server_create_source(server.get(), nullptr, &raw));
  const GErrorPtr error(raw);
  if (!listening) return bind_error(options, error);
  g_source_attach(listening.get(), context.get());
  port = static_cast<uint16_t>(gst_rtsp_server_get_bound_port(server.get()));
  return {};
}

void RtspServer::Impl::close_clients(const std::function<bool(GstRTSPClient*)>& which) {
  g_list_free_full(gst_rtsp_server_client_filter(
                       server.get(),
                       [](GstRTSPServer*, GstRTSPClient* client, gpointer data) {
                         const auto& chosen =
                             *static_cast<const std::function<bool(GstRTSPClient*)>*>(data);
                         return chosen(client) ? GST_RTSP_FILTER_REMOVE : GST_RTSP_FILTER_KEEP;
                       },
                       const_cast<std::function<bool(GstRTSPClient*)>*>(&which)),
                   g_object_unref);
}

void RtspServer::Impl::housekeeping() {
  gst_rtsp_session_pool_cleanup(sessions.get());
  const Time now = MonotonicClock::now();
  close_clients([&](GstRTSPClient* client) {
    {
      std::lock_guard lock(state->mutex);
      const auto found = state->clients.find(client);
      if (found == state->clients.end() || now - found->second < kIdleConnection) return false;
    }
    GList* its_sessions = gst_rtsp_client_session_filter(client, nullptr, nullptr);
    const bool idle = its_sessions == nullptr;
    g_list_free_full(its_sessions, g_object_unref);
    return idle;
  });
}

void RtspServer::Impl::drop_everybody() {
  close_clients([](GstRTSPClient*) { return true; });
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
  auto impl = std::make_unique<Impl>();
  impl->state->options = options;
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
      name, fmt::format("rtsp://{}:{}/{}", host_of(impl_->state->options.address), port(), name),
      options);
  {
    std::lock_guard lock(impl_->state->mutex);
    if (!impl_->state->streams.emplace(name, stream).second) {
      return make_error(ErrorCode::kInvalidInput, name, "there is a stream of this name already");
    }
  }
  gst_rtsp_mount_points_add_factory(impl_->mounts.get(), ("/" + name).c_str(),
                                    stream->make_factory().release());
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
  impl_->close_clients([&](GstRTSPClient* client) { return stream->is_watched_by(client); });
  stream->close();
}

uint16_t RtspServer::port() const { return impl_->port; }

int RtspServer::clients() const {
  std::lock_guard lock(impl_->state->mutex);
  return static_cast<int>(impl_->state->clients.size());
}

void RtspServer::run(std::stop_token stop) {
  GMainContext* context = impl_->context.get();
  g_main_context_push_thread_default(context);
  const GSourcePtr tick(g_timeout_source_new(500));
  g_source_set_callback(
      tick.get(),
      [](gpointer self) -> gboolean {
        static_cast<Impl*>(self)->housekeeping();
        return G_SOURCE_CONTINUE;
      },
      impl_.get(), nullptr);
  g_source_attach(tick.get(), context);
  {
    const std::stop_callback wake(stop, [context] { g_main_context_wakeup(context); });
    while (!stop.stop_requested()) g_main_context_iteration(context, TRUE);
  }
  impl_->listening.reset();
  impl_->drop_everybody();
  const Time deadline = MonotonicClock::now() + kGoodbye;
  while (clients() > 0 && MonotonicClock::now() < deadline) {
    g_main_context_iteration(context, FALSE);
    g_usleep(5'000);
  }
  g_main_context_pop_thread_default(context);
}

}  // namespace sightline
