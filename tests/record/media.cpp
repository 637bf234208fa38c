// SPDX-License-Identifier: Apache-2.0
#include "record/media.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "record/media/encoder.hpp"
#include "record/media/video_file.hpp"
#include "sightline/base/files.hpp"
#include "sightline/image/convert.hpp"

namespace sightline::test {

using namespace record;

namespace fs = std::filesystem;

TempFolder::TempFolder() {
  std::string name = (fs::temp_directory_path() / "sightline_record_XXXXXX").string();
  SL_CHECK(::mkdtemp(name.data()) != nullptr, "cannot make a temporary folder");
  path_ = name;
}

TempFolder::~TempFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::shared_ptr<Image> pattern(int number, int width, int height) {
  auto image = std::make_shared<Image>(width, height);
  const auto view = image->mutable_view();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      view.y.row(y)[x] = static_cast<uint8_t>(16 + (x + 2 * y + 5 * number) % 200);
    }
  }
  for (int y = 0; y < view.u.height; ++y) {
    for (int x = 0; x < view.u.width; ++x) {
      view.u.row(y)[x] = static_cast<uint8_t>(100 + (x + number) % 50);
      view.v.row(y)[x] = static_cast<uint8_t>(100 + (y + number) % 50);
    }
  }
  return image;
}

uint64_t hash_of(const I420View& view, uint64_t seed) {
  for (const auto& plane : {view.y, view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) {
      const auto* row = reinterpret_cast<const char*>(plane.row(y));
      seed = (seed * 1099511628211ULL) ^ content_hash({row, static_cast<size_t>(plane.width)});
    }
  }
  return seed;
}

FramePayload payload_of(std::vector<uint8_t> bytes, bool keyframe) {
  auto owner = std::make_shared<const std::vector<uint8_t>>(std::move(bytes));
  FramePayload payload;
  payload.bytes = *owner;
  payload.keyframe = keyframe;
  payload.owner = std::move(owner);
  return payload;
}

Stream encode_patterns(const std::string& encoder_name, int count, int gop, int b_frames) {
  const std::string b = std::to_string(b_frames);
  Encoder::Settings settings;
  settings.codec = avcodec_find_encoder_by_name(encoder_name.c_str());
  if (!settings.codec) return {};
  settings.format = encoder_name == "mjpeg" ? AV_PIX_FMT_YUVJ420P : AV_PIX_FMT_YUV420P;
  settings.width = kWidth;
  settings.height = kHeight;
  settings.gop = gop;
  settings.options = {{"bf", b.c_str()}};
  if (encoder_name == "libx264") {
    settings.options.emplace_back("preset", "veryfast");
    settings.options.emplace_back("x264-params", "scenecut=0:open-gop=0");
  } else if (encoder_name != "ffv1") {
    settings.options.emplace_back("qmin", "2");
    settings.options.emplace_back("qmax", "3");
  }
  auto encoder = Encoder::create(settings, "test");
  SL_CHECK(encoder.has_value(), encoder.error().message());
  Stream stream;
  const auto parameters = (*encoder)->parameters();
  stream.extradata.assign(parameters->extradata,
                          parameters->extradata + parameters->extradata_size);
  const Encoder::Sink sink = [&](AVPacket* packet) {
    stream.packets.push_back({{packet->data, packet->data + packet->size},
                              packet->pts,
                              (packet->flags & AV_PKT_FLAG_KEY) != 0});
    return Status();
  };
  for (int i = 0; i < count; ++i) {
    AVFrame* frame = *(*encoder)->frame();
    const auto image = pattern(i);
    copy_i420(image->view(), {{frame->data[0], kWidth, kHeight, frame->linesize[0]},
                              {frame->data[1], kWidth / 2, kHeight / 2, frame->linesize[1]},
                              {frame->data[2], kWidth / 2, kHeight / 2, frame->linesize[2]}});
    SL_CHECK((*encoder)->encode(i * 100, sink).has_value(), "encode");
  }
  SL_CHECK((*encoder)->finish(sink).has_value(), "finish");
  return stream;
}

void write_stream(const fs::path& path, const std::string& codec, const Stream& stream) {
  const auto parameters = make_parameters(av::codec_id(codec), kWidth, kHeight, stream.extradata);
  auto file = VideoFile::create(path, OutFile::Existing::kReplace, *parameters, 10);
  ASSERT_TRUE(file) << file.error().message();
  const av::PacketPtr packet(av_packet_alloc());
  int64_t dts = -200;
  for (const auto& from : stream.packets) {
    av_packet_unref(packet.get());
    packet->data = const_cast<uint8_t*>(from.bytes.data());
    packet->size = static_cast<int>(from.bytes.size());
    packet->pts = from.pts;
    packet->dts = std::min(dts, from.pts);
    dts += 100;
    if (from.keyframe) packet->flags |= AV_PKT_FLAG_KEY;
    ASSERT_TRUE((*file)->write(packet.get()));
  }
  ASSERT_TRUE((*file)->close());
}

FramePtr frame_at(uint32_t camera, int number, int64_t ms) {
  FrameInfo info;
  info.camera = CameraId(camera);
  info.sequence = static_cast<uint64_t>(number);
  info.capture = Time(std::chrono::milliseconds(ms));
  info.arrival = info.capture + std::chrono::milliseconds(5);
  info.width = kWidth;
  info.height = kHeight;
  return Frame::decoded(info, pattern(number));
}

void write_small_recording(const fs::path& folder, int count) {
  RecordingWriterOptions options;
  options.cameras = {{"left", PixelFormat::kI420, kWidth, kHeight},
                     {"right", PixelFormat::kI420, kWidth, kHeight}};
  auto writer = RecordingWriter::create(folder, options);
  ASSERT_TRUE(writer) << writer.error().message();
  for (int i = 0; i < count; ++i) {
    ASSERT_TRUE((*writer)->append(*frame_at(0, i, 1000 + 100 * i)));
    ASSERT_TRUE((*writer)->append(*frame_at(1, i, 1030 + 100 * i)));
  }
  ASSERT_TRUE((*writer)->close());
}

std::string read_text(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

void edit_text(const fs::path& path, const std::string& from, const std::string& to) {
  std::string text = read_text(path);
  const size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  write_text(path, text.replace(at, from.size(), to));
}

fs::path shared_recording(const std::string& name) {
  const fs::path path = fs::path(SIGHTLINE_SOURCE_DIR) / ".." / "shared" / "recordings" / name;
  std::error_code ignored;
  return fs::is_directory(path, ignored) ? path : fs::path();
}

fs::path bench_recording() { return fs::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench"; }

}  // namespace sightline::test
