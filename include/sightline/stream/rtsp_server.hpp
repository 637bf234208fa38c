// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/stream_types.hpp"

namespace sightline {

/// A name and a password.
struct RtspUser {
  std::string name, secret;

  bool operator==(const RtspUser&) const = default;
};

struct RtspOptions {
  /// Numeric address or host name to bind. Without users "0.0.0.0" lets everybody on the network
  /// watch.
  std::string address = "127.0.0.1";
  /// An address that is not loopback may be watched without passwords or without TLS. The daemon's
  /// to check.
  bool open = false;
  uint16_t port = 8554;  ///< 0: any free one, see RtspServer::port()
  /// A viewer that shows no sign of life (RTCP, keep-alive) for so long is dropped.
  Duration session_timeout = std::chrono::seconds(60);
  /// Connections. When all places are taken, the oldest connection without a session gives way to
  /// a new one; without such the new one is refused.
  int max_clients = 32;
  /// The same for connections from one address. 0: three quarters of max_clients for other hosts,
  /// all for this one.
  int max_clients_per_address = 0;

  /// Who may watch, by digest authentication. Empty: everybody who reaches the address.
  std::vector<RtspUser> users;
  /// Where the users come from (sightline/control/access.hpp); the daemon reads it. Empty: nowhere.
  std::filesystem::path tokens;
  uint64_t tokens_content = 0;  ///< hash of that file, so that new tokens are a difference

  /// In PEM. With them the server speaks TLS alone (rtsps://), and sends RTP inside it alone.
  std::string certificate_pem, key_pem;
  /// Where these come from, as `users` from `tokens`.
  std::filesystem::path certificate, key;
  uint64_t tls_content = 0;
  bool tls() const { return !certificate_pem.empty(); }

  bool operator==(const RtspOptions&) const = default;
};

struct RtspStreamOptions {
  int width = 0;
  int height = 0;
  double rate_hz = 30;  ///< nominal
};

/// One camera's address on the server. Any thread.
class RtspStream {
 public:
  virtual ~RtspStream() = default;

  /// Viewers that are playing now.
  virtual int viewers() const = 0;
  /// True while a client asks for the stream or plays it; false within a second of the last one's
  /// TEARDOWN, lost connection or time-out. Without it nothing needs to be drawn or encoded.
  virtual bool wanted() const = 0;
  /// Sends a packet to all viewers; never waits. Cheap without viewers. Starts with a key frame;
  /// after a packet had to be dropped, goes on with the next key frame.
  virtual void push(const EncodedPacket& packet) = 0;
  /// Packets that could not be sent on (the server's thread did not keep up).
  virtual uint64_t dropped() const = 0;
  /// Called on a server thread when wanted() changes; must not block nor call the server.
  virtual void on_wanted(std::function<void(bool wanted)> callback) = 0;
  /// Called on a server thread or from push() when a viewer needs a key frame to start: connect it
  /// to VideoEncoder::request_keyframe(), which limits the rate.
  virtual void on_keyframe_wanted(std::function<void()> callback) = 0;
  /// Called on a GStreamer thread for each image when its packets have been made for the network,
  /// with the time since its capture; must be quick.
  virtual void on_sent(std::function<void(Duration age)> callback) = 0;
  /// "rtsp://ADDRESS:PORT/NAME"
  virtual std::string url() const = 0;
};

/// Serves H.264 access units at rtsp://ADDRESS:PORT/NAME over RTP (UDP, or interleaved in the RTSP
/// connection), one shared pipeline per stream. RTP time stamps are capture times, so streams of
/// one server are on one clock. A viewer that does not read is cut off and harms nobody; so is a
/// client whose request is longer than 16 KiB, is not complete within 10 s, or is not RTSP.
/// RTSP inside HTTP is refused, so that no page in a browser can watch. UDP stays at `address`.
class RtspServer {
 public:
  /// Binds the port; connections are answered once run() runs. A busy port is an Error that names
  /// it and what to do. An address that other hosts reach is warned of in the log.
  static Result<std::unique_ptr<RtspServer>> create(const RtspOptions& options);
  /// After run() has returned.
  ~RtspServer();
  RtspServer(const RtspServer&) = delete;
  RtspServer& operator=(const RtspServer&) = delete;

  /// Opens /NAME; any thread. kInvalidInput if the name is taken or not made of letters, digits and
  /// "-_.".
  Result<std::shared_ptr<RtspStream>> add_stream(const std::string& name,
                                                 const RtspStreamOptions& options);
  /// Closes /NAME and drops its viewers; any thread. push() on the stream is harmless afterwards.
  void remove_stream(const std::string& name);

  uint16_t port() const;
  int clients() const;

  /// Serves in the calling thread until `stop`; returns within a second of it. GStreamer runs
  /// threads of its own: one per client connection and one per stream that is wanted. `on_tick` is
  /// called on the calling thread, twice a second while it makes progress.
  void run(std::stop_token stop, const std::function<void()>& on_tick = {});

 private:
  struct Impl;
  explicit RtspServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
