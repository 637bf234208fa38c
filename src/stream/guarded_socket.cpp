// SPDX-License-Identifier: Apache-2.0
#include "stream/guarded_socket.hpp"

#include <sys/socket.h>

#include <array>
#include <string_view>
#include <utility>

#include "sightline/base/check.hpp"
#include "stream/gst_ptr.hpp"
#include "stream/handover.hpp"

// gst-rtsp-server reads requests through the input stream of the GSocketConnection that GIO's
// factory makes of an accepted socket, and bounds neither a header nor a request's time. So the
// factory makes connections of our type for these sockets, whose input stream asks the guard.
//
// The factory goes by family, type and protocol of the socket, and a registered type must not be
// replaced (the factory would keep a pointer to freed memory). So guarded sockets are given a
// protocol of their own as far as GIO knows: nothing else in this process uses SCTP, and GIO looks
// at the protocol nowhere else. Sockets of cameras' streams are not touched.

namespace sightline::stream {
namespace {

using InputPtr = UserData<std::shared_ptr<GuardedInput>>;

struct GuardedStream {
  GFilterInputStream parent;
  GSocket* socket;     // the base stream's, which keeps it
  gpointer input;      // InputPtr
  gboolean is_at_end;  // refused, or the peer's end
};
struct GuardedStreamClass {
  GFilterInputStreamClass parent;
};
struct GuardedConnection {
  GTcpConnection parent;
  GInputStream* stream;
};
struct GuardedConnectionClass {
  GTcpConnectionClass parent;
};

GQuark input_quark() {
  static const GQuark quark = g_quark_from_static_string("sightline-guarded-input");
  return quark;
}

GPollableInputStream* base_of(GuardedStream* self) {
  return G_POLLABLE_INPUT_STREAM(g_filter_input_stream_get_base_stream(&self->parent));
}

std::string_view answer_to(RequestGuard::Verdict verdict) {
  switch (verdict) {
    case RequestGuard::Verdict::kTooLarge:
      return "RTSP/1.0 413 Request Entity Too Large\r\nConnection: close\r\n\r\n";
    case RequestGuard::Verdict::kHttp:
      return "HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
    case RequestGuard::Verdict::kMalformed:
      return "RTSP/1.0 400 Bad Request\r\nConnection: close\r\n\r\n";
    case RequestGuard::Verdict::kPass:
      break;
  }
  return "";
}

/// Says why, unless RTP may be on its way; the rest of what came is taken out so that the kernel
/// does not reset the connection before the answer is read.
void refuse(GuardedStream* self, GuardedInput& input, RequestGuard::Verdict verdict) {
  const int fd = g_socket_get_fd(self->socket);
  if (input.guard.requests() == 0 && !input.guard.opaque()) {
    const std::string_view answer = answer_to(verdict);
    [[maybe_unused]] const ssize_t sent =
        send(fd, answer.data(), answer.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  shutdown(fd, SHUT_WR);
  std::array<char, 65536> rest;
  [[maybe_unused]] const ssize_t taken = recv(fd, rest.data(), rest.size(), MSG_DONTWAIT);
  if (input.on_refusal) input.on_refusal(verdict);
}

/// What to make of a read's result: the bytes, or the end.
gssize pass(GuardedStream* self, const void* buffer, gssize count) {
  if (count == 0) self->is_at_end = TRUE;
  if (count <= 0) return count;
  GuardedInput& input = *InputPtr::in(self->input);
  const auto* bytes = static_cast<const uint8_t*>(buffer);
  const RequestGuard::Verdict verdict =
      input.guard.take({bytes, static_cast<size_t>(count)}, MonotonicClock::now());
  if (verdict == RequestGuard::Verdict::kPass) return count;
  self->is_at_end = TRUE;
  refuse(self, input, verdict);
  return 0;
}

// --- the input stream
// ---------------------------------------------------------------------------------------

gssize read_waiting(GInputStream* stream, void* buffer, gsize count, GCancellable* cancellable,
                    GError** error) {
  const LibraryCall call(stream);
  auto* self = reinterpret_cast<GuardedStream*>(stream);
  if (self->is_at_end) return 0;
  return pass(self, buffer,
              g_input_stream_read(g_filter_input_stream_get_base_stream(&self->parent), buffer,
                                  count, cancellable, error));
}

gssize read_nonblocking(GPollableInputStream* stream, void* buffer, gsize count, GError** error) {
  const LibraryCall call(stream);
  auto* self = reinterpret_cast<GuardedStream*>(stream);
  if (self->is_at_end) return 0;
  return pass(
      self, buffer,
      g_pollable_input_stream_read_nonblocking(base_of(self), buffer, count, nullptr, error));
}

gboolean is_readable(GPollableInputStream* stream) {
  const LibraryCall call(stream);
  auto* self = reinterpret_cast<GuardedStream*>(stream);
  return self->is_at_end || g_pollable_input_stream_is_readable(base_of(self));
}

GSource* create_source(GPollableInputStream* stream, GCancellable* cancellable) {
  const std::unique_ptr<GSource, UnrefSource> base(g_pollable_input_stream_create_source(
      base_of(reinterpret_cast<GuardedStream*>(stream)), cancellable));
  return g_pollable_source_new_full(stream, base.get(), nullptr);
}

void implement_pollable(gpointer interface, gpointer) {
  auto* pollable = static_cast<GPollableInputStreamInterface*>(interface);
  pollable->is_readable = is_readable;
  pollable->create_source = create_source;
  pollable->read_nonblocking = read_nonblocking;
}

void finalize_stream(GObject* object) {
  taken_from_library(object);
  auto* self = reinterpret_cast<GuardedStream*>(object);
  if (self->input != nullptr) InputPtr::destroy(self->input);
  G_OBJECT_CLASS(g_type_class_peek_static(G_TYPE_FILTER_INPUT_STREAM))->finalize(object);
}

void init_stream_class(gpointer type_class, gpointer) {
  G_OBJECT_CLASS(type_class)->finalize = finalize_stream;
  G_INPUT_STREAM_CLASS(type_class)->read_fn = read_waiting;
}

GType stream_type() {
  static const GType type = [] {
    const GType made = g_type_register_static_simple(
        G_TYPE_FILTER_INPUT_STREAM, "SightlineGuardedStream", sizeof(GuardedStreamClass),
        init_stream_class, sizeof(GuardedStream), nullptr, static_cast<GTypeFlags>(0));
    const GInterfaceInfo pollable{implement_pollable, nullptr, nullptr};
    g_type_add_interface_static(made, G_TYPE_POLLABLE_INPUT_STREAM, &pollable);
    return made;
  }();
  return type;
}

// --- the connection
// -----------------------------------------------------------------------------------------

GIOStreamClass* connection_parent() {
  return G_IO_STREAM_CLASS(g_type_class_peek_static(G_TYPE_TCP_CONNECTION));
}

GInputStream* get_input_stream(GIOStream* stream) {
  const LibraryCall call(stream);
  auto* self = reinterpret_cast<GuardedConnection*>(stream);
  GInputStream* base = connection_parent()->get_input_stream(stream);
  GSocket* socket = g_socket_connection_get_socket(G_SOCKET_CONNECTION(stream));
  const gpointer input = g_object_get_qdata(G_OBJECT(socket), input_quark());
  if (input == nullptr) return base;
  if (self->stream == nullptr) {
    self->stream = G_INPUT_STREAM(
        g_object_new(stream_type(), "base-stream", base, "close-base-stream", FALSE, nullptr));
    auto* guarded = reinterpret_cast<GuardedStream*>(self->stream);
    guarded->socket = socket;
    guarded->input = InputPtr::make(InputPtr::in(input));
    handed_to_library(guarded);
  }
  return self->stream;
}

void finalize_connection(GObject* object) {
  taken_from_library(object);
  g_clear_object(&reinterpret_cast<GuardedConnection*>(object)->stream);
  G_OBJECT_CLASS(g_type_class_peek_static(G_TYPE_TCP_CONNECTION))->finalize(object);
}

void init_connection_class(gpointer type_class, gpointer) {
  G_OBJECT_CLASS(type_class)->finalize = finalize_connection;
  G_IO_STREAM_CLASS(type_class)->get_input_stream = get_input_stream;
}

constexpr GSocketProtocol kGuarded = G_SOCKET_PROTOCOL_SCTP;

/// GIO makes our connections of sockets with the protocol kGuarded from now on.
void register_connection_type() {
  static const bool once = [] {
    const GType type = g_type_register_static_simple(
        G_TYPE_TCP_CONNECTION, "SightlineGuardedConnection", sizeof(GuardedConnectionClass),
        init_connection_class, sizeof(GuardedConnection), nullptr, static_cast<GTypeFlags>(0));
    for (const GSocketFamily family : {G_SOCKET_FAMILY_IPV4, G_SOCKET_FAMILY_IPV6}) {
      SL_CHECK(g_socket_connection_factory_lookup_type(family, G_SOCKET_TYPE_STREAM, kGuarded) ==
                   G_TYPE_SOCKET_CONNECTION,
               "GIO knows no connections over SCTP");
      g_socket_connection_factory_register_type(type, family, G_SOCKET_TYPE_STREAM, kGuarded);
    }
    return true;
  }();
  static_cast<void>(once);
}

/// The property can be set at construction only, when GIO asks the kernel instead.
void set_protocol(GSocket* socket, GSocketProtocol protocol) {
  GObjectClass* type_class = G_OBJECT_GET_CLASS(socket);
  GParamSpec* property = g_object_class_find_property(type_class, "protocol");
  GValue value = G_VALUE_INIT;
  g_value_init(&value, G_TYPE_SOCKET_PROTOCOL);
  g_value_set_enum(&value, protocol);
  type_class->set_property(G_OBJECT(socket), property->param_id, &value, property);
  g_value_unset(&value);
}

}  // namespace

void guard_socket(GSocket* socket, std::shared_ptr<GuardedInput> input) {
  register_connection_type();
  g_object_set_qdata_full(G_OBJECT(socket), input_quark(), InputPtr::make(std::move(input)),
                          InputPtr::destroy);
  set_protocol(socket, kGuarded);
}

}  // namespace sightline::stream
