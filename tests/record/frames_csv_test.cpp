// SPDX-License-Identifier: Apache-2.0
//
// frames.csv of long recordings: read as it comes, with a small index in memory.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>

#include "record/media.hpp"
#include "sightline/record/recording.hpp"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using namespace test;
using testing::HasSubstr;
using testing::Not;

constexpr int64_t kHourMs = 3'600'000;
constexpr uint64_t kMegabyte = 1'000'000;

/// A folder on the disk of the build (the one for temporary files may be memory).
class BuildFolder {
 public:
  BuildFolder() : path_(fs::path(SIGHTLINE_BINARY_DIR) / fmt::format("long.{}", ::getpid())) {
    fs::create_directories(path_);
  }
  ~BuildFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  fs::path operator/(const char* name) const { return path_ / name; }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// What a daemon that has been up for a month writes in `hours` with three cameras at 30 Hz; the
/// times jitter, as those of real cameras do. Returns the number of rows of each camera.
uint64_t write_long_csv(const fs::path& path, int64_t hours) {
  std::ofstream out(path, std::ios::binary);
  std::string text = "camera,sequence,capture_ns,arrival_ns,dropped_before\n";
  const auto rows = static_cast<uint64_t>(hours * kHourMs * 30 / 1000);
  uint64_t noise = 1;
  for (uint64_t i = 0; i < rows; ++i) {
    for (const char* camera : {"left", "right", "side"}) {
      noise = noise * 6364136223846793005u + 1442695040888963407u;
      const uint64_t capture = 2'592'000'000'000'000 + i * 33'333'333 + noise % 1'000'000;
      text += fmt::format("{},{},{},{},0\n", camera, 77'000'000 + i, capture,
                          capture + 9'000'000 + noise % 3'000'000);
    }
    if (text.size() < (1u << 20) && i + 1 < rows) continue;
    out.write(text.data(), static_cast<std::streamsize>(text.size()));
    text.clear();
  }
  return out.flush() ? rows : 0;
}

/// Three cameras of two images each: what is asked here is decided before the videos are.
void write_three_cameras(const fs::path& folder) {
  RecordingWriterOptions options;
  for (const char* name : {"left", "right", "side"}) {
    options.cameras.push_back({name, PixelFormat::kI420, kWidth, kHeight});
  }
  auto writer = RecordingWriter::create(folder, options);
  ASSERT_TRUE(writer) << writer.error().message();
  for (int i = 0; i < 2; ++i) {
    for (uint32_t camera = 0; camera < 3; ++camera) {
      ASSERT_TRUE((*writer)->append(*frame_at(camera, i, 1000 + 100 * i)));
    }
  }
  ASSERT_TRUE((*writer)->close());
}

/// Largest memory of this process so far [bytes].
uint64_t peak_memory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return std::stoull(line.substr(6)) * 1024;
  }
  return 0;
}

TEST(LongRecording, OfEighteenHoursOpens) {
  const BuildFolder temp;
  if (fs::space(temp.path()).available < 1000 * kMegabyte) {
    GTEST_SKIP() << "less than 1 GB of room in " << temp.path();
  }
  write_three_cameras(temp / "rec");
  const fs::path csv = temp.path() / "rec" / "frames.csv";
  const uint64_t rows = write_long_csv(csv, 18);
  ASSERT_EQ(rows, 1'944'000u);
  ASSERT_GT(fs::file_size(csv), size_t{256} << 20);
  const uint64_t before = peak_memory();
  const auto opened = open_recording(temp / "rec");
  const uint64_t taken = peak_memory() - before;
  // All rows have been read and counted; only the videos of this test are too short for them.
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error().message(), HasSubstr("camera left has 1944000 rows"));
  std::printf("%llu rows, %llu MB of text: %llu MB of memory\n",
              static_cast<unsigned long long>(3 * rows),
              static_cast<unsigned long long>(fs::file_size(csv) / kMegabyte),
              static_cast<unsigned long long>(taken / kMegabyte));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(taken, 120 * kMegabyte);
#endif
}

class FramesCsvFile : public testing::Test {
 protected:
  void SetUp() override { write_small_recording(folder()); }
  fs::path folder() const { return temp_ / "rec"; }
  fs::path csv() const { return folder() / "frames.csv"; }
  std::string refusal() const {
    const auto opened = open_recording(folder());
    return opened ? "opened" : opened.error().message();
  }

  TempFolder temp_;
};

TEST_F(FramesCsvFile, ALineWithoutEndIsRefusedBeforeItFillsTheMemory) {
  fs::resize_file(csv(), 0);
  write_text(csv(),
             "camera,sequence,capture_ns,arrival_ns,dropped_before\n" + std::string(20 << 20, 'x'));
  EXPECT_THAT(refusal(), HasSubstr("frames.csv:2: a line of more than"));
}

TEST_F(FramesCsvFile, ZerosAtTheEndAreWhatAPowerCutLeaves) {
  const auto size = fs::file_size(csv());
  fs::resize_file(csv(), size + (3 << 20));
  EXPECT_EQ(refusal(), "opened");
}

/// A sparse file may claim any size; reading zeros for hours is no answer.
TEST_F(FramesCsvFile, ZerosWithoutEndAreRefused) {
  fs::resize_file(csv(), uint64_t{1} << 40);
  EXPECT_THAT(refusal(), HasSubstr("zeros"));
}

TEST_F(FramesCsvFile, IsNoFolderAndNoPipe) {
  fs::remove(csv());
  EXPECT_THAT(refusal(), HasSubstr("frames.csv: cannot open"));
  fs::create_directory(csv());
  EXPECT_THAT(refusal(), HasSubstr("not a regular file"));
}

/// Lines that lie across the pieces in which the file is read.
TEST_F(FramesCsvFile, RowsComeOutAsTheyWereWritten) {
  std::string text = "camera,sequence,capture_ns,arrival_ns,dropped_before\n";
  constexpr int kRows = 60'000;
  for (int i = 0; i < kRows; ++i) {
    const uint64_t sequence =
        i < 1000 ? static_cast<uint64_t>(i) : UINT64_MAX - kRows + static_cast<uint64_t>(i);
    text += fmt::format("left,{},{},{},{}\n", sequence,
                        5'000'000'000'000 + int64_t{i % 97} * 1000 + int64_t{i} * 100'000'000,
                        i % 3 == 0 ? 0 : 4'000'000'000'000'000'000, i % 7 == 0 ? UINT32_MAX : 0);
  }
  write_text(csv(), text);
  const std::vector<std::string> cameras = {"left"};
  const auto parsed = parse_frames_csv(text, "f.csv", cameras, nullptr);
  ASSERT_TRUE(parsed) << parsed.error().message();
  const auto& rows = (*parsed)[0];
  ASSERT_EQ(rows.size(), static_cast<size_t>(kRows));
  std::string again = "camera,sequence,capture_ns,arrival_ns,dropped_before\n";
  for (const RecordedRow& row : rows) {
    again += fmt::format("left,{},{},{},{}\n", row.sequence, to_ns(row.capture), to_ns(row.arrival),
                         row.dropped_before);
  }
  EXPECT_TRUE(again == text);
  EXPECT_EQ(rows[41'234].line, 41'236u);
  EXPECT_THAT(refusal(), HasSubstr("camera left has 60000 rows"));
}

}  // namespace
}  // namespace sightline
