// SPDX-License-Identifier: Apache-2.0
//
// What is left of a recording when its writer dies or the disk is full.
#include <gmock/gmock.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "record/media.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using namespace test;

constexpr int kWritten = 77;  ///< frames per camera before the kill: 2.5 s at 30 per second
constexpr int64_t kStepMs = 33;

FramePtr crash_frame(uint32_t camera, int number, const Stream* jpegs) {
  FramePtr frame = frame_at(camera, number, 1000 + kStepMs * number + camera);
  if (!jpegs) return frame;
  FrameInfo info = frame->info();
  info.format = PixelFormat::kMjpeg;
  return Frame::decoded(info, pattern(number),
                        payload_of(jpegs->packets[static_cast<size_t>(number)].bytes));
}

/// Writes frames, says so through `pipe`, and waits to be killed.
[[noreturn]] void write_until_killed(const fs::path& folder, RawStorage storage,
                                     const Stream* jpegs, int pipe) {
  const PixelFormat format = jpegs ? PixelFormat::kMjpeg : PixelFormat::kI420;
  RecordingWriterOptions options;
  options.cameras = {{"a", format, kWidth, kHeight}, {"b", format, kWidth, kHeight}};
  options.raw_storage = storage;
  auto writer = RecordingWriter::create(folder, options);
  if (!writer) ::_exit(1);
  for (int i = 0; i < kWritten; ++i) {
    for (const uint32_t camera : {0u, 1u}) {
      if (!(*writer)->append(*crash_frame(camera, i, jpegs))) ::_exit(2);
    }
  }
  const char done = 'x';
  if (::write(pipe, &done, 1) != 1) ::_exit(3);
  for (;;) ::pause();
}

/// Runs write_until_killed() in a child, and kills it when it has written.
void kill_a_writer(const fs::path& folder, RawStorage storage, const Stream* jpegs) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) write_until_killed(folder, storage, jpegs, ends[1]);
  ::close(ends[1]);
  pollfd wait{ends[0], POLLIN, 0};
  EXPECT_EQ(::poll(&wait, 1, 60'000), 1);
  char done = 0;
  EXPECT_EQ(::read(ends[0], &done, 1), 1);
  ::close(ends[0]);
  ::kill(child, SIGKILL);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
}

void expect_loses_at_most_half_a_second(RawStorage storage, const Stream* jpegs) {
  TempFolder temp;
  ASSERT_NO_FATAL_FAILURE(kill_a_writer(temp / "r", storage, jpegs));
  auto recording = open_recording(temp / "r");
  ASSERT_TRUE(recording) << recording.error().message();
  for (const auto& camera : recording->cameras) {
    ASSERT_FALSE(camera.rows.empty());
    EXPECT_LE(kStepMs * (kWritten - static_cast<int64_t>(camera.rows.size())), 500) << camera.name;
  }
  const size_t expected = recording->frame_count();
  auto replay = *VirtualReplay::open(std::make_shared<const Recording>(*std::move(recording)));
  size_t frames = 0;
  for (;;) {
    const auto set = replay->next();
    ASSERT_TRUE(set) << set.error().message();
    if (!*set) break;
    for (const auto& frame : **set) {
      EXPECT_EQ(frame->info().status, FrameStatus::kGood);
      const auto source = pattern(static_cast<int>(frame->info().sequence));
      if (!jpegs) {
        EXPECT_EQ(hash_of(frame->i420()), hash_of(source->view()));
      }
      ++frames;
    }
  }
  EXPECT_EQ(frames, expected);
}

TEST(WriterCrash, KilledWhileWritingRaw) {
  expect_loses_at_most_half_a_second(RawStorage::kRaw, nullptr);
}
TEST(WriterCrash, KilledWhileWritingFfv1) {
  expect_loses_at_most_half_a_second(RawStorage::kFfv1, nullptr);
}
TEST(WriterCrash, KilledWhileWritingJpegs) {
  const Stream jpegs = encode_patterns("mjpeg", kWritten, 1);
  expect_loses_at_most_half_a_second(RawStorage::kRaw, &jpegs);
}

/// Exit status: the first thing that is not as it should be.
int write_to_a_full_disk(const fs::path& folder) {
  ::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{200'000, 200'000};
  if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) return 1;
  RecordingWriterOptions options;
  options.cameras = {{"a", PixelFormat::kI420, kWidth, kHeight}};
  auto writer = RecordingWriter::create(folder, options);
  if (!writer) return 2;
  Status status;
  for (int i = 0; i < 200 && status; ++i) status = (*writer)->append(*frame_at(0, i, 33 * i));
  if (status) return 3;
  if (status.error().code != ErrorCode::kIo) return 4;
  if (status.error().where.find("a.mkv") == std::string::npos) return 5;
  if ((*writer)->append(*frame_at(0, 500, 33 * 500))) return 6;
  if ((*writer)->close()) return 7;
  return 0;
}

/// The file-size limit stands in for a full disk: write() fails half-way.
TEST(WriterCrash, FullDiskIsAnErrorAndWhatWasWrittenOpens) {
  TempFolder temp;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) ::_exit(write_to_a_full_disk(temp / "r"));
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  const auto recording = open_recording(temp / "r");
  ASSERT_TRUE(recording) << recording.error().message();
  EXPECT_GT(recording->frame_count(), 20u);
}

TEST(WriterCrash, FullDevice) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  auto log = PoseLogWriter::create("/dev/full");
  ASSERT_TRUE(log);
  ASSERT_TRUE((*log)->append({Time{}, "cup", TrackState::kSearching, {}, 0, 0, {}}));
  const auto status = (*log)->flush();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_THAT(status.error().message(), testing::HasSubstr("free some space"));
}

}  // namespace
}  // namespace sightline
