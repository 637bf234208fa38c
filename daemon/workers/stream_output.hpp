// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "recording/recording_sink_worker.hpp"
#include "sightline/base/counters.hpp"
#include "sightline/base/snapshot.hpp"
#include "sightline/model/seams.hpp"
#include "sightline/stream/encoder.hpp"
#include "sightline/stream/rtsp_server.hpp"
#include "sightline/stream/whep.hpp"
#include "web/picture_board.hpp"

namespace sightline {

/// The way out of one camera: its encoder with its RTSP address and its WebRTC viewers, and its
/// pictures for browsers. The encoder is made when the first viewer asks and made again should it
/// fail; without images it costs nothing.
class StreamOutput : public ImageSink {
 public:
  static std::shared_ptr<StreamOutput> create(std::string camera, EncoderOptions options,
                                              std::vector<NamedObject> names,
                                              std::shared_ptr<RtspStream> stream,
                                              std::shared_ptr<WhepStream> browsers,
                                              std::shared_ptr<PictureSlot> pictures,
                                              std::shared_ptr<RecordingSinkWorker> recorder,
                                              Registry& registry);
  ~StreamOutput() override;

  bool wanted() const override { return video_wanted() || pictures_->wanted(); }
  /// Somebody wants what accept() takes, and not only pictures without annotation.
  bool wants_annotated() const {
    return video_wanted() || pictures_->wanted(PictureKind::kAnnotated);
  }
  /// From the drawing thread only.
  void accept(const AnnotatedImage& image) override;
  /// Brings the counters up to date; from the drawing thread, also when there is nothing to draw.
  void report();
  /// Goes on with other objects, and with another encoder if `options` are given. From the drawing
  /// thread, or while there is none.
  void adopt(std::vector<NamedObject> names, const std::optional<EncoderOptions>& options);
  /// Goes on at another server's address of the same name; its viewers have to come again. Any
  /// thread.
  void move_to(std::shared_ptr<RtspStream> stream);
  /// Ends the encoder; nothing may be accepted afterwards.
  void close();

  PictureSlot& pictures() const { return *pictures_; }
  int viewers() const { return stream_->read()->viewers(); }
  bool has_webrtc() const { return browsers_ != nullptr; }
  int browsers() const { return browsers_ ? browsers_->viewers() : 0; }
  std::string url() const { return stream_->read()->url(); }
  /// As given to create(): size and rate stay for good. Any thread.
  const EncoderOptions& options() const { return created_; }
  /// Element that encodes now, or empty.
  std::string encoder_name() const;
  /// Images that were handed to the encoder and have not come out.
  size_t encoding() const;

 private:
  StreamOutput(std::string camera, EncoderOptions options, std::vector<NamedObject> names,
               std::shared_ptr<WhepStream> browsers, std::shared_ptr<PictureSlot> pictures,
               std::shared_ptr<RecordingSinkWorker> recorder, Registry& registry);
  bool video_wanted() const {
    return stream_->read()->wanted() || (browsers_ && browsers_->wanted()) ||
           recorder_->wants_video();
  }
  std::shared_ptr<VideoEncoder> encoder() const;
  bool make_encoder();

  const std::string camera_;
  const std::shared_ptr<WhepStream> browsers_;  // null: no WebRTC
  const std::shared_ptr<PictureSlot> pictures_;
  const std::shared_ptr<RecordingSinkWorker> recorder_;
  uint64_t recordings_seen_ = 0;  // of recorder_->begun(), the drawing thread's
  Registry& registry_;
  const EncoderOptions created_;
  EncoderOptions options_;  // in force; the drawing thread's
  std::vector<NamedObject> names_;
  // Shared with the encoder's thread, never null inside.
  const std::shared_ptr<Snapshot<RtspStream>> stream_ = std::make_shared<Snapshot<RtspStream>>();
  Counter &encoded_, &dropped_, &unsent_;
  Gauge& viewers_;
  Counter& bytes_;
  LatencyHistogram *const encoded_latency_, *const sent_;  // live as long as the registry
  Gauge& browser_viewers_;
  Gauge* in_use_ = nullptr;  // of the encoder, if there is one
  EncoderCounts counted_;
  uint64_t unsent_counted_ = 0, unsent_to_browsers_ = 0;
  std::shared_ptr<RtspStream> counted_stream_;  // that `unsent_counted_` belongs to
  Time retry_at_{};                             // after a failed encoder

  // Packets so far, also of encoders that have gone: what tells the recorder of a gap.
  std::shared_ptr<std::atomic<uint64_t>> packets_ = std::make_shared<std::atomic<uint64_t>>(0);

  // Set on GStreamer threads, also after this object has gone, hence shared. The encoder itself is
  // only ever touched by the drawing thread, so it cannot be destroyed on one of its own threads.
  std::shared_ptr<std::atomic<bool>> keyframe_wanted_ = std::make_shared<std::atomic<bool>>(false);

  mutable std::mutex mutex_;  // guards encoder_
  std::shared_ptr<VideoEncoder> encoder_;
};

}  // namespace sightline
