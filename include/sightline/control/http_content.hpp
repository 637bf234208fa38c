// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "sightline/base/counters.hpp"
#include "sightline/base/result.hpp"
#include "sightline/base/unique_fd.hpp"
#include "sightline/geometry/rigid3.hpp"

namespace sightline {

struct Health {
  bool ok = true;
  std::string text;  ///< one line for a person
};

/// Tells the server's thread that a stream may have something new. Any thread, never waits; many
/// calls before the server comes to look are one.
class HttpWaker {
 public:
  static Result<std::shared_ptr<HttpWaker>> create();
  void wake() const;
  /// The server's side: readable once somebody woke it.
  int fd() const { return event_.get(); }
  void clear() const;

 private:
  explicit HttpWaker(UniqueFd event) : event_(std::move(event)) {}
  const UniqueFd event_;
};

/// A body that is made while it is sent: events, pictures. All calls come on the server's thread
/// and must not block. A chunk is asked for only once the one before has been taken over by the
/// kernel, so a reader that is slow leaves chunks out instead of piling them up.
class HttpStream {
 public:
  using Chunk = std::shared_ptr<const std::string>;
  virtual ~HttpStream() = default;
  /// Whether next() has something; asked after every HttpWaker::wake() and a few times a second.
  virtual bool ready() = 0;
  /// Null: nothing now, and never again if ended().
  virtual Chunk next() = 0;
  virtual bool ended() const { return false; }
};

/// What goes back. With `stream` the body is that, without an end; with `later` the request waits:
/// it is called as often as HttpStream::ready(), until it gives the answer.
struct HttpReply {
  unsigned status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers{};
  std::shared_ptr<HttpStream> stream{};
  std::optional<uint64_t> length{};  ///< of `stream`, where it has an end [bytes]
  std::function<std::optional<HttpReply>()> later{};

  static HttpReply json(std::string body) { return {200, "application/json", std::move(body)}; }
  /// A text that ends in a line break.
  static HttpReply text(unsigned status, std::string text) {
    return {status, "text/plain; charset=utf-8", std::move(text) + "\n"};
  }
  /// {"error": "..."}
  static HttpReply error(unsigned status, const std::string& text);
  /// The same; the status follows from the code.
  static HttpReply error(const Error& error);
};

/// Where somebody says that an object is: in one camera's picture, or a pose (world_from_object).
struct HintRequest {
  struct Place {
    std::string camera;
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
    std::optional<double> radius_px{};
  };
  std::variant<Place, Rigid3> where;
};

/// Which pictures a client wants to see.
struct PictureRequest {
  std::vector<std::string> cameras;  ///< by name; empty: all
  bool annotated = true;             ///< false: as the camera sees it
  double max_rate_hz = 0;            ///< of each camera; 0: as they come
};

/// What of recordings somebody starts or stops.
struct RecordingOrder {
  std::vector<std::string> kinds;   ///< empty: as configured, or all that run
  std::optional<double> seconds{};  ///< then it ends by itself
};

/// Where a head is to turn, and for how long it stands there.
struct TurnOrder {
  std::optional<Eigen::Vector2d> pan_tilt{};  ///< [rad]; empty: it stops where it is
  std::optional<double> seconds{};            ///< empty: as configured
};

/// Views of a calibration target that are to be captured.
struct CaptureOrder {
  std::string target{};                ///< name of one that is listed; empty: the only one
  std::string target_toml{};           ///< the text of a target file, instead
  std::vector<std::string> cameras{};  ///< by name; empty: all
  bool keep_lenses = false;            ///< as they are in force: only places are solved for
  bool moving = false;                 ///< the target need not be held still
  bool readouts = false;               ///< those of rolling shutters are solved for; with moving
  bool resume = false;                 ///< goes on with the views of the newest capture
};

/// How objects are to be drawn from now on.
struct OverlayRequest {
  std::string camera;  ///< or virtual camera; empty: all
  std::string keys;    ///< of [overlay] in the installation file, as TOML
};

/// What a browser offers to play a camera by WebRTC (WHEP).
struct WhepRequest {
  std::string camera;
  std::string sdp;
  std::string address;  ///< numeric; of this host, as the browser reached it
};

/// What the server shows and what it may do. Called on the thread of HttpServer::run(), one
/// request at a time; must not block. An empty function: 404 where it would be asked.
struct HttpContent {
  const Registry* registry = nullptr;       ///< for /metrics; outlives the server
  std::function<Health()> health;           ///< for /healthz; empty: always healthy
  std::function<std::string()> state_json;  ///< for /api/state and /api/v1/state; empty: "{}"
  std::function<Health()> ready{};          ///< for /readyz; empty: always ready
  std::function<HttpReply()> home{};        ///< for /; empty: the page of the daemon

  std::function<std::string()> version_json{}, cameras_json{}, objects_json{}, poses_json{};
  /// One of them by name; nullopt: there is none of that name.
  std::function<std::optional<std::string>(const std::string&name)> camera_json{}, object_json{};

  std::function<Status(const std::string& object, const HintRequest&)> hint{};
  std::function<Status(const std::string& object)> forget{};
  std::function<Status(const std::string& camera, const TurnOrder&)> turn{};
  std::function<Status(const std::string& camera)> follow{};
  std::function<Status()> reload{};  ///< asks for one; how it went is in the state

  std::function<std::string()> overlay_json{};
  std::function<HttpReply(const OverlayRequest&)> set_overlay{};
  std::function<HttpReply()> reset_overlay{};  ///< to that of the file

  std::function<std::string()> scene_json{}, points_json{};
  /// A mesh as docs/api.md describes; of the object of that name, or of the static scene.
  std::function<HttpReply(const std::string& object)> object_mesh{};
  std::function<HttpReply()> scene_mesh{};

  std::function<std::string()> calibration_json{};
  std::function<HttpReply()> calibration_report{};  ///< a page
  /// Takes over what is proposed for these cameras; empty: for all.
  std::function<HttpReply(const std::vector<std::string>& cameras)> accept_calibration{};

  std::function<std::string()> capture_json{};  ///< what a capture of target views is at
  std::function<HttpReply()> capture_targets{}, capture_report{};
  std::function<HttpReply(const CaptureOrder&)> start_capture{};
  std::function<Status()> stop_capture{};  ///< what was taken is solved

  std::function<std::string()> recordings_json{};
  std::function<Status(const RecordingOrder&)> start_recording{}, stop_recording{};
  std::function<Status(const std::string& text)> mark_recording{};
  /// One file of a recording; `range` as the client's header has it, or empty.
  std::function<Result<HttpReply>(const std::string& name, const std::string& file,
                                  const std::string& range)>
      recording_file{};

  /// Server-sent events; `with_state`: the state once a second beside the poses.
  std::function<std::shared_ptr<HttpStream>(bool with_state)> events{};
  /// multipart/mixed of several cameras, or multipart/x-mixed-replace of one.
  std::function<Result<HttpReply>(const PictureRequest&)> pictures{}, motion_jpeg{};
  /// One JPEG of the one camera that is named.
  std::function<Result<HttpReply>(const PictureRequest&)> snapshot{};

  /// 201 with Location and the answer's SDP, perhaps later.
  std::function<HttpReply(WhepRequest)> whep_offer{};
  std::function<HttpReply(const std::string& session)> whep_end{};

  std::shared_ptr<HttpWaker> waker{};  ///< null: streams are looked at a few times a second only
};

}  // namespace sightline
