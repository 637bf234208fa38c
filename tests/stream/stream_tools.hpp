// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the tests of this room share: images, a decoder, child processes, bounded waits.

extern "C" {
#include <libavcodec/avcodec.h>
}
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "sightline/model/stream_types.hpp"

namespace sightline {

/// Polls `done` until it holds; false after `timeout`.
inline bool eventually(const std::function<bool()>& done,
                       Duration timeout = std::chrono::seconds(30)) {
  const Time deadline = MonotonicClock::now() + timeout;
  while (!done()) {
    if (MonotonicClock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

/// A gradient that moves with `number`.
inline std::shared_ptr<const Image> synthetic_image(int width, int height, int number) {
  auto image = std::make_shared<Image>(width, height);
  const MutableI420View view = image->mutable_view();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      view.y.row(y)[x] = static_cast<uint8_t>(40 + (x + y + 4 * number) % 160);
    }
  }
  for (const MutablePlaneView& plane : {view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) {
      std::fill_n(plane.row(y), plane.width, static_cast<uint8_t>(128));
    }
  }
  return image;
}

inline AnnotatedImage annotated(std::shared_ptr<const Image> image, uint64_t sequence,
                                Time capture) {
  AnnotatedImage result;
  result.frame.camera = CameraId(1);
  result.frame.sequence = sequence;
  result.frame.capture = capture;
  result.frame.width = image->width();
  result.frame.height = image->height();
  result.image = std::move(image);
  PoseAt pose;
  pose.source = PoseSource::kEstimated;
  pose.estimate.state = TrackState::kTracking;
  pose.estimate.world_from_object.translation = {0.001 * static_cast<double>(sequence), 0, 1};
  result.poses = {pose};
  return result;
}

/// H.264 access units to images, one out for each in.
class H264Decoder {
 public:
  H264Decoder() : context_(avcodec_alloc_context3(avcodec_find_decoder(AV_CODEC_ID_H264))) {
    context_->thread_count = 1;
    context_->flags |= AV_CODEC_FLAG_LOW_DELAY;
    av_log_set_level(AV_LOG_QUIET);
    open_ = avcodec_open2(context_.get(), nullptr, nullptr) == 0;
  }

  struct Decoded {
    int width = 0, height = 0;
    std::vector<uint8_t> luma;
  };

  /// Empty luma if the decoder had nothing to show for it.
  Decoded decode(std::span<const uint8_t> unit) {
    std::vector<uint8_t> padded(unit.begin(), unit.end());
    padded.resize(unit.size() + AV_INPUT_BUFFER_PADDING_SIZE);
    const std::unique_ptr<AVPacket, FreePacket> packet(av_packet_alloc());
    packet->data = padded.data();
    packet->size = static_cast<int>(unit.size());
    Decoded result;
    if (!open_ || avcodec_send_packet(context_.get(), packet.get()) != 0) return result;
    const std::unique_ptr<AVFrame, FreeFrame> frame(av_frame_alloc());
    if (avcodec_receive_frame(context_.get(), frame.get()) != 0) return result;
    result.width = frame->width;
    result.height = frame->height;
    for (int y = 0; y < frame->height; ++y) {
      const uint8_t* row = frame->data[0] + static_cast<ptrdiff_t>(y) * frame->linesize[0];
      result.luma.insert(result.luma.end(), row, row + frame->width);
    }
    return result;
  }

 private:
  struct FreeContext {
    void operator()(AVCodecContext* p) const { avcodec_free_context(&p); }
  };
  struct FreePacket {
    void operator()(AVPacket* p) const { av_packet_free(&p); }
  };
  struct FreeFrame {
    void operator()(AVFrame* p) const { av_frame_free(&p); }
  };
  std::unique_ptr<AVCodecContext, FreeContext> context_;
  bool open_ = false;
};

/// Mean absolute luma difference.
inline double difference(const H264Decoder::Decoded& decoded, const Image& image) {
  if (decoded.width != image.width() || decoded.height != image.height()) return 1e9;
  const PlaneView luma = image.view().y;
  double sum = 0;
  for (int y = 0; y < luma.height; ++y) {
    for (int x = 0; x < luma.width; ++x) {
      sum += std::abs(int{luma.row(y)[x]} -
                      int{decoded.luma[static_cast<size_t>(y * luma.width + x)]});
    }
  }
  return sum / (static_cast<double>(luma.width) * luma.height);
}

/// A child process; killed and reaped when it goes out of scope.
class Child {
 public:
  /// Runs a program of the PATH; its output goes to /dev/null.
  explicit Child(std::vector<std::string> arguments) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const int fd : {0, 1, 2}) {
      posix_spawn_file_actions_addopen(&actions, fd, "/dev/null", O_RDWR, 0);
    }
    if (posix_spawnp(&pid_, argv[0], &actions, nullptr, argv.data(), environ) != 0) pid_ = -1;
    posix_spawn_file_actions_destroy(&actions);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    if (pid_ <= 0) return;
    send(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }

  void send(int signal) const {
    if (pid_ > 0) kill(pid_, signal);
  }
  /// Exit status, or -1 if it was killed, did not start or did not end in time.
  int wait(Duration timeout = std::chrono::seconds(60)) {
    int status = 0;
    if (pid_ <= 0 ||
        !eventually([&] { return waitpid(pid_, &status, WNOHANG) == pid_; }, timeout)) {
      return -1;
    }
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_ = -1;
};

inline bool has_program(const std::string& name) {
  Child child({name, "-version"});
  return child.wait(std::chrono::seconds(20)) == 0;
}

}  // namespace sightline
