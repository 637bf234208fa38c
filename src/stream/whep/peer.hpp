// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>

#include "sightline/base/result.hpp"
#include "sightline/base/time.hpp"
#include "stream/gst_ptr.hpp"
#include "stream/whep/fan_out.hpp"
#include "stream/whep/offer.hpp"

namespace sightline::stream {

/// One viewer: a pipeline of its own from packets to the network, and its state. Made, looked at
/// and ended on the server's thread; GStreamer's threads only note what happens.
class Peer {
 public:
  /// Takes as long as an answer takes, at most kPatience.
  static Result<std::unique_ptr<Peer>> create(std::string id, std::shared_ptr<FanOut> stream,
                                              const ViewerOffer& offer, const std::string& address);
  ~Peer();
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  const std::string& answer() const { return answer_; }
  const FanOut* stream() const { return stream_.get(); }
  /// Starts sending once it is connected. Call it a few times a second.
  void step(Time now);
  /// Gone, never came, or silent.
  bool is_over(Time now, Duration connect_timeout, Duration silence_timeout) const;

  static constexpr Duration kPatience = std::chrono::seconds(3);

 private:
  /// What GStreamer's threads note; they may come after the peer is gone.
  struct Notes {
    std::mutex mutex;
    std::condition_variable changed;
    bool gathered = false;
    std::atomic<bool> connected{false}, ended{false};
    std::atomic<Time> heard{};  ///< the last receiver report
    std::weak_ptr<FanOut> stream;
  };

  Peer(std::string id, std::shared_ptr<FanOut> stream);
  Status build(const ViewerOffer& offer, const std::string& address);
  Status reach_at(const std::string& address);
  void listen();
  void listen_to_reports();
  Status negotiate(const ViewerOffer& offer);
  Status wait_for_candidates();

  const std::string id_;
  const std::shared_ptr<FanOut> stream_;
  const std::shared_ptr<Notes> notes_ = std::make_shared<Notes>();
  const Time since_ = MonotonicClock::now();
  GstObjectPtr<GstElement> pipeline_, source_, webrtc_;
  std::string answer_;
  bool sends_ = false;
};

}  // namespace sightline::stream
