// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "sightline/geometry/axis_history.hpp"
#include "sightline/observe/turn/turn_filter.hpp"

namespace sightline {

/// Feeds a TurnFilter: what pictures say waits for the readings of its time, which come later. As
/// long as the latency is vague, all that was learned is kept and learned anew whenever it turns
/// out to be another than what the readings were taken at (an iterated filter: what accelerations
/// is linearized where it belongs). Deterministic; one thread at a time.
class TurnLearner {
 public:
  explicit TurnLearner(const CameraAxes& axes);

  const TurnFilter& filter() const { return filter_; }
  void add(const AxisReading& reading);
  /// A frame that became keyframe `index`, new or in place of another. `encoder`: by what had been
  /// read when it came.
  void add_keyframe(Time capture, size_t index, const EncoderAngles& encoder);
  /// The same, of a picture whose angles the keyframe `by` told.
  void add_keyframe(Time capture, size_t index, size_t by, const PictureAngles& picture);
  /// A picture whose angles a keyframe told, by its view as it is now.
  void add_picture(Time capture, size_t keyframe, const PictureAngles& picture);

  /// Learns from all whose readings have come. Returns how many contradicted each other, in a row
  /// up to now.
  int advance();
  /// All keyframes; `latency`: and what is known of that. Otherwise it is a little less certain.
  void forget(bool latency);
  /// What waits for readings.
  void forget_waiting() { waiting_.clear(); }

 private:
  enum class Kind : uint8_t { kByEncoder, kByPicture, kPicture };
  struct Event {
    Kind kind = Kind::kPicture;
    Time capture{};
    size_t keyframe = 0, by = 0;
    KeyframeView view;  ///< that the picture was measured by
    PictureAngles picture;
    EncoderAngles encoder;  ///< kByEncoder: as it was known first
    double frame_s = 0;
  };
  std::optional<EncoderAngles> read(Time capture, double latency_s) const;
  TurnFilter::UpdateResult apply(TurnFilter& filter, const Event& event, double latency_s,
                                 double reach_s) const;
  void keep(const Event& event);
  void learn_anew();

  const CameraAxes axes_;
  TurnFilter::Options options_;
  TurnFilter filter_;
  std::deque<AxisReading> readings_;
  std::deque<Event> waiting_;
  std::vector<Event> kept_;  ///< all that the filter knows, while `keeps_`
  bool keeps_ = true;
  double taken_at_ = 0;  ///< latency that the readings were taken at, of what is kept
  Time last_{};
  int contradicted_ = 0;
};

}  // namespace sightline
