// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sightline/geometry/axis_history.hpp"
#include "sightline/model/frame.hpp"
#include "sightline/model/pose_track.hpp"
#include "sightline/observe/turn/panorama.hpp"
#include "sightline/observe/turn/turn_learner.hpp"
#include "sightline/pipeline/rig.hpp"

namespace sightline {

/// What the picture of a camera that turns has to say of its angles.
enum class RefinerVerdict : uint8_t {
  kNone,      ///< nothing: no texture, most of it moves, or its angles are not known
  kLearning,  ///< it has become a keyframe
  kUsed,      ///< it has refined the angles
  kRefused,   ///< it contradicts the encoder, which alone is believed
  kJumped,    ///< the readings have jumped and the picture has not: they are not believed
  kReversed,  ///< the picture turns the other way than the readings: they are not believed
};
/// "none", "learning", "used", ...
std::string_view to_string(RefinerVerdict verdict);

/// Of the newest frame.
struct RefinerStatus {
  RefinerVerdict verdict = RefinerVerdict::kNone;
  size_t keyframes = 0;
  double latency_s = 0, latency_sigma_s = 0;  ///< of the encoder, by the picture
  bool latency_known = false;                 ///< it is used; until then the configured one is
  bool latency_contradicted = false;          ///< and the configured one is wrong
  double sigma = 0;                           ///< of the angles used, the larger [rad]
};

/// What moves before a camera: an object's box.
struct MovingBox {
  ObjectId object;
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();  ///< its frame
};
std::vector<MovingBox> moving_boxes(const Rig& rig);

/// Angles of one camera that turns, refined by its pictures: what the static surroundings say
/// (Panorama) beside what the encoder says, weighted by information (TurnFilter), and with the
/// encoder's latency as it was found. A picture that contradicts the encoder beyond a gate is not
/// used; where pictures contradict it again and again, all that was learned of the surroundings is
/// dropped and looked at again after a pause that grows. Readings that jump while the picture goes
/// on, and those that count the other way than the picture turns, are not believed: the frame's
/// place is then AxesState::kUnsettled. It takes from frames what it needs:
/// their readings, so replay and live are alike. One thread at a time.
class AngleRefiner {
 public:
  /// Null: the camera stands still.
  static std::unique_ptr<AngleRefiner> create(const CalibratedCamera& camera);
  ~AngleRefiner();

  /// The same frame with the refined place, or the same frame where there is nothing to refine.
  /// Objects with a pose are left out of the picture. Frames come in order of capture.
  FramePtr step(const FramePtr& frame, std::span<const PoseTrackPtr> tracks,
                std::span<const MovingBox> boxes);
  const RefinerStatus& status() const { return status_; }
  /// Something that should be told, once: the configured latency is contradicted, readings are not
  /// believed any more, or are again.
  std::optional<std::string> news();

 private:
  explicit AngleRefiner(const CalibratedCamera& camera);
  struct Found {
    size_t keyframe = 0;
    PictureAngles picture;
  };
  /// Squares of what readings and picture turned by between frames, and their product [rad^2].
  struct Way {
    double encoder = 0, picture = 0, both = 0;
    double turned = 0;  ///< all in all, by the readings [rad]
  };
  bool take_readings(const CameraPlace& place);
  void note_way(Time capture, const Eigen::Vector2d& encoder, const Eigen::Vector2d& picture);
  void judge_way(Time capture);
  /// Whether readings that come back after a gap have jumped in it, or are still off since.
  bool has_jumped(const FrameInfo& info, const EncoderAngles& encoder);
  CameraPlacePtr not_believed(const CameraPlacePtr& from) const;
  std::optional<EncoderAngles> encoder(Time capture, double latency) const;
  void learn(Time capture);
  void look(const Frame& frame, std::span<const PoseTrackPtr> tracks,
            std::span<const MovingBox> boxes, const Rigid3& camera_from_world);
  std::optional<Found> find(Time capture, const EncoderAngles& encoder);
  double distance(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
  std::optional<size_t> nearest(const Eigen::Vector2d& angles, double within) const;
  size_t free_place(size_t but) const;
  void begin_keyframe(Time capture, const EncoderAngles& encoder, std::optional<size_t> instead);
  CameraPlacePtr place(const CameraPlace& from, const TurnedAngles& angles, AxesState state);
  CameraPlacePtr by_encoder(Time capture, const CameraPlacePtr& from);
  CameraPlacePtr by_picture(const FrameInfo& info, const EncoderAngles& encoder);
  void drop_keyframes(bool latency);
  void note_status();

  const CalibratedCamera camera_;
  const CameraAxes axes_;  ///< without the latency's sigma
  AxisHistory history_;
  TurnLearner learner_;
  Panorama panorama_;
  std::vector<uint64_t> uses_;  ///< by keyframe: when it was used last
  uint64_t now_ = 0;
  Time last_reading_{}, last_found_{}, paused_until_{}, agreed_since_{};
  Eigen::Vector2d apart_ = Eigen::Vector2d::Zero();  ///< picture less encoder, when last found
  int contradicted_ = 0;  ///< of the frames whose readings have come: in a row, up to now
  int misses_ = 0;        ///< in a row
  Duration pause_;
  std::array<Way, 2> ways_;                                              ///< pan, tilt
  std::optional<std::pair<Eigen::Vector2d, Eigen::Vector2d>> way_from_;  ///< encoder, picture
  Eigen::Vector2d held_ = Eigen::Vector2d::Zero(), held_rates_ = Eigen::Vector2d::Zero();
  Time held_at_{};    ///< when the picture and the encoder agreed on `held_` last
  bool gap_ = false;  ///< the angles were not known since
  bool jumped_ = false;
  std::optional<size_t> reversed_;  ///< 0: pan, 1: tilt
  RefinerStatus status_;
  RefinerVerdict told_verdict_ = RefinerVerdict::kNone;
  bool told_latency_ = false;
};

}  // namespace sightline
