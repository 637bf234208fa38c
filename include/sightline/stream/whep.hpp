// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "sightline/base/result.hpp"
#include "sightline/model/stream_types.hpp"

namespace sightline {

struct WhepOptions {
  int max_viewers = 32;  ///< of all cameras together, those that are not connected yet among them
  /// A viewer that has not connected so long after its answer is dropped.
  Duration connect_timeout = std::chrono::seconds(10);
  /// One whose receiver reports stop for so long, too: its machine or network is gone.
  Duration silence_timeout = std::chrono::seconds(15);
};

/// One camera's way to browsers. Any thread.
class WhepStream {
 public:
  virtual ~WhepStream() = default;

  /// Viewers that play now.
  virtual int viewers() const = 0;
  /// True while a viewer plays; without it nothing needs to be drawn or encoded for it.
  virtual bool wanted() const = 0;
  /// Sends a packet to all viewers; never waits. Each starts with a key frame, and after a packet
  /// that had to be dropped goes on with the next one.
  virtual void push(const EncodedPacket& packet) = 0;
  /// Packets that could not be sent on.
  virtual uint64_t dropped() const = 0;
  /// Called on any thread when a viewer needs a key frame: connect it to
  /// VideoEncoder::request_keyframe(), which limits the rate. Must not block nor come back here.
  virtual void on_keyframe_wanted(std::function<void()> callback) = 0;
  /// As RtspStream::on_sent(), once for each viewer.
  virtual void on_sent(std::function<void(Duration age)> callback) = 0;
};

/// What a browser is answered.
struct WhepAnswer {
  std::string id;   ///< of the session, not to be guessed: who knows it may end it
  std::string sdp;  ///< complete: all candidates are in it
};

/// An offer that is being worked on. Any thread.
class WhepPending {
 public:
  virtual ~WhepPending() = default;
  /// Nothing until there is an answer, or a refusal; then that, always. kInvalidInput: no offer of
  /// a viewer of H.264; kUnavailable: too many viewers, or the daemon ends.
  virtual std::optional<Result<WhepAnswer>> answer() const = 0;
};

/// Sends H.264 to browsers by WebRTC, asked by WHEP offers (SDP, without trickle), from the access
/// units that the camera's one encoder made. Each viewer has a GStreamer pipeline of its own.
/// Its ICE agent is reachable at one address, the one that the browser asked at; candidates of the
/// browser are not used, since it is the one who calls: so nobody makes this host send to a third.
class WhepServer {
 public:
  /// kUnavailable says what is missing where this build or this machine has no WebRTC.
  static Result<std::shared_ptr<WhepServer>> create(const WhepOptions& options);
  virtual ~WhepServer() = default;

  /// The same one for the same name, until it is closed.
  virtual std::shared_ptr<WhepStream> stream(const std::string& camera) = 0;
  /// Ends all other streams and their viewers.
  virtual void keep_only(const std::vector<std::string>& cameras) = 0;

  /// Asks for a viewer of a camera, whose browser reaches this host at `address` (numeric).
  /// `on_answer` is called once on the server's thread when there is an answer. Never waits.
  virtual std::shared_ptr<WhepPending> offer(const std::string& camera, std::string sdp,
                                             std::string address,
                                             std::function<void()> on_answer) = 0;
  /// Ends a session; false if there is none of that id.
  virtual bool end(const std::string& id) = 0;
  /// In place of WhepOptions::max_viewers; who is there may stay.
  virtual void set_max_viewers(int most) = 0;
  /// Sessions that have not ended.
  virtual int sessions() const = 0;

  /// Serves in the calling thread until `stop`, then ends all viewers. Begins with a session of its
  /// own, so that the first viewer need not wait for what is initialized once. `on_tick` is called
  /// on it about twice a second, while it makes progress.
  virtual void run(std::stop_token stop, const std::function<void()>& on_tick) = 0;
};

}  // namespace sightline
