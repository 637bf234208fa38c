// SPDX-License-Identifier: Apache-2.0
#include "web/picture_board.hpp"

#include <algorithm>
#include <utility>

#include "sightline/base/log.hpp"

namespace sightline {

using namespace std::chrono_literals;

namespace {

constexpr int kQuality = 80;
constexpr Duration kTurn = 500ms;
constexpr Duration kStallLimit = 5s;

}  // namespace

PictureSlot::PictureSlot(std::string camera, PictureBoard& board, Registry& registry)
    : camera_(std::move(camera)),
      board_(board),
      encoded_(registry.counter("sightline_pictures_encoded_total",
                                "JPEG pictures made for browsers", {{"camera", camera_}})),
      unasked_(registry.counter("sightline_frames_dropped_total",
                                "Frames that a stage had no time for, by stage",
                                {{"camera", camera_}, {"stage", "picture"}})),
      watchers_gauge_(registry.gauge("sightline_picture_viewers",
                                     "HTTP clients that watch, pictures of both kinds",
                                     {{"camera", camera_}})) {}

void PictureSlot::offer(PictureKind kind, std::shared_ptr<const Image> image,
                        const FrameInfo& frame) {
  if (!wanted(kind)) return;
  bool asked = false;
  {
    std::lock_guard lock(mutex_);
    Side& side = this->side(kind);
    side.image.swap(image);  // the one before is released outside the lock
    side.frame = frame;
    ++side.offered;
    asked = side.asked;
  }
  if (image) unasked_.add();
  if (asked) board_.notify();
}

bool PictureSlot::encode_one(PictureKind kind, JpegEncoder& encoder) {
  std::shared_ptr<const Image> image;
  auto jpeg = std::make_shared<Jpeg>();
  {
    std::lock_guard lock(mutex_);
    Side& side = this->side(kind);
    if (!side.asked || !side.image) return false;
    image.swap(side.image);
    side.asked = false;
    jpeg->serial = side.offered;
    jpeg->sequence = side.frame.sequence;
    jpeg->capture = side.frame.capture;
  }
  auto bytes = encoder.encode(image->view());
  if (!bytes) {
    log::error("{}: no picture: {}", camera_, bytes.error().message());
    return false;
  }
  jpeg->bytes = *std::move(bytes);
  encoded_.add();
  std::lock_guard lock(mutex_);
  side(kind).jpeg = std::move(jpeg);
  return true;
}

PictureWatch::PictureWatch(std::shared_ptr<PictureSlot> slot, PictureKind kind)
    : slot_(std::move(slot)), kind_(kind) {
  std::lock_guard lock(slot_->mutex_);
  PictureSlot::Side& side = slot_->side(kind);
  // What was left by those who watched before is old; what others watch now is welcome.
  if (side.watchers++ == 0) seen_ = side.offered;
  slot_->watchers_gauge_.set(slot_->watchers());
}

PictureWatch::~PictureWatch() {
  std::shared_ptr<const Image> image;  // released outside the lock
  std::lock_guard lock(slot_->mutex_);
  PictureSlot::Side& side = slot_->side(kind_);
  if (--side.watchers == 0) {
    side.image.swap(image);
    side.jpeg.reset();
    side.asked = false;
  }
  slot_->watchers_gauge_.set(slot_->watchers());
}

JpegPtr PictureWatch::next() {
  bool there = false;
  {
    std::lock_guard lock(slot_->mutex_);
    PictureSlot::Side& side = slot_->side(kind_);
    if (side.jpeg && side.jpeg->serial > seen_) {
      seen_ = side.jpeg->serial;
      return side.jpeg;
    }
    if (side.asked) return nullptr;
    side.asked = true;
    there = side.image != nullptr;
  }
  if (there) slot_->board_.notify();
  return nullptr;
}

PictureBoard::PictureBoard(Registry& registry, std::shared_ptr<HttpWaker> waker,
                           std::unique_ptr<JpegEncoder> encoder)
    : registry_(registry), waker_(std::move(waker)), encoder_(std::move(encoder)) {}

Result<std::shared_ptr<PictureBoard>> PictureBoard::start(Registry& registry, HeartbeatBoard& beats,
                                                          std::shared_ptr<HttpWaker> waker) {
  SL_ASSIGN(auto encoder, JpegEncoder::create(kQuality));
  std::shared_ptr<PictureBoard> board(
      new PictureBoard(registry, std::move(waker), std::move(encoder)));
  board->thread_ = start_watched_thread(
      beats, "jpeg", kStallLimit,
      [raw = board.get()](std::stop_token stop, Heartbeat& beat) { raw->run(stop, beat); });
  return board;
}

PictureBoard::~PictureBoard() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

std::shared_ptr<PictureSlot> PictureBoard::slot(const std::string& camera) {
  std::lock_guard lock(mutex_);
  auto& slot = slots_[camera];
  if (!slot) slot = std::make_shared<PictureSlot>(camera, *this, registry_);
  return slot;
}

std::shared_ptr<PictureSlot> PictureBoard::find(const std::string& camera) const {
  std::lock_guard lock(mutex_);
  const auto found = slots_.find(camera);
  return found != slots_.end() ? found->second : nullptr;
}

void PictureBoard::keep_only(const std::vector<std::string>& cameras) {
  std::lock_guard lock(mutex_);
  std::erase_if(slots_, [&](const auto& entry) {
    if (std::ranges::find(cameras, entry.first) != cameras.end()) return false;
    entry.second->close();
    return true;
  });
}

void PictureBoard::notify() {
  {
    std::lock_guard lock(work_mutex_);
    work_ = true;
  }
  work_there_.notify_one();
}

void PictureBoard::run(std::stop_token stop, Heartbeat& heartbeat) {
  while (!stop.stop_requested()) {
    heartbeat.beat();
    {
      std::unique_lock lock(work_mutex_);
      work_there_.wait_for(lock, stop, kTurn, [this] { return work_; });
      work_ = false;
    }
    encode_all();
  }
}

void PictureBoard::encode_all() {
  std::vector<std::shared_ptr<PictureSlot>> slots;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [name, slot] : slots_) slots.push_back(slot);
  }
  for (const auto& slot : slots) {
    for (const PictureKind kind : {PictureKind::kAnnotated, PictureKind::kClean}) {
      const bool made = slot->wanted(kind) && slot->encode_one(kind, *encoder_);
      if (made && waker_) waker_->wake();
    }
  }
}

}  // namespace sightline
