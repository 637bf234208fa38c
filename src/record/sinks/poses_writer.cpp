// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "record/recording_folder.hpp"
#include "record/sinks/mcap_file.hpp"
#include "record/sinks/video_channels.hpp"
#include "sightline/record/recording_sink.hpp"

namespace sightline {

using namespace record;
namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;

// Of Foxglove's well-known messages what these files hold; readers go by the names.
constexpr std::string_view kTransformSchema = R"({"title":"foxglove.FrameTransform","type":"object",
"properties":{"timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer"},
"nsec":{"type":"integer"}}},"parent_frame_id":{"type":"string"},"child_frame_id":{"type":"string"},
"translation":{"type":"object","title":"foxglove.Vector3","properties":{"x":{"type":"number"},
"y":{"type":"number"},"z":{"type":"number"}}},"rotation":{"type":"object",
"title":"foxglove.Quaternion","properties":{"x":{"type":"number"},"y":{"type":"number"},
"z":{"type":"number"},"w":{"type":"number"}}}}})";
constexpr std::string_view kPoseSchema = R"({"title":"foxglove.PoseInFrame","type":"object",
"properties":{"timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer"},
"nsec":{"type":"integer"}}},"frame_id":{"type":"string"},"pose":{"type":"object",
"title":"foxglove.Pose","properties":{"position":{"type":"object","title":"foxglove.Vector3",
"properties":{"x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"}}},
"orientation":{"type":"object","title":"foxglove.Quaternion","properties":{"x":{"type":"number"},
"y":{"type":"number"},"z":{"type":"number"},"w":{"type":"number"}}}}}}})";
constexpr std::string_view kEstimateSchema = R"({"title":"sightline.Pose","type":"object",
"properties":{"object":{"type":"string"},"t_ns":{"type":"integer"},"utc_ns":{"type":"integer"},
"state":{"type":"string"},"translation_m":{"type":"array","items":{"type":"number"}},
"rotation_wxyz":{"type":"array","items":{"type":"number"}},"sigma_t_mm":{"type":"number"},
"sigma_r_deg":{"type":"number"},"reasons":{"type":"array","items":{"type":"string"}},
"cameras":{"type":"array","items":{"type":"string"}},
"covariance":{"type":"array","items":{"type":"number"}}}})";

// A chunk is made in memory, and read as a whole.
constexpr size_t kLargestChunk = size_t{4} << 20;

Json timestamp(int64_t utc_ns) {
  return {{"sec", utc_ns / 1'000'000'000}, {"nsec", utc_ns % 1'000'000'000}};
}
Json vector(const Eigen::Vector3d& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }
Json quaternion(const Eigen::Quaterniond& q) {
  return {{"x", q.x()}, {"y", q.y()}, {"z", q.z()}, {"w", q.w()}};
}

/// poses.mcap: the tree of frames, and per object its pose and all that is said of it.
class PoseMcap {
 public:
  static Result<std::unique_ptr<PoseMcap>> create(const fs::path& path) {
    SL_ASSIGN(auto file, McapFile::create(path));
    return std::unique_ptr<PoseMcap>(new PoseMcap(std::move(file)));
  }

  void append(const PoseMessage& message) {
    const PoseLogRow& row = message.row;
    const auto [found, is_new] = objects_.try_emplace(row.object);
    if (is_new) {
      found->second.pose = file_->add_channel(pose_, "/objects/" + row.object + "/pose");
      found->second.estimate =
          file_->add_channel(estimate_, "/objects/" + row.object + "/estimate");
    }
    file_->append(found->second.estimate, message.utc_ns, message.json);
    if (!row.world_from_object) return;
    const Json time = timestamp(message.utc_ns);
    const Json place = vector(row.world_from_object->translation);
    const Json turn = quaternion(row.world_from_object->rotation);
    const Json pose{{"timestamp", time},
                    {"frame_id", "world"},
                    {"pose", {{"position", place}, {"orientation", turn}}}};
    file_->append(found->second.pose, message.utc_ns, pose.dump());
    const Json transform{{"timestamp", time},
                         {"parent_frame_id", "world"},
                         {"child_frame_id", row.object},
                         {"translation", place},
                         {"rotation", turn}};
    file_->append(tf_, message.utc_ns, transform.dump());
  }

  bool append(const ViewPacket& packet) {
    const bool taken = video_.append(*file_, packet);
    if (taken && !video_since_) video_since_ = packet.packet.capture;
    return taken;
  }

  /// Whether it is to go on in another file before this is appended: video at a key frame.
  bool is_full(const ViewingOptions& limits, const ViewPacket* packet) const {
    const bool large = file_->size() + file_->pending() > limits.segment_bytes;
    if (!video_since_) return large;
    if (packet == nullptr || !packet->packet.keyframe) return false;
    return large || packet->packet.capture - *video_since_ >= limits.segment;
  }

  McapFile& file() { return *file_; }

 private:
  explicit PoseMcap(std::unique_ptr<McapFile> file) : file_(std::move(file)) {
    tf_ = file_->add_channel(file_->add_schema("foxglove.FrameTransform", kTransformSchema), "/tf");
    pose_ = file_->add_schema("foxglove.PoseInFrame", kPoseSchema);
    estimate_ = file_->add_schema("sightline.Pose", kEstimateSchema);
  }

  struct Channels {
    uint16_t pose = 0, estimate = 0;
  };
  const std::unique_ptr<McapFile> file_;
  uint16_t tf_ = 0, pose_ = 0, estimate_ = 0;
  std::map<std::string, Channels> objects_;
  VideoChannels video_;
  std::optional<Time> video_since_;
};

class PosesWriter final : public RecordingSink {
 public:
  PosesWriter(fs::path folder, ViewingOptions parts, std::unique_ptr<PoseLogWriter> csv,
              std::unique_ptr<PoseMcap> mcap)
      : folder_(std::move(folder)), parts_(parts), csv_(std::move(csv)), mcap_(std::move(mcap)) {}
  ~PosesWriter() override { (void)close(); }

  Status append(const PoseMessage& message) override {
    if (status_ && csv_) status_ = csv_->append(message.row);
    go_on_in_another(nullptr);
    if (!status_) return status_;
    if (mcap_) mcap_->append(message);
    ++written_;
    return status_;
  }

  Status append(const ViewPacket& packet) override {
    go_on_in_another(&packet);
    if (status_ && mcap_ && mcap_->append(packet)) ++written_;
    if (status_ && mcap_ && mcap_->file().pending() > kLargestChunk) {
      status_ = mcap_->file().flush();
    }
    return status_;
  }

  Status flush(bool sync) override {
    if (status_ && csv_) status_ = csv_->flush();
    if (status_ && mcap_) status_ = mcap_->file().flush();
    if (status_ && mcap_ && sync) status_ = mcap_->file().sync();
    return status_;
  }

  Status close() override {
    const Status first = csv_ ? csv_->close() : Status();
    const Status second = mcap_ ? mcap_->file().close() : Status();
    if (status_) status_ = first ? second : first;
    return status_;
  }

  uint64_t written() const override { return written_; }

 private:
  void go_on_in_another(const ViewPacket* packet) {
    if (!status_ || !mcap_ || !mcap_->is_full(parts_, packet)) return;
    status_ = mcap_->file().close();
    if (!status_) return;
    auto next = PoseMcap::create(folder_ / fmt::format("poses-{:04}.mcap", ++part_));
    if (next) {
      mcap_ = *std::move(next);
    } else {
      status_ = next.error();
    }
  }

  const fs::path folder_;
  const ViewingOptions parts_;
  const std::unique_ptr<PoseLogWriter> csv_;
  std::unique_ptr<PoseMcap> mcap_;
  int part_ = 1;
  Status status_;
  uint64_t written_ = 0;
};

}  // namespace

Result<std::unique_ptr<RecordingSink>> make_poses_writer(const fs::path& folder, PoseFiles files,
                                                         const ViewingOptions& parts) {
  SL_RETURN_IF_ERROR(make_recording_folder(folder));
  std::unique_ptr<PoseLogWriter> csv;
  std::unique_ptr<PoseMcap> mcap;
  if (files != PoseFiles::kMcap) {
    SL_ASSIGN(csv, PoseLogWriter::create(folder / "poses.csv"));
  }
  if (files != PoseFiles::kCsv) {
    SL_ASSIGN(mcap, PoseMcap::create(folder / "poses.mcap"));
  }
  return std::unique_ptr<RecordingSink>(
      std::make_unique<PosesWriter>(folder, parts, std::move(csv), std::move(mcap)));
}

}  // namespace sightline
