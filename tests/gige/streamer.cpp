// SPDX-License-Identifier: Apache-2.0
#include "streamer.hpp"

#include <sys/socket.h>

#include <algorithm>
#include <limits>

namespace sightline::gige {
namespace {

constexpr size_t kKept = 8;  // frames that can be asked for again
constexpr size_t kLargestPacket = 65536;
constexpr uint16_t kUnavailable = 0x800C;
constexpr size_t kIpAndUdp = 28;

enum class Content : uint8_t { kLeader = 1, kTrailer = 2, kPayload = 3 };

// Writes big-endian numbers one after another.
class Out {
 public:
  explicit Out(std::vector<uint8_t>& bytes) : bytes_(bytes) {}
  Out& u8(uint8_t value) {
    bytes_[size_++] = value;
    return *this;
  }
  Out& u16(uint32_t value) { return u8(static_cast<uint8_t>(value >> 8)).u8(value & 0xFF); }
  Out& u32(uint32_t value) { return u16(value >> 16).u16(value & 0xFFFF); }
  Out& u64(uint64_t value) {
    return u32(static_cast<uint32_t>(value >> 32)).u32(static_cast<uint32_t>(value));
  }
  Out& bytes(const uint8_t* from, size_t size) {
    std::copy_n(from, size, bytes_.begin() + static_cast<ptrdiff_t>(size_));
    size_ += size;
    return *this;
  }
  size_t size() const { return size_; }

 private:
  std::vector<uint8_t>& bytes_;
  size_t size_ = 0;
};

void header(Out& out, uint16_t status, bool extended, uint64_t block, Content content,
            uint32_t packet) {
  out.u16(status);
  if (extended) {
    out.u16(0).u32(0x80000000u | static_cast<uint32_t>(content) << 24).u64(block).u32(packet);
  } else {
    out.u16(static_cast<uint32_t>(block & 0xFFFF))
        .u32(static_cast<uint32_t>(content) << 24 | (packet & 0xFFFFFF));
  }
}

void leader(Out& out, const OutFrame& frame) {
  out.u16(0).u16(frame.chunks ? 0x4001 : 0x0001).u64(frame.stamp).u32(frame.pixel_format);
  if (frame.short_leader) return;
  out.u32(frame.width).u32(frame.wrong_size ? frame.height / 2 : frame.height);
  out.u32(frame.offset_x).u32(frame.offset_y).u32(0);
}

}  // namespace

uint32_t OutFrame::packets() const {
  return static_cast<uint32_t>((payload.size() + packet_bytes - 1) / packet_bytes) + 2;
}

Streamer::Streamer(in_addr address, Faults& faults, std::mt19937_64& random)
    : faults_(faults),
      random_(random),
      socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)),
      packet_(kLargestPacket) {
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr = address;
  (void)::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own);
  const int buffer = 4 << 20;
  (void)::setsockopt(socket_.get(), SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
}

uint16_t Streamer::port() const {
  sockaddr_in own{};
  socklen_t size = sizeof own;
  (void)::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&own), &size);
  return ntohs(own.sin_port);
}

void Streamer::set_destination(in_addr address, uint16_t port) {
  destination_.sin_family = AF_INET;
  destination_.sin_addr = address;
  destination_.sin_port = htons(port);
}

bool Streamer::chance(double share) {
  return share > 0 && std::uniform_real_distribution<double>(0, 1)(random_) < share;
}

void Streamer::put(const std::shared_ptr<const OutFrame>& frame, uint32_t packet, int64_t due_ns) {
  waiting_.emplace(due_ns, Waiting{frame, packet});
}

void Streamer::send(std::shared_ptr<const OutFrame> frame, int64_t ready_ns) {
  sent_.push_back(frame);
  if (sent_.size() > kKept) sent_.pop_front();
  if (faults_.silent) return;
  const uint32_t count = frame->packets();
  const bool no_leader = chance(faults_.no_leader), no_trailer = chance(faults_.no_trailer);
  for (uint32_t i = 0; i < count; ++i) {
    if ((i == 0 && no_leader) || (i + 1 == count && no_trailer) || chance(faults_.loss)) continue;
    int64_t due = ready_ns + faults_.delay_ns + gap_ns_ * i;
    if (chance(faults_.reorder)) due += faults_.reorder_ns;
    put(frame, i, due);
    if (chance(faults_.duplicate)) put(frame, i, due);
  }
}

void Streamer::resend(uint64_t block_id, uint32_t first, uint32_t last, bool extended_ids,
                      int64_t now_ns) {
  if (faults_.resend == Faults::Resend::kOff) return;
  const auto kept = std::find_if(sent_.begin(), sent_.end(),
                                 [&](const auto& frame) { return frame->block_id == block_id; });
  const bool there = kept != sent_.end() && faults_.resend == Faults::Resend::kOn;
  if (there) last = std::min(last, (*kept)->packets() - 1);
  for (uint32_t i = first; i <= last; ++i) {
    if (there) {
      ++resent_;
      if (!chance(faults_.resend_loss)) put(*kept, i, now_ns + faults_.delay_ns);
      continue;
    }
    Out out(packet_);
    header(out, kUnavailable, extended_ids, block_id, Content::kPayload, i);
    transmit_bytes(out.size());
    if (i - first > 1000) break;  // nobody asks for more in earnest
  }
}

void Streamer::send_test(size_t bytes) {
  if (bytes <= kIpAndUdp || bytes > kLargestPacket - kIpAndUdp) return;
  std::fill_n(packet_.begin(), bytes - kIpAndUdp, uint8_t{0x5A});
  transmit_bytes(bytes - kIpAndUdp);
}

void Streamer::forget() {
  waiting_.clear();
  sent_.clear();
}

int64_t Streamer::next_due() const {
  return waiting_.empty() ? std::numeric_limits<int64_t>::max() : waiting_.begin()->first;
}

void Streamer::run(int64_t now_ns) {
  while (!waiting_.empty() && waiting_.begin()->first <= now_ns) {
    const Waiting next = std::move(waiting_.begin()->second);
    waiting_.erase(waiting_.begin());
    transmit(*next.frame, next.packet);
  }
}

void Streamer::transmit(const OutFrame& frame, uint32_t packet) {
  Out out(packet_);
  const uint32_t last = frame.packets() - 1;
  const Content content = packet == 0      ? Content::kLeader
                          : packet == last ? Content::kTrailer
                                           : Content::kPayload;
  header(out, 0, frame.extended_ids, frame.block_id, content, packet);
  if (content == Content::kLeader) {
    leader(out, frame);
  } else if (content == Content::kTrailer) {
    out.u16(0).u16(frame.chunks ? 0x4001 : 0x0001).u32(frame.height);
  } else {
    const size_t start = (packet - 1) * frame.packet_bytes;
    out.bytes(frame.payload.data() + start,
              std::min(frame.packet_bytes, frame.payload.size() - start));
  }
  transmit_bytes(out.size());
}

void Streamer::transmit_bytes(size_t size) {
  if (destination_.sin_port == 0) return;
  (void)::sendto(socket_.get(), packet_.data(), size, 0,
                 reinterpret_cast<const sockaddr*>(&destination_), sizeof destination_);
}

}  // namespace sightline::gige
