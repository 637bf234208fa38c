// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "record/media/video_file.hpp"
#include "record/recording_folder.hpp"
#include "sightline/image/h264.hpp"
#include "sightline/record/recording_sink.hpp"

namespace sightline {

using namespace record;
namespace fs = std::filesystem;

namespace {

class ViewingWriter final : public RecordingSink {
 public:
  ViewingWriter(fs::path folder, const ViewingOptions& options)
      : folder_(std::move(folder)), options_(options) {}
  ~ViewingWriter() override { (void)close(); }

  Status append(const ViewPacket& packet) override {
    if (status_) status_ = try_append(packet);
    return status_;
  }

  Status flush(bool sync) override {
    for (auto& [name, camera] : cameras_) {
      if (!camera.file || !status_) continue;
      status_ = camera.file->flush();
      if (status_ && sync) status_ = camera.file->sync();
    }
    return status_;
  }

  Status close() override {
    for (auto& [name, camera] : cameras_) {
      const Status closed = end_file(camera);
      if (status_) status_ = closed;
    }
    return status_;
  }

  uint64_t written() const override { return written_; }

 private:
  struct Camera {
    std::unique_ptr<VideoFile> file;  // null: waits for a key frame
    std::vector<uint8_t> parameter_sets;
    uint64_t number = 0;  // of the newest packet
    uint64_t bytes = 0;
    Time start{};  // of the file
    int files = 0;
    bool any = false, broken = false;
  };

  static Status end_file(Camera& camera) {
    if (!camera.file) return {};
    const auto file = std::move(camera.file);
    SL_RETURN_IF_ERROR(file->flush());
    SL_RETURN_IF_ERROR(file->sync());
    return file->close();
  }

  Status try_append(const ViewPacket& packet) {
    Camera& camera = cameras_[packet.camera];
    const EncodedPacket& encoded = packet.packet;
    if (camera.any && packet.number != camera.number + 1) camera.broken = true;
    camera.any = true;
    camera.number = packet.number;
    if (encoded.keyframe) {
      SL_RETURN_IF_ERROR(follow_keyframe(camera, packet));
    } else if (camera.broken) {
      return {};  // it refers to what was lost
    }
    if (!camera.file) return {};
    SL_RETURN_IF_ERROR(
        camera.file->write(*encoded.bytes, encoded.capture - camera.start, encoded.keyframe));
    camera.bytes += encoded.bytes->size();
    ++written_;
    return {};
  }

  // At a key frame a file may begin.
  Status follow_keyframe(Camera& camera, const ViewPacket& packet) {
    const EncodedPacket& encoded = packet.packet;
    camera.broken = false;
    auto sets = annex_b_parameter_sets(*encoded.bytes);
    const bool full = encoded.capture - camera.start >= options_.segment ||
                      camera.bytes >= options_.segment_bytes || encoded.capture < camera.start;
    if (camera.file && !full && sets == camera.parameter_sets) return {};
    SL_RETURN_IF_ERROR(end_file(camera));
    if (sets.empty()) return {};
    const auto parameters = make_parameters(AV_CODEC_ID_H264, packet.width, packet.height, sets);
    const fs::path path = folder_ / fmt::format("{}-{:04}.mp4", packet.camera, ++camera.files);
    SL_ASSIGN(camera.file, VideoFile::create(path, OutFile::Existing::kRefuse, *parameters,
                                             packet.rate_hz, Container::kFragmentedMp4));
    camera.parameter_sets = std::move(sets);
    camera.start = encoded.capture;
    camera.bytes = 0;
    return {};
  }

  const fs::path folder_;
  const ViewingOptions options_;
  std::map<std::string, Camera> cameras_;
  Status status_;
  uint64_t written_ = 0;
};

}  // namespace

Result<std::unique_ptr<RecordingSink>> make_viewing_writer(const fs::path& folder,
                                                           const ViewingOptions& options) {
  SL_RETURN_IF_ERROR(make_recording_folder(folder));
  return std::unique_ptr<RecordingSink>(std::make_unique<ViewingWriter>(folder, options));
}

}  // namespace sightline
