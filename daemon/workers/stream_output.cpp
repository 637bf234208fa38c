// SPDX-License-Identifier: Apache-2.0
#include "workers/stream_output.hpp"

#include <utility>

#include "sightline/base/log.hpp"
#include "workers/stage_latency.hpp"

namespace sightline {

using namespace std::chrono_literals;

std::shared_ptr<StreamOutput> StreamOutput::create(std::string camera, EncoderOptions options,
                                                   std::vector<NamedObject> names,
                                                   std::shared_ptr<RtspStream> stream,
                                                   std::shared_ptr<WhepStream> browsers,
                                                   std::shared_ptr<PictureSlot> pictures,
                                                   std::shared_ptr<RecordingSinkWorker> recorder,
                                                   Registry& registry) {
  std::shared_ptr<StreamOutput> output(
      new StreamOutput(std::move(camera), std::move(options), std::move(names), std::move(browsers),
                       std::move(pictures), std::move(recorder), registry));
  if (output->browsers_) {
    output->browsers_->on_keyframe_wanted([wanted = output->keyframe_wanted_] { *wanted = true; });
    output->browsers_->on_sent(
        [sent = output->sent_](Duration age) { sent->observe(to_seconds(age)); });
  }
  output->move_to(std::move(stream));
  return output;
}

void StreamOutput::move_to(std::shared_ptr<RtspStream> stream) {
  stream->on_keyframe_wanted([wanted = keyframe_wanted_] { *wanted = true; });
  stream->on_sent([sent = sent_](Duration age) { sent->observe(to_seconds(age)); });
  stream_->publish(std::move(stream));
}

void StreamOutput::adopt(std::vector<NamedObject> names,
                         const std::optional<EncoderOptions>& options) {
  names_ = std::move(names);
  if (!options) return;
  close();  // another one is made for the next image
  options_ = *options;
  retry_at_ = {};
}

StreamOutput::StreamOutput(std::string camera, EncoderOptions options,
                           std::vector<NamedObject> names, std::shared_ptr<WhepStream> browsers,
                           std::shared_ptr<PictureSlot> pictures,
                           std::shared_ptr<RecordingSinkWorker> recorder, Registry& registry)
    : camera_(std::move(camera)),
      browsers_(std::move(browsers)),
      pictures_(std::move(pictures)),
      recorder_(std::move(recorder)),
      registry_(registry),
      created_(std::move(options)),
      options_(created_),
      names_(std::move(names)),
      encoded_(registry.counter("sightline_images_encoded_total", "Images encoded",
                                {{"camera", camera_}})),
      dropped_(registry.counter("sightline_frames_dropped_total",
                                "Frames that a stage had no time for, by stage",
                                {{"camera", camera_}, {"stage", "encode"}})),
      unsent_(registry.counter("sightline_frames_dropped_total",
                               "Frames that a stage had no time for, by stage",
                               {{"camera", camera_}, {"stage", "send"}})),
      viewers_(registry.gauge("sightline_viewers", "RTSP viewers playing", {{"camera", camera_}})),
      bytes_(registry.counter("sightline_encoded_bytes_total", "Bytes of encoded video",
                              {{"camera", camera_}})),
      encoded_latency_(&stage_latency(registry, camera_, "encoded")),
      sent_(&stage_latency(registry, camera_, "sent")),
      browser_viewers_(registry.gauge("sightline_webrtc_viewers", "WebRTC viewers playing",
                                      {{"camera", camera_}})) {}

StreamOutput::~StreamOutput() { close(); }

std::shared_ptr<VideoEncoder> StreamOutput::encoder() const {
  std::lock_guard lock(mutex_);
  return encoder_;
}

std::string StreamOutput::encoder_name() const {
  const auto current = encoder();
  return current ? current->encoder_name() : "";
}

size_t StreamOutput::encoding() const {
  const auto current = encoder();
  if (!current) return 0;
  const EncoderCounts counts = current->counts();
  const uint64_t out = counts.encoded + counts.dropped;
  return counts.pushed > out ? counts.pushed - out : 0;
}

bool StreamOutput::make_encoder() {
  if (MonotonicClock::now() < retry_at_) return false;
  const auto hand_out =
      [stream = stream_, browsers = browsers_, recorder = recorder_, packets = packets_,
       bytes = &bytes_, latency = encoded_latency_,
       view = ViewPacket{camera_, options_.width, options_.height, options_.rate_hz, 0, {}}](
          EncodedPacket packet) {
        bytes->add(packet.bytes->size());
        observe_age(*latency, packet.capture);
        stream->read()->push(packet);
        if (browsers) browsers->push(packet);
        const uint64_t number = ++*packets;
        if (!recorder->wants_video()) return;
        ViewPacket recorded = view;
        recorded.number = number;
        recorded.packet = std::move(packet);
        recorder->push(std::move(recorded));
      };
  auto made = VideoEncoder::create(options_, camera_, hand_out);
  if (!made) {
    log::error({.camera = camera_, .cause = "encoder"}, "{}: {}", camera_, made.error().message());
    retry_at_ = MonotonicClock::now() + 5s;
    return false;
  }
  const std::string& name = (*made)->encoder_name();
  log::info({.camera = camera_}, "{}: encoding with {}", camera_, name);
  in_use_ = &registry_.gauge("sightline_encoder", "1 for the encoder that is in use",
                             {{"camera", camera_}, {"encoder", name}});
  in_use_->set(1);
  counted_ = {};
  std::lock_guard lock(mutex_);
  encoder_ = *std::move(made);
  return true;
}

void StreamOutput::accept(const AnnotatedImage& image) {
  pictures_->offer(PictureKind::kAnnotated, image.image, image.frame);
  if (!video_wanted()) return;
  // A recording begins with a key frame.
  const uint64_t begun = recorder_->begun();
  if (std::exchange(recordings_seen_, begun) != begun) *keyframe_wanted_ = true;
  auto current = encoder();
  if (current) {
    if (const auto failure = current->failure()) {
      log::error({.camera = camera_, .cause = "encoder"}, "{}: encoder lost: {}", camera_,
                 failure->message());
      close();
      retry_at_ = MonotonicClock::now() + 1s;
      current.reset();
    }
  }
  if (!current) {
    if (!make_encoder()) {
      dropped_.add();
      return;
    }
    current = encoder();
  }
  if (keyframe_wanted_->exchange(false)) current->request_keyframe();
  current->push(image, names_);
  report();
}

void StreamOutput::report() {
  if (const auto current = encoder()) {
    const EncoderCounts counts = current->counts();
    encoded_.add(counts.encoded - counted_.encoded);
    dropped_.add(counts.dropped - counted_.dropped);
    counted_ = counts;
  }
  const std::shared_ptr<RtspStream> stream = stream_->read();
  if (std::exchange(counted_stream_, stream) != stream) unsent_counted_ = 0;
  const uint64_t unsent = stream->dropped();
  unsent_.add(unsent - unsent_counted_);
  unsent_counted_ = unsent;
  viewers_.set(stream->viewers());
  browser_viewers_.set(browsers());
  const uint64_t to_browsers = browsers_ ? browsers_->dropped() : 0;
  unsent_.add(to_browsers - std::exchange(unsent_to_browsers_, to_browsers));
}

void StreamOutput::close() {
  std::shared_ptr<VideoEncoder> last;
  std::lock_guard lock(mutex_);
  last.swap(encoder_);
  if (in_use_ != nullptr) std::exchange(in_use_, nullptr)->set(0);
}

}  // namespace sightline
