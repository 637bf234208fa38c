// SPDX-License-Identifier: Apache-2.0
#include "record/media/encoder.hpp"

namespace sightline::record {

Result<std::unique_ptr<Encoder>> Encoder::create(const Settings& settings,
                                                 const std::string& where) {
  av::quiet();
  std::unique_ptr<Encoder> encoder(new Encoder(where));
  encoder->context_.reset(avcodec_alloc_context3(settings.codec));
  encoder->frame_.reset(av_frame_alloc());
  encoder->packet_.reset(av_packet_alloc());
  SL_CHECK(encoder->context_ && encoder->frame_ && encoder->packet_, "out of memory");
  AVCodecContext& context = *encoder->context_;
  context.width = settings.width;
  context.height = settings.height;
  context.pix_fmt = settings.format;
  context.time_base = {1, 1000};
  context.gop_size = settings.gop;
  context.thread_count = 1;
  context.flags |= AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_BITEXACT;
  AVDictionary* options = nullptr;
  for (const auto& [key, value] : settings.options) av_dict_set(&options, key, value, 0);
  const int code = avcodec_open2(&context, settings.codec, &options);
  av_dict_free(&options);
  if (code < 0) return av::error(where, "start the encoder", code);
  return encoder;
}

Result<AVFrame*> Encoder::frame() {
  frame_->format = context_->pix_fmt;
  frame_->width = context_->width;
  frame_->height = context_->height;
  const int code =
      frame_->buf[0] ? av_frame_make_writable(frame_.get()) : av_frame_get_buffer(frame_.get(), 0);
  if (code < 0) return av::error(where_, "hold an image", code);
  return frame_.get();
}

Status Encoder::encode(int64_t ms, const Sink& sink) {
  frame_->pts = ms;
  return send(frame_.get(), sink);
}

Status Encoder::finish(const Sink& sink) { return send(nullptr, sink); }

Status Encoder::send(const AVFrame* frame, const Sink& sink) {
  int code = avcodec_send_frame(context_.get(), frame);
  while (code >= 0) {
    code = avcodec_receive_packet(context_.get(), packet_.get());
    if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return {};
    if (code >= 0) SL_RETURN_IF_ERROR(sink(packet_.get()));
  }
  return av::error(where_, "encode an image", code);
}

ParametersPtr Encoder::parameters() const {
  ParametersPtr parameters(avcodec_parameters_alloc());
  SL_CHECK(parameters != nullptr, "out of memory");
  SL_CHECK(avcodec_parameters_from_context(parameters.get(), context_.get()) >= 0, "out of memory");
  return parameters;
}

}  // namespace sightline::record
