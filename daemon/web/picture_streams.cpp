// SPDX-License-Identifier: Apache-2.0
#include "web/picture_streams.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <utility>

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr Duration kSnapshotPatience = 2s;
constexpr const char* kBoundary = "sightline-picture";

std::string part(const PictureSlot& slot, const Jpeg& jpeg) {
  std::string text = fmt::format(
      "Content-Type: image/jpeg\r\nContent-Length: {}\r\nX-Camera: {}\r\nX-Capture-Ns: {}\r\n"
      "X-Utc-Ns: {}\r\nX-Sequence: {}\r\n\r\n",
      jpeg.bytes.size(), slot.camera(), to_ns(jpeg.capture), utc_ns_of(jpeg.capture),
      jpeg.sequence);
  text += jpeg.bytes;
  text += fmt::format("\r\n--{}\r\n", kBoundary);  // now, or the browser would wait for it
  return text;
}

class PictureStream : public HttpStream {
 public:
  PictureStream(const std::vector<std::shared_ptr<PictureSlot>>& slots, PictureKind kind,
                double max_rate_hz)
      : period_(max_rate_hz > 0 ? from_seconds(1 / max_rate_hz) : Duration(0)) {
    for (const auto& slot : slots) turns_.emplace_back(slot, kind);
  }

  bool ready() override {
    if (!found_) find();
    return found_ != nullptr || ended();
  }

  Chunk next() override {
    if (!found_) find();
    if (!found_) return nullptr;
    std::string text = std::exchange(first_part_, false) ? fmt::format("--{}\r\n", kBoundary) : "";
    text += part(found_of_->watch.slot(), *std::exchange(found_, nullptr));
    return std::make_shared<const std::string>(std::move(text));
  }

  bool ended() const override {
    return std::ranges::all_of(turns_, [](const Turn& turn) { return turn.watch.slot().closed(); });
  }

 private:
  struct Turn {
    Turn(std::shared_ptr<PictureSlot> slot, PictureKind kind) : watch(std::move(slot), kind) {}
    PictureWatch watch;
    Time due{};
  };

  // Who was shown last comes last.
  void find() {
    const Time now = MonotonicClock::now();
    for (size_t i = 0; i < turns_.size() && !found_; ++i) {
      Turn& turn = turns_[(first_ + i) % turns_.size()];
      if (now < turn.due) continue;
      found_ = turn.watch.next();
      if (!found_) continue;
      // By the period, so that the rate holds whatever the camera's; what is late is not made up.
      const Time on_time = turn.due == Time{} ? now : turn.due;
      turn.due = std::max(on_time + period_, now + period_ * 3 / 4);
      found_of_ = &turn;
      first_ = (first_ + i + 1) % turns_.size();
    }
  }

  const Duration period_;
  std::deque<Turn> turns_;
  size_t first_ = 0;
  bool first_part_ = true;
  JpegPtr found_;
  Turn* found_of_ = nullptr;
};

}  // namespace

HttpReply pictures_reply(const std::vector<std::shared_ptr<PictureSlot>>& slots, PictureKind kind,
                         double max_rate_hz) {
  HttpReply reply{200, fmt::format("multipart/mixed; boundary={}", kBoundary), ""};
  reply.stream = std::make_shared<PictureStream>(slots, kind, max_rate_hz);
  return reply;
}

HttpReply motion_jpeg_reply(std::shared_ptr<PictureSlot> slot, PictureKind kind,
                            double max_rate_hz) {
  HttpReply reply = pictures_reply({std::move(slot)}, kind, max_rate_hz);
  reply.type = fmt::format("multipart/x-mixed-replace; boundary={}", kBoundary);
  return reply;
}

HttpReply snapshot_reply(std::shared_ptr<PictureSlot> slot, PictureKind kind) {
  HttpReply reply;
  const Time asked = MonotonicClock::now();
  auto watch = std::make_shared<PictureWatch>(slot, kind);
  reply.later = [watch, asked]() -> std::optional<HttpReply> {
    const JpegPtr jpeg = watch->next();
    if (jpeg) {
      HttpReply picture{200, "image/jpeg", jpeg->bytes};
      picture.headers = {{"X-Camera", watch->slot().camera()},
                         {"X-Capture-Ns", std::to_string(to_ns(jpeg->capture))},
                         {"X-Utc-Ns", std::to_string(utc_ns_of(jpeg->capture))},
                         {"X-Sequence", std::to_string(jpeg->sequence)}};
      return picture;
    }
    if (MonotonicClock::now() < asked + kSnapshotPatience && !watch->slot().closed()) {
      return std::nullopt;
    }
    return HttpReply::error(503, "no picture has come; the state of the camera says why");
  };
  return reply;
}

}  // namespace sightline
