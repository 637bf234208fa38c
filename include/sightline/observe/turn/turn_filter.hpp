// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "sightline/observe/turn/panorama.hpp"

namespace sightline {

/// What an encoder says of the angles at one time if its readings are late by `latency_s`.
struct EncoderAngles {
  Eigen::Vector2d angles = Eigen::Vector2d::Zero();         ///< pan, tilt [rad]
  Eigen::Vector2d rates = Eigen::Vector2d::Zero();          ///< [rad/s]
  Eigen::Vector2d accelerations = Eigen::Vector2d::Zero();  ///< [rad/s^2]: how wrong the rates get
  Eigen::Vector2d sigmas = Eigen::Vector2d::Zero();  ///< [rad], without what the latency adds
  double latency_s = 0;
};

/// Angles with their covariance.
struct TurnedAngles {
  Eigen::Vector2d angles = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
};

/// The latency of an encoder, and the angles and mean inverse distances of a panorama's keyframes:
/// one Kalman filter over all of them (the angles of frames are eliminated). With readings e(s),
/// frames at t and keyframes k,
///     angles(t) = e(t + latency) + noise
///     angles(t) = picture(k) + by_keyframe * d(angles of k) + by_depth * d(inverse depth of k)
///                 + noise
/// so their difference measures the state. The latency tells itself apart from the keyframes'
/// angles once the rate of turning changes, distances from both once a keyframe is seen from other
/// angles: until then the covariance says so. Nothing is assumed of how the head moves.
/// (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001,
/// ch. 5 and 10.) Deterministic; one thread at a time.
class TurnFilter {
 public:
  struct Options {
    double latency_s = 0, latency_sigma_s = 0;  ///< as configured
    double step = 1e-3;                         ///< [rad] that makes two readings independent
  };
  explicit TurnFilter(const Options& options);

  double latency() const { return mean_(0); }
  double latency_sigma() const;  ///< [s], by what pictures said alone
  /// The latency is known: its sigma is at most kKnownSigma.
  bool latency_known() const { return latency_sigma() <= kKnownSigma; }
  /// And the configured one is wrong: beyond three sigmas of both and kTolerance.
  bool latency_contradicted() const;
  /// It is not known yet, but the configured one is probably wrong: beyond two sigmas of both.
  bool latency_suspect() const;
  /// What is to be used: what was configured and what was found in one, or the latter alone where
  /// the former is contradicted; the former alone until the latency is known.
  double used_latency() const;
  double used_latency_sigma() const;

  KeyframeView view(size_t index) const;
  /// Keyframe `index`, new or in place of another, is what the encoder says.
  void add_by_encoder(size_t index, const EncoderAngles& encoder);
  /// Keyframe `index` is a picture that another keyframe, `by`, tells the angles of.
  void add_by_picture(size_t index, size_t by, const PictureAngles& picture);
  void clear_keyframes();

  /// The angles of a frame from both; empty where they contradict each other.
  std::optional<TurnedAngles> fuse(const EncoderAngles& encoder, size_t keyframe,
                                   const PictureAngles& picture) const;
  enum class UpdateResult : uint8_t {
    kApplied,
    kNothingNew,   ///< the readings are those that were learned from before
    kContradicted  ///< by each other: nothing is learned
  };
  /// Learns from a frame whose encoder angles are known by now. `frame_s`: since the frame before
  /// [s]; `reach_s`: how far the latency may be off encoder.latency_s.
  UpdateResult learn(const EncoderAngles& encoder, size_t keyframe, const PictureAngles& picture,
                     double frame_s, double reach_s);
  /// Both contradict each other again and again: the latency is less certain.
  void doubt_latency();

  static constexpr double kKnownSigma = 0.003;                     ///< [s]
  static constexpr double kTolerance = 0.002;                      ///< [s]
  static constexpr double kLatencySigma = 0.06;                    ///< [s], before any picture
  static constexpr double kInverseDepth = 0.5, kDepthSigma = 0.6;  ///< [1/m], the same

 private:
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 1 + 3 * Panorama::kMaxKeyframes, 1>;
  using Covariance =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 1 + 3 * Panorama::kMaxKeyframes,
                    1 + 3 * Panorama::kMaxKeyframes>;
  using Block = Eigen::Matrix4d;  ///< latency, keyframe's pan, tilt, inverse depth
  static Eigen::Index first_of(size_t keyframe) {
    return 1 + 3 * static_cast<Eigen::Index>(keyframe);
  }
  void reserve(size_t index);
  Block block(size_t keyframe) const;
  Eigen::Matrix<double, 2, 4> difference_slopes(const EncoderAngles& encoder,
                                                const PictureAngles& picture) const;
  Eigen::Vector2d at_latency(const EncoderAngles& encoder) const;
  Eigen::Vector4d part(size_t keyframe) const;  ///< the state that block() is the covariance of
  void update(double residual, const Eigen::RowVector4d& slopes, double variance, size_t keyframe);

  Options options_;
  Covariance covariance_;  ///< of latency and, by keyframe, pan, tilt, inverse depth
  State mean_;             ///< of the same
  Eigen::Vector2d used_;   ///< angles whose readings were learned from last
};

}  // namespace sightline
