// SPDX-License-Identifier: Apache-2.0
#include "control/stream_body.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <exception>

#include "sightline/base/log.hpp"

namespace sightline::control {
namespace {

constexpr size_t kBlock = 64 << 10;  // [bytes] that are sent at once
// What the kernel takes before the network has: a picture that waits there grows old.
constexpr int kUnsent = 64 << 10;
constexpr unsigned kPeerGone_ms = 10'000;  // without an answer to what was sent

class StreamBody {
 public:
  StreamBody(ConnectionLoop& loop, MHD_Connection* connection, std::shared_ptr<HttpStream> stream,
             unsigned& count)
      : loop_(loop), connection_(connection), stream_(std::move(stream)), count_(count) {
    ++count_;
  }
  ~StreamBody() { --count_; }
  StreamBody(const StreamBody&) = delete;
  StreamBody& operator=(const StreamBody&) = delete;

  ssize_t read(char* to, size_t most) {
    if (!chunk_) {
      chunk_ = stream_->next();
      sent_ = 0;
    }
    if (!chunk_ || chunk_->empty()) {
      chunk_.reset();
      if (stream_->ended()) return MHD_CONTENT_READER_END_OF_STREAM;
      loop_.suspend(connection_, [stream = stream_] { return stream->ready(); });
      return 0;
    }
    loop_.goes_on(connection_);
    const size_t size = std::min(most, chunk_->size() - sent_);
    std::memcpy(to, chunk_->data() + sent_, size);
    sent_ += size;
    if (sent_ == chunk_->size()) chunk_.reset();
    return static_cast<ssize_t>(size);
  }

 private:
  ConnectionLoop& loop_;
  MHD_Connection* const connection_;
  const std::shared_ptr<HttpStream> stream_;
  unsigned& count_;
  HttpStream::Chunk chunk_;
  size_t sent_ = 0;
};

ssize_t read_body(void* body, uint64_t, char* to, size_t most) {
  try {
    return static_cast<StreamBody*>(body)->read(to, most);
  } catch (const std::exception& exception) {
    log::error("http: a stream failed: {}", exception.what());
    return MHD_CONTENT_READER_END_WITH_ERROR;
  }
}

}  // namespace

MHD_Response* make_stream_response(ConnectionLoop& loop, MHD_Connection* connection,
                                   std::shared_ptr<HttpStream> stream,
                                   std::optional<uint64_t> length, unsigned& count) {
  const auto* const info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  (void)::setsockopt(info->connect_fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kUnsent, sizeof kUnsent);
  (void)::setsockopt(info->connect_fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &kPeerGone_ms,
                     sizeof kPeerGone_ms);
  auto body = std::make_unique<StreamBody>(loop, connection, std::move(stream), count);
  MHD_Response* const response = MHD_create_response_from_callback(
      length.value_or(MHD_SIZE_UNKNOWN), kBlock, &read_body, body.get(),
      [](void* gone) { delete static_cast<StreamBody*>(gone); });
  if (response == nullptr) return nullptr;
  (void)body.release();
  // As HTTP/1.0, whose bodies end with the connection. HTTP/1.1 would number the pieces, and the
  // library makes those no larger than the little memory of a connection.
  MHD_set_response_options(response, MHD_RF_HTTP_VERSION_1_0_ONLY, MHD_RO_END);
  return response;
}

}  // namespace sightline::control
